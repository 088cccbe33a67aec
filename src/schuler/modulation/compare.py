"""`compare_rotation`: an array's errors over hours, fixed, turned about one axis and about two."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._result import Result, table_of_rows
from schuler.constants import DEG_PER_HOUR
from schuler.errors import InputError
from schuler.modulation.case import RotationCase
from schuler.modulation.propagation import end_errors, turned
from schuler.modulation.residual import scheme_residual
from schuler.motion.named_schemes import named_scheme
from schuler.motion.rotation import Scheme

__all__ = ["RotationComparison", "compare_rotation", "strapdown_end"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RotationComparison(Result):
    """End errors over latitudes (p) and headings (q).

    Parameters
    ----------
    case : RotationCase
    fixed, single, double : (p, q, 2) float64
        East and north position error at the end, m.
    check : mapping of str to (2,) float64, optional
        Where the case's own site and heading end by full navigation, by scheme: east, north, m.
    """

    case: RotationCase
    fixed: Array = field(repr=False)
    single: Array = field(repr=False)
    double: Array = field(repr=False)
    check: Mapping[str, Array] | None = field(default=None, repr=False)

    def metres(self) -> dict[str, Array]:
        """Return the lengths of the errors, (p, q), by scheme."""
        return {
            name: np.hypot(*np.moveaxis(value, -1, 0))
            for name, value in (
                ("fixed", self.fixed), ("single_axis", self.single), ("two_axis", self.double),
            )
        }  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return all figures, as the JSON has them."""
        case, m = self.case, self.metres()
        one, two = 1.0 - m["single_axis"] / m["fixed"], 1.0 - m["two_axis"] / m["fixed"]
        rows = [
            {
                "latitude_deg": float(lat), "heading_deg": float(head % 360.0),
                "psi_deg": float(-head % 360.0),
                **{f"{name}_m": float(value[i, j]) for name, value in m.items()},
                "single_axis_reduction_percent": float(100.0 * one[i, j]),
                "two_axis_reduction_percent": float(100.0 * two[i, j]),
            }
            for i, lat in enumerate(case.latitudes)
            for j, head in enumerate(case.headings)
        ]  # fmt: skip
        e = case.errors
        return {
            "schema": "schuler.rotation/1",
            "name": case.name,
            "duration_s": case.duration,
            "array": case.array.name,
            "equivalent_gyro_bias_deg_h": (np.asarray(e.gyro_bias) / DEG_PER_HOUR).tolist(),
            "schemes": {
                "single_axis": {"name": case.single.name,
                                **scheme_residual(case.single).to_dict(case.site.lat)},
                "two_axis": {"name": case.double.name,
                             **scheme_residual(case.double).to_dict(case.site.lat)},
            },
            "latitudes": [
                {
                    "latitude_deg": float(lat),
                    **{f"{name}_largest_m": float(value[i].max()) for name, value in m.items()},
                    "single_axis_reduction_percent": [float(100 * one[i].min()),
                                                      float(100 * one[i].max())],
                    "two_axis_least_ratio": float(
                        (m["fixed"][i] / np.maximum(m["two_axis"][i], 1e-9)).min()
                    ),
                }
                for i, lat in enumerate(case.latitudes)
            ],
            "rows": rows,
            "check": None if self.check is None else {
                "latitude_deg": case.site.lat, "heading_deg": case.heading,
                **{f"{name}_enu_m": end.tolist() for name, end in self.check.items()},
            },
        }  # fmt: skip

    def checked(self) -> RotationComparison:
        """Return the same with the case's own site and heading navigated in full as well."""
        schemes = {
            "fixed": named_scheme("fixed"), "single_axis": self.case.single,
            "two_axis": self.case.double,
        }  # fmt: skip
        ends = {name: strapdown_end(self.case, scheme)[0] for name, scheme in schemes.items()}
        return replace(self, check=ends)

    def columns(self) -> dict[str, Any]:
        """Return a row to each latitude and heading."""
        return table_of_rows(self.to_dict()["rows"])

    def __str__(self) -> str:
        data = self.to_dict()
        one, two = (data["schemes"][k]["name"] for k in ("single_axis", "two_axis"))
        lines = [
            f"{data['name']}: {data['array']}, {data['duration_s'] / 3600:g} h at rest; "
            f"single axis: {one}; two axes: {two}",
            f"{'':>8}  {'largest error over headings, m':^32}  {'single axis is better by':^24}"
            f"  {'two axes,':>9}",
            f"{'lat deg':>8}  {'fixed':>10} {'single':>10} {'two':>10}  "
            f"{'worst %':>11} {'best %':>12}  {'times':>9}",
        ]
        for r in data["latitudes"]:
            low, high = r["single_axis_reduction_percent"]
            lines.append(
                f"{r['latitude_deg']:8.2f}  {r['fixed_largest_m']:10.1f} "
                f"{r['single_axis_largest_m']:10.1f} {r['two_axis_largest_m']:10.1f}  {low:11.1f} "
                f"{high:12.1f}  {r['two_axis_least_ratio']:9.1f}"
            )
        for name, (east, north) in (self.check or {}).items():
            lines.append(
                f"navigated in full at {self.case.site.lat:g} deg, heading "
                f"{self.case.heading:g}: {name.replace('_', ' ')} {east:.1f} m east, "
                f"{north:.1f} m north"
            )
        return "\n".join(lines)


