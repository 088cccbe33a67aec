"""`TableTest`: what a test on a turntable has found, as text, rows and JSON."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._result import Result
from schuler.calibration.apply import Calibration
from schuler.constants import DEG_PER_HOUR, MICRO_G

__all__ = ["TableTest"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TableTest(Result):
    """What a test on a turntable has found.

    Parameters
    ----------
    kind : {"positions", "rates"}
    calibration : Calibration
    found : tuple of str
        Which of its parts are from this test.
    stretches : (m, 2) float64
        Begin and end of each dwell or turn, s (of its own record).
    truth, residual : (m, 3) float64
        What is true in each, and what the fit leaves of the outputs: m/s^2 or rad/s.
    residual_rms : float
    recognised : str
        What was recognised of the positions; empty where they were given.
    """

    kind: str
    calibration: Calibration
    found: tuple[str, ...]
    stretches: Array = field(repr=False)
    truth: Array = field(repr=False)
    residual: Array = field(repr=False)
    residual_rms: float
    recognised: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the test as JSON takes it (docs/calibrate-table.schema.json)."""
        c = self.calibration
        return {
            "schema": "schuler.calibrate-table/1",
            "kind": self.kind,
            "found": list(self.found),
            "values": {
                key: {
                    "value": getattr(c, key).tolist(),
                    "sigma": c.sigma[key].tolist() if key in c.sigma else None,
                }
                for key in ("gyro_bias", "gyro_matrix", "accel_bias", "accel_matrix")
            },
            "residual_rms": self.residual_rms,
            "recognised": self.recognised or None,
            "stretches": [
                {
                    "start_s": float(a),
                    "stop_s": float(b),
                    "true": t.tolist(),
                    "residual": r.tolist(),
                }
                for (a, b), t, r in zip(self.stretches, self.truth, self.residual, strict=True)
            ],
        }

    def columns(self) -> dict[str, Any]:
        """Return a row to each dwell or turn: times, what is true, what is left."""
        columns: dict[str, Any] = {"start_s": self.stretches[:, 0], "stop_s": self.stretches[:, 1]}
        for k, axis in enumerate("xyz"):
            columns |= {f"true_{axis}": self.truth[:, k], f"residual_{axis}": self.residual[:, k]}
        return columns

    def __str__(self) -> str:
        c, rates = self.calibration, self.kind == "rates"
        unit, factor = ("deg/h", DEG_PER_HOUR) if rates else ("ug", MICRO_G)
        what = "turns" if rates else "dwells"
        lines = [f"{len(self.stretches)} {what}; left {self.residual_rms / factor:.3g} {unit} rms"]
        if self.recognised:
            lines.append(f"recognised: {self.recognised}")
        for sensor, name, one, size in (
            ("accelerometer", "accel", "ug", MICRO_G), ("gyro", "gyro", "deg/h", DEG_PER_HOUR),
        ):  # fmt: skip
            bias, matrix = (f"{name}_{part}" for part in ("bias", "matrix"))
            for k, axis in enumerate("xyz"):
                text = f"{sensor} {axis}:"
                if bias in self.found:
                    text += f" bias {getattr(c, bias)[k] / size:.5g}"
                    if bias in c.sigma:
                        text += f" ± {c.sigma[bias][k] / size:.2g}"
                    text += f" {one}"
                if matrix in self.found:
                    row = getattr(c, matrix)[k] - np.eye(3)[k]
                    text += "  matrix less one " + "  ".join(f"{1e6 * v:9.1f}" for v in row)
                    text += f" ± {1e6 * c.sigma[matrix][k].max():.2g} ppm"
                if text[-1] != ":":
                    lines.append(text)
        return "\n".join(lines)
