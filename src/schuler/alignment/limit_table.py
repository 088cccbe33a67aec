"""The Cramér-Rao limit against the length of a test: what `schuler limit` gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from schuler._result import Result, table_of_rows
from schuler.alignment.bound import Limit, Position, position_limit
from schuler.alignment.next_position import Suggestion
from schuler.constants import DEG_PER_HOUR, MICRO_G
from schuler.earth import Site
from schuler.errors import InputError
from schuler.sensors import ImuSpec

if TYPE_CHECKING:
    from schuler.alignment.moving.path_bound import PathLimit

__all__ = ["LimitTable", "limit_columns", "limit_lines", "limit_table"]

_AXES = ("east", "north", "up")


@dataclass(frozen=True, eq=False)
class LimitTable(Result):
    """Limits of tests of several lengths.

    Parameters
    ----------
    spec : ImuSpec
    site : Site
    positions : tuple of Position
        Whose dwells are shortened or lengthened alike.
    limits : tuple of Limit
        One to each length.
    suggested : Suggestion or None
        The position that would help most after them.
    """

    spec: ImuSpec
    site: Site
    positions: tuple[Position, ...]
    limits: tuple[Limit, ...]
    suggested: Suggestion | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the table with the keys of the JSON schema `schuler.limit/2`."""
        data: dict[str, Any] = {
            "schema": "schuler.limit/2", "spec": self.spec.name, "latitude_deg": self.site.lat,
            "positions": len(self.positions),
            "rows": [
                {
                    "time_s": each.duration,
                    "sigma_arcmin": dict(zip(_AXES, map(float, each.sigma_arcmin), strict=True)),
                    "gyro_bias_deg_h": [float(v) / DEG_PER_HOUR for v in each.gyro_bias],
                    "accelerometer_bias_ug": [float(v) / MICRO_G for v in each.accel_bias],
                }
                for each in self.limits
            ],
        }  # fmt: skip
        if self.suggested is not None:
            p = self.suggested.position
            data["next"] = {
                "heading_ccw_deg": p.heading_ccw_deg, "pitch_deg": p.pitch_deg,
                "roll_deg": p.roll_deg, "dwell_s": p.dwell,
                "heading_sigma_arcmin": float(self.suggested.limit.sigma_arcmin[2]),
            }  # fmt: skip
        return data

    def columns(self) -> dict[str, Any]:
        """Return the limits, one row to a length."""
        return limit_columns(self.to_dict()["rows"])

    def __str__(self) -> str:
        lines = [
            "limit of phi, and what the test leaves of the biases (body x, y, z): "
            f"{self.spec.name}",
            *limit_lines(self.limits),
        ]
        if self.suggested is not None:
            p = self.suggested.position
            lines.append(
                f"next: psi {p.heading_ccw_deg:.4g}, pitch {p.pitch_deg:.4g}, roll "
                f"{p.roll_deg:.4g} deg for {p.dwell:g} s more: up "
                f"{self.suggested.limit.sigma_arcmin[2]:.4g}'"
            )
        return "\n".join(lines)


def limit_columns(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the rows of a table of limits as columns named with their units."""
    out = []
    for row in rows:
        cells = {"time [s]": row["time_s"]}
        cells |= {f"sigma {axis} [arcmin]": v for axis, v in row["sigma_arcmin"].items()}
        for key, name in (("gyro_bias_deg_h", "gyro bias {} [deg/h]"),
                          ("accelerometer_bias_ug", "accelerometer bias {} [ug]")):  # fmt: skip
            cells |= {name.format(axis): v for axis, v in zip("xyz", row[key], strict=True)}
        out.append(cells)
    return table_of_rows(out)


def limit_lines(limits: Sequence[Limit | PathLimit]) -> list[str]:
    """Return a table of limits as lines of text, the names of its columns first."""
    lines = [
        f"{'time s':>10}  {'east':>9}  {'north':>9}  {'up':>9}   {'gyro deg/h':^26}   "
        f"{'accelerometer ug':^26}"
    ]
    for each in limits:
        east, north, up = each.sigma_arcmin
        gyro = " ".join(f"{v / DEG_PER_HOUR:8.3g}" for v in each.gyro_bias)
        accel = " ".join(f"{v / MICRO_G:8.3g}" for v in each.accel_bias)
        lines.append(
            f"{each.duration:10.6g}  {east:8.4g}'  {north:8.4g}'  {up:8.4g}'   {gyro}   {accel}"
        )
    return lines


def limit_table(
    spec: ImuSpec, site: Site, times: Sequence[float],
    positions: Sequence[Position] = (Position(),), interval: float = 0.01,
) -> LimitTable:  # fmt: skip
    """Return the limit of tests of several lengths.

    Parameters
    ----------
    spec : ImuSpec
        The instrument; its biases are the prior.
    site : Site
    times : sequence of float
        Lengths, s; the dwells of all positions are scaled to each.
    positions : sequence of Position
    interval : float
        Sampling interval, s.

    Raises
    ------
    InputError
        For a time that is not positive, and as `position_limit`.

    Examples
    --------
    >>> from schuler.sensors import load_spec
    >>> found = limit_table(load_spec("navigation-fog"), Site(40.0), [60.0, 300.0])
    >>> [round(float(each.sigma_arcmin[2]), 2) for each in found.limits]
    [7.55, 4.31]
    """
    total = sum(p.dwell for p in positions)
    limits = []
    for time in times:
        if not time > 0:
            raise InputError(f"a test's length must be positive, got {time:g} s")
        scaled = [replace(p, dwell=p.dwell * time / total) for p in positions]
        limits.append(position_limit(spec, site, scaled, interval))
    return LimitTable(spec, site, tuple(positions), tuple(limits))
