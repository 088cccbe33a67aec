"""What an array of sensors is worth, as one result: working modes, failures, reliability."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from schuler._result import Result, table_of_rows
from schuler.sensors.array import SensorArray
from schuler.sensors.named_arrays import named_array
from schuler.sensors.parity import isolable
from schuler.sensors.reliability import Reliability

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["ArrayFigures"]


@dataclass(frozen=True, eq=False)
class ArrayFigures(Result):
    """The figures of an array.

    Parameters
    ----------
    array : SensorArray
    reliability : Reliability
        Of this array.
    hours : sequence of float
        Times at which the reliability is told, h.

    Examples
    --------
    >>> from schuler.sensors import Lifetime, Reliability, named_array
    >>> array = named_array("dodecahedron")
    >>> ArrayFigures(array, Reliability(array, Lifetime(5000.0)), hours=(1000.0,)).isolable
    True
    """

    array: SensorArray
    reliability: Reliability
    hours: Sequence[float] = (1000.0, 2000.0, 5000.0, 10000.0)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as JSON takes them (docs/array.schema.json)."""
        array, life = self.array, self.reliability.life
        figures = array.figures()
        triad = Reliability(named_array("triad"), life, self.reliability.coverage).mtbf
        return {
            "schema": "schuler.array/1",
            "name": array.name,
            "sensors": len(array),
            "H": array.h.tolist(),
            "HtH": _rounded(array.h.T @ array.h),
            "optimal": figures["optimal"],
            "total_variance": float(f"{figures['total_variance']:.12g}"),
            "determinant": float(f"{figures['determinant']:.12g}"),
            "condition": float(f"{figures['condition']:.12g}"),
            "subset_variance": {k: _rounded(v) for k, v in array.subset_variance().items()},
            "subset_determinant": {k: _rounded(v) for k, v in array.subset_determinant().items()},
            "isolable": self.isolable,
            "sensor_mtbf_h": life.mtbf,
            "weibull_shape": life.shape,
            "coverage": self.reliability.coverage,
            "mtbf_h": self.reliability.mtbf,
            "mtbf_ratio_to_triad": self.reliability.mtbf / triad,
            "reliability": {f"{t:g}": float(self.reliability.at(t)) for t in self.hours},
        }

    @property
    def isolable(self) -> bool:
        """Whether the parity alone isolates the faulty sensor."""
        return len(self.array) > 3 and isolable(self.array)

    def columns(self) -> dict[str, Any]:
        """Return variance of each axis and determinant, a row to each working mode."""
        variance, size = self.array.subset_variance(), self.array.subset_determinant()
        rows = [
            {
                "working": key, **dict(zip("xyz", map(float, v), strict=True)),
                "total": float(sum(v)), "determinant": float(size[key]),
            }
            for key, v in variance.items()
        ]  # fmt: skip
        return table_of_rows(rows)

    def to_pandas(self) -> pd.DataFrame:
        """Return `columns` as a table by the sensors that work."""
        return super().to_pandas().set_index("working")

    def __str__(self) -> str:
        data = self.to_dict()
        count = data["sensors"]
        lines = [
            f"{data['name']}: {count} sensors, total variance {data['total_variance']:.4g} "
            f"(at best {9 / count:.4g})",
            f"{'working':<14} {'x':>7} {'y':>7} {'z':>7} {'total':>7} {'|det|':>7}",
        ]
        for key, v in data["subset_variance"].items():
            if key.count(",") >= count - 2:
                lines.append(
                    f"{key:<14} {v[0]:7.4f} {v[1]:7.4f} {v[2]:7.4f} {sum(v):7.4f} "
                    f"{data['subset_determinant'][key]:7.4f}"
                )
        if not data["isolable"]:
            lines.append(
                "one wrong sensor can be seen, not told, from the parity alone" if count > 3
                else "a wrong sensor cannot be seen: there is no redundancy"
            )  # fmt: skip
        lines.append(
            f"MTBF {data['mtbf_h']:.1f} h, {data['mtbf_ratio_to_triad']:.3g} times that of three "
            f"(one sensor {data['sensor_mtbf_h']:g} h, coverage {data['coverage']:g})"
        )
        told = ", ".join(f"{v:.4f} at {t} h" for t, v in data["reliability"].items())
        lines.append(f"reliability {told}")
        return "\n".join(lines)


def _rounded(values: Any) -> Any:
    """Return nested lists of numbers to twelve digits: what is exact reads as exact."""
    if isinstance(values, np.ndarray):
        values = values.tolist()
    if isinstance(values, list):
        return [_rounded(v) for v in values]
    return round(float(values), 12) + 0.0
