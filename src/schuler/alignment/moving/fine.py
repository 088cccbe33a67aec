"""Fine alignment in motion: the aided filter from the coarse attitude, twice or more.

From a wide prior, corrections that are fed back break the linear model: a pass runs without
feedback until its heading is known to two degrees. Its smoother then gives a better start, and the
next pass is made about that, with the prior of the first: nothing is used twice. That is Gauss and
Newton's iteration, and it ends when the start no longer moves.

Source: Bell (1994), the iterated smoother as a Gauss-Newton method.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.moving.beside import Beside
from schuler.alignment.moving.setup import Aid, Nominal, layout_of, make_filter
from schuler.attitude import multiply, quat_to_matrix, quat_to_rotvec, rotvec_to_quat
from schuler.constants import DEG, DEG_PER_HOUR
from schuler.earth import radii
from schuler.errors import InputError
from schuler.ins import ErrorStateFilter, Layout, Measurement
from schuler.ins.frames import east_angle, to_east_north_up
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec
from schuler.units import time_text

__all__ = [
    "CHUNK", "KNOWN", "FineAlignment", "FineState", "correct_if_known", "difference", "fine",
    "known_heading",
]  # fmt: skip

Array = NDArray[np.float64]

KNOWN = 2.0 * DEG
"""1-sigma of the heading from which on the filter corrects itself."""

_HALF_KNOWN, _LATE = 10.0 * DEG, 120.0
"""1-sigma, and the time from which on it is enough (s): a coarse gyro leaves what is linear."""

_COARSE_GYRO = 30.0 * DEG_PER_HOUR
"""With a larger bias a long span is begun by passes over its first part alone."""

_FIRST_PART = 150.0
"""How long that is, s: a navigation that nothing corrects stays within what is linear."""

CHUNK = 5.0
"""How often a pass looks whether its heading is known, s."""

_MEMORY = 1.5e9
"""Largest memory of a smoother, bytes."""

_FARTHEST = 20e3
"""A start that a pass moves so far (m) is none: the error equations are for less."""

_MOST_PASSES = 8
_STILL = 0.1
"""A start that moves by less than so many sigma stays where it is."""

_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


@dataclass(frozen=True, eq=False)
class FineState:
    """What is known at one instant.

    Parameters
    ----------
    time : float
        s.
    lat, lon, height : float
        rad, m.
    quat_nb, v_n : (4,), (3,) float64
        East-North-Up.
    layout : Layout
        Of the covariance.
    covariance : (n, n) float64
        Of the error states; phi, velocity and position in East-North-Up.
    parameters : dict of str to array
    """

    time: float
    lat: float
    lon: float
    height: float
    quat_nb: Array
    v_n: Array
    layout: Layout
    covariance: Array
    parameters: dict[str, Array]

    @property
    def nominal(self) -> Nominal:
        """As the start of a pass."""
        return Nominal(
            self.lat, self.lon, self.height, self.quat_nb, self.v_n, dict(self.parameters)
        )


@dataclass(frozen=True, eq=False)
class FineAlignment:
    """Both ends of the span, and the filter of the last pass.

    Parameters
    ----------
    start, end : FineState
        Smoothed; filtered, which is the same there.
    budget : dict of str to (3, 3) float64
        Covariance of phi at the end by source, rad^2; empty where it was not asked for.
    passes : int
    moved : float
        How far the last pass moved the start, in sigma.
    filter : ErrorStateFilter
    running : ErrorStateFilter
        That of the end and the budget: it can run on from there.
    smoothed_heading : (3, k) float64
        Times of the measurements (s), the smoothed heading there, clockwise, and its 1-sigma (rad).
    """

    start: FineState
    end: FineState
    budget: dict[str, Array]
    passes: int
    moved: float
    filter: ErrorStateFilter
    running: ErrorStateFilter
    smoothed_heading: Array


def known_heading(spec: ImuSpec) -> float:
    """Return the 1-sigma of the heading that is enough after two minutes, rad."""
    return _HALF_KNOWN if spec.gyro.bias > _COARSE_GYRO else KNOWN


def correct_if_known(flt: ErrorStateFilter, elapsed: float, late: float) -> None:
    """Let a filter correct its navigation from now on, if its heading is known.

    Parameters
    ----------
    flt : ErrorStateFilter
    elapsed : float
        Time since the start, s.
    late : float
        1-sigma of the heading that is enough after two minutes, rad.
    """
    enough = KNOWN if elapsed < _LATE else late
    if not flt.feedback and flt.covariance[2, 2] < enough**2:
        flt.feedback = True


def run_pass(
    flt: ErrorStateFilter, record: ImuRecord, *, correct: bool = True, late: float = KNOWN
) -> None:
    """Feed a record; where that is allowed, correct the navigation once the heading is known.

    `late` is the 1-sigma of the heading that is enough after two minutes, rad.
    """
    middle = record.time - 0.5 * record.dt
    mark, done = record.start, 0
    while correct and not flt.feedback and mark < record.end - 1e-9:
        mark += CHUNK
        stop = int(np.searchsorted(middle, mark, side="right"))
        if stop > done:
            flt.update(record.rows(done, stop))
            correct_if_known(flt, mark - record.start, late)
        done = stop
    # Nothing is left to be decided, and any chunking gives the same bits.
    flt.update(record.rows(done, len(record)))


def _moved_place(lat: float, lon: float, height: float, off: Array) -> tuple[float, float, float]:
    """Return a place less an error east, north, up (3,), m."""
    meridian, transverse = (float(r) for r in radii(lat))
    east, north, up = (float(x) for x in off)
    return (
        lat - north / (meridian + height), lon - east / ((transverse + height) * np.cos(lat)),
        height - up,
    )  # fmt: skip


def difference(layout: Layout, one: Nominal, other: Nominal) -> Array:
    """Return the error state (n,) that a nominal has where the truth is another."""
    x = np.zeros(layout.size)
    x[:3] = -quat_to_rotvec(multiply(one.quat_nb, other.quat_nb * _CONJUGATE))
    x[layout["velocity"]] = one.v_n - other.v_n
    meridian, transverse = (float(r) for r in radii(one.lat))
    x[layout["position"]] = [
        (one.lon - other.lon) * (transverse + one.height) * np.cos(one.lat),
        (one.lat - other.lat) * (meridian + one.height), one.height - other.height,
    ]  # fmt: skip
    for name in layout:
        if name in ("phi", "velocity", "position"):
            continue
        place = layout[name]
        size = place.stop - place.start
        change = one.parameters.get(name, np.zeros(size)) - other.parameters.get(
            name, np.zeros(size)
        )
        x[place] = np.where(layout.sign[place] < 0.0, 1.0, -1.0) * change
    return x


def _smoothed_start(flt: ErrorStateFilter, before: Nominal, time: float) -> FineState:
    """Return what the smoother says of the start of a pass."""
    s = flt.smoothed()
    layout = flt.layout
    error = s.error[0]
    lat, lon, height = _moved_place(
        before.lat, before.lon, before.height, error[layout["position"]]
    )
    # At the start the wander frame is East-North-Up.
    parameters = {}
    for name in layout:
        place = layout[name]
        # What is never fed back has no estimate that a pass could start from.
        if name in ("phi", "velocity", "position") or not layout.sign[place.start]:
            continue
        sign = np.where(layout.sign[place] < 0.0, -1.0, 1.0)
        old = before.parameters.get(name, np.zeros(place.stop - place.start))
        parameters[name] = old + sign * error[place]
    quat = np.asarray(multiply(rotvec_to_quat(error[:3]), before.quat_nb))
    return FineState(
        time, lat, lon, height, quat, before.v_n - error[layout["velocity"]], layout,
        s.covariance[0], parameters,
    )  # fmt: skip


def _smoothed_heading(flt: ErrorStateFilter) -> Array:
    """Return times, headings (clockwise) and their 1-sigma at the epochs, (3, k), by smoothing."""
    s = flt.smoothed()
    _, _, angle = east_angle(s.history.quat_ne)
    # The first of the smoothed estimates is that of the start, which is no epoch.
    forward = quat_to_matrix(s.quat_nb[1:])[:, :2, 1]
    heading = np.arctan2(forward[:, 0], forward[:, 1]) + angle
    return np.stack([s.history.time, heading, np.sqrt(s.covariance[1:, 2, 2])])


def filtered_end(flt: ErrorStateFilter) -> tuple[FineState, dict[str, Array]]:
    """Return what the filter has at its last sample, and phi's covariance by source."""
    layout = flt.layout
    lat, lon, angle = (float(a[0]) for a in east_angle(flt.frame[None]))
    turn = to_east_north_up(angle)
    whole = np.eye(layout.size)
    for group in ("phi", "velocity", "position"):
        whole[layout[group], layout[group]] = turn
    x = flt.error_state
    place = _moved_place(lat, lon, flt.height, turn @ x[layout["position"]])
    quat = multiply(rotvec_to_quat(np.array([0.0, 0.0, -angle])), flt.quat_nb)
    parameters = {
        name: flt.parameter(name) for name in layout
        if name not in ("phi", "velocity", "position")
    }  # fmt: skip
    budget = {name: turn @ part[:3, :3] @ turn.T for name, part in flt.budget.items()}
    state = FineState(
        flt.time, *place, np.asarray(quat), turn @ flt.v_n, layout,
        whole @ flt.covariance @ whole.T, parameters,
    )  # fmt: skip
    return state, budget


