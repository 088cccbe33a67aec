"""`rotation_history`: position, velocity and attitude error over the hours, by scheme."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from schuler._files import replacing
from schuler._result import Result
from schuler.constants import ARCMIN
from schuler.errors import InputError
from schuler.modulation.case import RotationCase
from schuler.modulation.propagation import error_series, turned
from schuler.motion.named_schemes import named_scheme

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["QUANTITIES", "RotationHistory", "rotation_history"]

Array = NDArray[np.float64]

#: what is drawn: key -> (words, unit)
QUANTITIES = {
    "east_m": ("east position error", "m"),
    "north_m": ("north position error", "m"),
    "distance_m": ("position error", "m"),
    "v_east_m_s": ("east velocity error", "m/s"),
    "v_north_m_s": ("north velocity error", "m/s"),
    "phi_east_arcmin": ("attitude error about east", "arcmin"),
    "phi_north_arcmin": ("attitude error about north", "arcmin"),
    "phi_up_arcmin": ("attitude error about up", "arcmin"),
}

_SCHEMES = ("fixed", "single_axis", "two_axis")
_MOST_POINTS = 600


@dataclass(frozen=True, eq=False)
class RotationHistory(Result):
    """Errors of a case at its own site and heading, from the start on.

    Parameters
    ----------
    case : RotationCase
    time : (n,) float64
        s.
    series : dict of str to dict of str to (n,) float64
        By scheme (``fixed``, ``single_axis``, ``two_axis``), then by quantity of `QUANTITIES`.
    """

    case: RotationCase
    time: Array = field(repr=False)
    series: dict[str, dict[str, Array]] = field(repr=False)

    def reduction(self, scheme: str) -> float:
        """Return by how much the position error at the end is smaller than fixed, %."""
        fixed, own = (self.series[name]["distance_m"][-1] for name in ("fixed", scheme))
        return float(100.0 * (1.0 - own / fixed))

    def to_dict(self) -> dict[str, Any]:
        """Return ends, largest values and thinned series (docs/rotation-history.schema.json)."""
        case = self.case
        names = {"fixed": "fixed", "single_axis": case.single.name, "two_axis": case.double.name}
        every = max(1, -(-len(self.time) // _MOST_POINTS))
        rows = np.unique(np.r_[np.arange(0, len(self.time), every), len(self.time) - 1])
        return {
            "schema": "schuler.rotation-history/1",
            "name": case.name,
            "array": case.array.name,
            "latitude_deg": case.site.lat,
            "heading_deg": case.heading % 360.0,
            "duration_s": case.duration,
            "time_s": self.time[rows].tolist(),
            "schemes": {
                key: {
                    "name": names[key],
                    "reduction_percent": self.reduction(key),
                    "end": {q: float(v[-1]) for q, v in table.items()},
                    "largest": {q: float(np.abs(v).max()) for q, v in table.items()},
                    "series": {q: v[rows].tolist() for q, v in table.items()},
                }
                for key, table in self.series.items()
            },
        }

    def columns(self) -> dict[str, Any]:
        """Return time, and a column ``SCHEME_QUANTITY`` of each series."""
        return {
            "time_s": self.time,
            **{f"{s}_{q}": v for s, table in self.series.items() for q, v in table.items()},
        }

    def to_pandas(self) -> pd.DataFrame:
        """Return all series as a table by time in s."""
        return super().to_pandas().set_index("time_s")

    def write_table(self, path: str | Path) -> None:
        """Write all series as a table: CSV or Parquet.

        Raises
        ------
        InputError
            If the suffix is neither, or the file cannot be written.
        """
        path = Path(path)
        if path.suffix not in (".csv", ".parquet"):
            raise InputError(f"{path}: a table is written as .csv or .parquet")
        columns = self.columns()
        with replacing(path) as part:
            if path.suffix == ".csv":
                with part.open("w", encoding="utf-8") as out:
                    out.write(",".join(columns) + "\n")
                    np.savetxt(out, np.column_stack(list(columns.values())), "%.9g", delimiter=",")
            else:
                import pyarrow as pa
                import pyarrow.parquet as pq

                with part.open("wb") as sink:
                    pq.write_table(pa.table(columns), sink)

    def __str__(self) -> str:
        case = self.case
        names = {"fixed": "fixed", "single_axis": case.single.name, "two_axis": case.double.name}
        lines = [
            f"{case.name}: {case.array.name}, {case.duration / 3600:g} h at rest, latitude "
            f"{case.site.lat:g} deg, heading {case.heading % 360:g} deg",
            f"{'':42} " + "".join(f"{names[key]:>24}" for key in self.series),
        ]
        for quantity, (words, unit) in QUANTITIES.items():
            lines.append(
                f"{words + ', ' + unit + ', end':42} "
                + "".join(f"{table[quantity][-1]:24.4g}" for table in self.series.values())
            )
            lines.append(
                f"{'  largest':42} "
                + "".join(
                    f"{np.abs(table[quantity]).max():24.4g}" for table in self.series.values()
                )
            )
        lines.append(
            f"{'position error at the end less by':42}"
            + "".join(f"{self.reduction(key):22.1f} %" for key in self.series)
        )
        return "\n".join(lines)


def rotation_history(case: RotationCase) -> RotationHistory:
    """Propagate a case's errors over its duration, fixed, about one axis and about two.

    By the linear error equations at the case's site and heading; `strapdown_end` navigates in full.

    Parameters
    ----------
    case : RotationCase

    Raises
    ------
    InputError
        If the fixed instrument ends where it began: there is nothing to reduce.

    Examples
    --------
    >>> float(rotation_history(RotationCase.from_toml("rotation.toml")).time[-1])
    3600.0
    """
    schemes = dict(zip(_SCHEMES, (named_scheme("fixed"), case.single, case.double), strict=True))
    series: dict[str, dict[str, Array]] = {}
    time: Array = np.zeros(1)
    for name, scheme in schemes.items():
        motion = turned(scheme, case.duration)
        x = error_series(motion, case.errors, case.site.lat, case.heading, case.site.height)
        time = motion.step * np.arange(len(x), dtype=np.float64)
        series[name] = {
            "east_m": x[:, 5], "north_m": x[:, 6], "distance_m": np.hypot(x[:, 5], x[:, 6]),
            "v_east_m_s": x[:, 3], "v_north_m_s": x[:, 4],
            **{f"phi_{axis}_arcmin": x[:, k] / ARCMIN
               for k, axis in enumerate(("east", "north", "up"))},
        }  # fmt: skip
    if series["fixed"]["distance_m"][-1] < 1e-6:
        raise InputError(
            f"{case.name}: these errors move the fixed instrument nowhere, so there is nothing to "
            "compare; give it a gyro or accelerometer bias"
        )
    return RotationHistory(case, time, series)
