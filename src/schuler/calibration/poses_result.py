"""`PosesFit`: what hand-held poses tell, as text, rows and JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._result import Result
from schuler.calibration.apply import Calibration

__all__ = ["PosesFit"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PosesFit(Result):
    """What hand-held poses tell.

    Parameters
    ----------
    calibration : Calibration
    dwells : (m, 2) int64
        First sample of each pose and the one after its last.
    used : (m,) bool
        False: a bad pose, left out.
    residual : (m,) float64
        |f| - gravity of each pose, m/s^2.
    accel_covariance, gyro_covariance : (9, 9) float64
        Of bias and the six of the matrix (rows: 00, 01, 02, 11, 12, 22), and of the gyros' matrix
        by rows; NaN without gyros.
    turn_angle, turn_error : (k,) float64
        Angle between gravity before and after a turn, and what the gyros miss it by, rad.
    turn_error_before : (k,) float64
        The same with the gyros' given scale.
    unseen : list of str
        What is not observable from these poses, or only weakly.
    gravity : float
        m/s^2.
    remarks : tuple of str
        What was found of the axes: gyros that are exchanged or reversed.
    gravity_from : str
        Where gravity is from, in words.
    """

    calibration: Calibration
    dwells: Index
    used: NDArray[np.bool_]
    residual: Array
    accel_covariance: Array
    gyro_covariance: Array
    turn_angle: Array
    turn_error: Array
    turn_error_before: Array
    unseen: list[str]
    gravity: float
    remarks: tuple[str, ...] = ()
    gravity_from: str = "as given"

    @property
    def rms(self) -> float:
        """Root mean square of |f| - gravity over the poses used, m/s^2."""
        return float(np.sqrt(np.mean(self.residual[self.used] ** 2)))

    def columns(self) -> dict[str, Any]:
        """Return a row to each pose: whether it was used, and by how much it misses gravity."""
        return {
            "pose": list(range(1, len(self.dwells) + 1)),
            "used": self.used.tolist(),
            "residual [m/s^2]": self.residual.tolist(),
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the result with the keys of the JSON schema `schuler.calibrate-poses/2`."""
        c = self.calibration
        out: dict[str, Any] = {
            "schema": "schuler.calibrate-poses/2",
            "input": c.input,
            "poses": len(self.dwells),
            "used": int(self.used.sum()),
            "gravity_m_s2": self.gravity,
            "residual_rms_m_s2": self.rms,
            "residual_m_s2": self.residual.tolist(),
            "accelerometer": {
                "bias": c.accel_bias.tolist(), "matrix": c.accel_matrix.tolist(),
                "bias_sigma": c.sigma["accel_bias"].tolist(),
                "matrix_sigma": c.sigma["accel_matrix"].tolist(),
            },
            "gyro": None,
            "turn_error_rms_deg": None,
            "turn_error_before_rms_deg": None,
            "unseen": self.unseen,
            "remarks": list(self.remarks),
            "gravity_from": self.gravity_from,
        }  # fmt: skip
        if self.turn_error.size:
            out["gyro"] = {
                "bias": c.gyro_bias.tolist(), "matrix": c.gyro_matrix.tolist(),
                "matrix_sigma": c.sigma["gyro_matrix"].tolist(),
            }  # fmt: skip
            for key, values in (
                ("turn_error_rms_deg", self.turn_error),
                ("turn_error_before_rms_deg", self.turn_error_before),
            ):
                out[key] = float(np.rad2deg(np.sqrt(np.mean(values**2))))
        return out

    def __str__(self) -> str:
        c = self.calibration
        lines = [
            f"{len(self.dwells)} poses, {int(self.used.sum())} used; |f| - gravity "
            f"{1e3 * self.rms:.3f} mm/s^2 rms, "
            f"{1e3 * np.abs(self.residual[self.used]).max():.3f} largest",
            f"gravity {self.gravity:.6f} m/s^2, {self.gravity_from}",
        ]
        unit = "counts" if c.input == "counts" else "m/s^2"
        for k, axis in enumerate("xyz"):
            row = "  ".join(f"{v:12.6g}" for v in c.accel_matrix[k])
            lines.append(
                f"accelerometer {axis}: bias {c.accel_bias[k]:12.6g} ± "
                f"{c.sigma['accel_bias'][k]:.2g} {unit}   matrix {row}"
            )
        if self.turn_error.size:
            for k, axis in enumerate("xyz"):
                row = "  ".join(f"{v:12.6g}" for v in c.gyro_matrix[k])
                lines.append(
                    f"gyro {axis}: bias {c.gyro_bias[k]:12.6g}   matrix {row}   ± "
                    f"{c.sigma['gyro_matrix'][k].max():.2g}"
                )
            rms = [
                np.rad2deg(np.sqrt(np.mean(v**2)))
                for v in (self.turn_error_before, self.turn_error)
            ]
            lines.append(
                f"{self.turn_error.size} turns: the gyros miss gravity by {rms[1]:.3g} deg rms "
                f"({rms[0]:.3g} with the scale as given)"
            )
        lines += [text if "left out" in text else f"not observable: {text}" for text in self.unseen]
        return "\n".join(lines)