def _fits(measured: Sequence[Measurement], layout: Layout, record: ImuRecord) -> None:
    """Refuse a span whose smoother would take more memory than an alignment is worth."""
    count = len(np.unique(np.concatenate([np.asarray(aid.time) for aid in measured])))
    needed = 3 * 8 * count * layout.padded**2
    if needed > _MEMORY:
        longest = (record.end - record.start) * _MEMORY / needed
        raise InputError(
            f"the span of {record.end - record.start:.6g} s has {count} instants of measurements, "
            f"whose smoothing takes {needed / 1e9:.2g} GB: take one of at most {longest:.3g} s "
            "(--from, --to); some minutes are enough for an attitude"
        )


def fine(
    record: ImuRecord, start: Nominal, spec: ImuSpec, vibration: float,
    measured: Sequence[Measurement], aids: Sequence[Aid | Beside], *,
    nominal: Nominal | None = None, budget: bool = True,
) -> FineAlignment:  # fmt: skip
    """Return the attitude at both ends of a record.

    Parameters
    ----------
    record : ImuRecord
        The span; a measurement may be at its very start.
    start : Nominal
        With the coarse attitude; the prior's mean.
    spec : ImuSpec
    vibration : float
        Least velocity random walk, m/s/sqrt(s).
    measured : sequence of Measurement
    aids : sequence of GnssFixes, BodySpeed, HeadingFixes or Height
        They are from, for their priors.
    nominal : Nominal, optional
        About which the first pass is linear, if not about the prior's mean: the coarse biases.
    budget : bool
        Divide the last pass's covariance by source.

    Raises
    ------
    InputError
        If the span is so long that it would take too much memory, or the passes diverge.
    """
    layout = layout_of(spec, measured)

    def build(nominal: Nominal, error: Array, divided: bool) -> ErrorStateFilter:
        return make_filter(
            nominal, spec, vibration, measured, aids, error_state=error, smooth=not divided,
            budget=divided,
        )  # fmt: skip

    first_part = np.inf if known_heading(spec) == KNOWN else _FIRST_PART
    return iterate(
        record,
        start,
        layout,
        measured,
        build,
        nominal=nominal,
        budget=budget,
        first_part=first_part,
    )