def compare_rotation(case: RotationCase) -> RotationComparison:
    """Propagate a case's errors fixed, turned about one axis and about two.

    Raises
    ------
    InputError
        If the fixed instrument makes no error somewhere: there is nothing to reduce.

    Examples
    --------
    >>> compared = compare_rotation(RotationCase.from_toml("rotation.toml"))
    >>> bool(np.linalg.norm(compared.single[0, 0]) < np.linalg.norm(compared.fixed[0, 0]))
    True
    """
    fixed = named_scheme("fixed")
    ends = [
        end_errors(turned(scheme, case.duration), case.errors, case.latitudes, case.headings,
                   case.site.height)
        for scheme in (fixed, case.single, case.double)
    ]  # fmt: skip
    if np.any(np.hypot(*np.moveaxis(ends[0], -1, 0)) < 1e-6):
        raise InputError(
            f"{case.name}: these errors move the fixed instrument nowhere at some heading, so "
            "there is nothing to compare; give it a gyro or accelerometer bias"
        )
    return RotationComparison(case, ends[0], ends[1], ends[2])


def strapdown_end(
    case: RotationCase, scheme: Scheme, rate: float = 10.0, runs: int = 1,
    walks: tuple[float, float] = (0.0, 0.0), rng: np.random.Generator | None = None,
) -> Array:  # fmt: skip
    """Navigate a case in full, and return where it ends against the truth: east, north, m.

    Parameters
    ----------
    case : RotationCase
        At its site and heading.
    scheme : Scheme
    rate : float
        Samples a second, Hz.
    runs : int
        With random walks: how many to draw. They are spread over the processor's cores.
    walks : (float, float)
        Angle and velocity random walk, rad/sqrt(s) and m/s/sqrt(s).
    rng : numpy.random.Generator, optional
        Needed with random walks.

    Returns
    -------
    (runs, 2) ndarray

    Examples
    --------
    >>> case = RotationCase.from_toml("rotation.toml")
    >>> strapdown_end(case, case.single, rate=1.0).shape
    (1, 2)
    """
    import os
    from concurrent.futures import ThreadPoolExecutor

    from schuler.earth import radii
    from schuler.kernels import strapdown
    from schuler.kernels.states import StrapdownOptions
    from schuler.motion import Static
    from schuler.navigation.navigator import local_rows
    from schuler.navigation.start import Start
    from schuler.simulation import simulate

    if any(walks) and rng is None:
        raise InputError("random walks need a random generator: give rng")
    made = simulate(scheme.on(Static(case.heading)), case.site, case.duration, rate)
    r = made.record
    state = Start(case.site, made.truth.known("quat_nb")[0]).state().data
    told = StrapdownOptions.zeros()
    told.gravity_model, told.vertical_mode = strapdown.SOMIGLIANA, strapdown.OFF
    told.held_height = case.site.height
    workers = min(os.cpu_count() or 1, runs)
    shares = np.array_split(np.arange(runs), workers)
    generators = (rng or np.random.default_rng(0)).spawn(workers)
    ends = np.empty((runs, strapdown.ROW))
    row = case.errors.row(walks)

    def work(share: Any, generator: np.random.Generator) -> None:
        starts, errors = np.tile(state, (len(share), 1)), np.tile(row, (len(share), 1))
        found = np.empty((len(share), strapdown.ROW))
        strapdown.many(starts, told.data, 1.0 / rate, r.dtheta, r.dvel, errors, generator, found)
        ends[share] = found

    with ThreadPoolExecutor(workers) as pool:
        for future in [pool.submit(work, a, b) for a, b in zip(shares, generators, strict=True)]:
            future.result()
    place = local_rows(ends)
    rm, rn = (float(x) + case.site.height for x in radii(case.site.latitude))
    lon = np.remainder(place.lon - case.site.longitude + np.pi, 2 * np.pi) - np.pi
    return np.column_stack([
        lon * rn * np.cos(case.site.latitude), (place.lat - case.site.latitude) * rm,
    ])  # fmt: skip