def iterate(
    record: ImuRecord, start: Nominal, layout: Layout, measured: Sequence[Measurement],
    build: Callable[[Nominal, Array, bool], ErrorStateFilter], *, nominal: Nominal | None = None,
    correct: bool = True, budget: bool = True, most: int = _MOST_PASSES,
    first_part: float = np.inf,
) -> FineAlignment:  # fmt: skip
    """Repeat passes of a filter from its own smoothed start until that no longer moves.

    Parameters
    ----------
    record : ImuRecord
    start : Nominal
        The prior's mean.
    layout : Layout
    measured : sequence of Measurement
    build : callable
        Returns a filter that starts at a nominal, with an error state, and that keeps what a
        smoother needs, or else its covariance by source.
    nominal : Nominal, optional
        Where the first pass starts, if not at the prior's mean.
    correct : bool
        Let a pass correct its navigation once the heading is known.
    budget : bool
        Divide the last pass's covariance by source.
    most : int
        Passes at most.
    first_part : float
        s; passes over so much of a span that is twice as long find where the others start.

    Raises
    ------
    InputError
        If the span is so long that it would take too much memory.
    """
    _fits(measured, layout, record)
    late = KNOWN if np.isinf(first_part) else _HALF_KNOWN
    nominal, passes, moved = nominal or start, 0, np.inf
    part = record
    if record.end - record.start > 2.0 * first_part:
        part = record.between(record.start, record.start + first_part)
    while True:
        passes += 1
        flt = build(nominal, difference(layout, nominal, start), False)
        run_pass(flt, part, correct=correct, late=late)
        begin = _smoothed_start(flt, nominal, record.start)
        step = difference(layout, nominal, begin.nominal)
        sigma = np.sqrt(np.maximum(np.diag(begin.covariance), 1e-300))
        moved = float(np.max(np.abs(step / sigma)))
        far = float(np.linalg.norm(step[layout["position"]]))
        if not far < _FARTHEST:
            raise InputError(
                f"{record.name}: the alignment from t = {time_text(record.start)} to "
                f"{time_text(record.end)} s "
                f"diverges: pass {passes} moves the start by {far:.3g} m. The record's axes, units "
                "and specification, or the delay, are not what they are said to be; a shorter "
                "span, or one that begins at rest, bears more"
            )
        if (passes >= 2 and moved < _STILL) or passes == most:
            if part is record:
                break
            part, passes = record, 0
        nominal = begin.nominal
    last = flt
    if budget:
        last = build(nominal, difference(layout, nominal, start), True)
        run_pass(last, record, correct=correct, late=late)
    end, parts = filtered_end(last)
    return FineAlignment(begin, end, parts, passes, moved, flt, last, _smoothed_heading(flt))
