"""`align_moving`: a record and its aids in, an alignment with its uncertainty out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import BodySpeed, BodyVelocity, GnssFixes, ZeroVelocity
from schuler.aiding.checks import check_speed
from schuler.alignment.history import History
from schuler.alignment.moving.fine import FineAlignment, difference, filtered_end, fine, run_pass
from schuler.alignment.moving.result import InMotion, MovingAlignment
from schuler.alignment.moving.setup import (
    Aid,
    Nominal,
    as_speed,
    at_rest,
    make_filter,
    measurements,
    prior_sigma,
)
from schuler.alignment.moving.span import (
    bias_at_rest,
    common_span,
    cut_span,
    place_at_start,
)
from schuler.attitude import nearest_quat, quat_to_matrix
from schuler.constants import DEG
from schuler.earth import Site, radii
from schuler.errors import InputError, expect
from schuler.in_motion.coarse import CoarseAlignment
from schuler.in_motion.start import Span
from schuler.ins import Measurement
from schuler.record import ImuRecord, Summariser
from schuler.sensors import CONSUMER_MEMS, ImuSpec, load_spec

__all__ = ["align_moving", "mean_square", "track_history"]

Array = NDArray[np.float64]

_VIBRATION = (0.003, 0.01, 0.03, 0.1)
"""Velocity random walks that are tried until the innovations agree, m/s/sqrt(s)."""

_NOISIER = 1.2
"""A record that has so much more noise than its specification is one of a vehicle that vibrates."""

_AGREES = 1.3
"""Mean squared normalised innovation up to which the noise is what it was said to be."""

_PROMPT = 0.005
"""A delay that is longer than this is taken off the stamps, s."""

_WRONG = 2.0
"""The same, beyond which record and aids contradict each other."""

_BEYOND = 6.0
"""Prior sigmas beyond which an estimate of the instrument contradicts its specification."""

_GROSS = 0.3
"""Scale factor or misalignment from which on it is another unit or axis."""

_REFUSED = 0.3
"""Share of refused measurements that contradicts."""


def align_moving(
    record: ImuRecord,
    aiding: Aid | BodyVelocity | Sequence[Aid | BodyVelocity | ZeroVelocity],
    site: Site | None = None,
    spec: ImuSpec | str | Path | None = None,
    *,
    span: tuple[float | None, float | None] | None = None,
    at: str = "end",
    vibration: float | None = None,
) -> MovingAlignment:
    """Align a vehicle that moves by what else was measured of its motion.

    Parameters
    ----------
    record : ImuRecord
        What lies before the span shows the gyro bias where the vehicle stood still.
    aiding : GnssFixes, BodySpeed, BodyVelocity, or a sequence of them and of ZeroVelocity
        On the record's clock.
    site : Site, optional
        Where the vehicle is at the start of the span; needed without GNSS fixes.
    spec : ImuSpec, str or path, optional
        The instrument; a MEMS of consumer grade when not given.
    span : (float or None, float or None), optional
        Begin and end, s in the record's time; the whole record when not given.
    at : {"end", "start"}
        The instant of the attitude.
    vibration : float, optional
        Least velocity random walk on the vehicle, m/s/sqrt(s); when not given, that of the
        samples' own scatter, or the least one with which the innovations agree with their sigma.

    Raises
    ------
    InputError
        If record and aids have no common span, or the span shows no heading; it says what is
        missing.
    """
    expect(record, ImuRecord, "record", "read a file with schuler.read")
    told = [aiding] if isinstance(aiding, Aid | BodyVelocity) else list(aiding)
    rests = tuple(each for each in told if isinstance(each, ZeroVelocity))
    given = [each for each in told if not isinstance(each, ZeroVelocity)]
    if not given:
        raise InputError("an alignment in motion needs aids: give GnssFixes or a BodySpeed")
    for each in given:
        if not isinstance(each, Aid | BodyVelocity):
            raise InputError(
                "aiding takes GnssFixes, BodySpeed and BodyVelocity, got "
                f"{type(each).__name__}: read a file with schuler.io.read_gnss, read_speed or "
                "read_dvl"
            )
    aids = [as_speed(each) for each in given]
    if at not in ("start", "end"):
        raise InputError(f"at must be start or end, got '{at}'")
    if vibration is not None and not (np.isfinite(vibration) and vibration >= 0.0):
        raise InputError(f"vibration must be 0 or more, got {vibration}")
    instrument = load_spec(spec)
    warnings = []
    if instrument is None:
        instrument = CONSUMER_MEMS
        warnings.append(
            f"no instrument specification was given: taken for {instrument.name} (say --spec)"
        )
    whole = cut_span(record, span)
    leader = next((aid for aid in aids if isinstance(aid, GnssFixes)), aids[0])
    part = common_span(whole, leader)
    for aid in aids:
        if isinstance(aid, BodySpeed) and isinstance(leader, GnssFixes):
            check_speed(aid, leader)
    bias, used_spec = bias_at_rest(record, part, leader, instrument)
    prepared = _Prepared(
        part, leader, aids, used_spec, bias, place_at_start(leader, part, site), rests
    )
    first, rough = prepared.coarse()
    found, taken = prepared.fine(rough, first, vibration)
    return _result(prepared, rough, found, taken, instrument, warnings, at)


@dataclass(frozen=True, eq=False)
class _Taken:
    """What the filter took, and with which noise.

    `restamped` is what was taken off the stamps of each aid, s.
    """

    measured: tuple[Measurement, ...]
    restamped: dict[str, float]
    noise: float
    square: float


@dataclass(frozen=True, eq=False)
class _Prepared:
    """A span, its aids and what is assumed of the instrument."""

    record: ImuRecord
    leader: Aid
    aids: list[Aid]
    spec: ImuSpec
    bias: Array
    site: Site
    rests: tuple[ZeroVelocity, ...] = ()

    def coarse(self) -> tuple[Aid, CoarseAlignment]:
        """Return the leader's measurements in the span, and the attitude at the start."""
        return Span(self.record, self.leader, self.spec, self.bias, self.site).coarse()

    def nominal(self, rough: CoarseAlignment) -> Nominal:
        """Return where the filter starts: the first measurement, and the coarse attitude."""
        quat = nearest_quat(rough.mat_nb)
        lat, lon, height = self.site.latitude, self.site.longitude, self.site.height
        leader, mat = self.leader, quat_to_matrix(quat)
        rate = self.record.dtheta[0] / self.record.dt[0] - self.bias
        arm = np.asarray(leader.lever, np.float64)
        turning = mat @ np.cross(rate, arm)
        if isinstance(leader, GnssFixes):
            k = int(np.searchsorted(
                np.asarray(leader.time) - leader.delay, self.record.start - 1e-9
            ))  # fmt: skip
            east, north, up = (float(x) for x in mat @ arm)
            meridian, transverse = (float(r) for r in radii(lat))
            lat -= north / (meridian + height)
            lon -= east / ((transverse + height) * np.cos(lat))
            height -= up
            if leader.v_n is not None:
                v_n = np.asarray(leader.v_n)[k] - turning
            else:
                place, time = leader.local(), np.asarray(leader.time)
                v_n = (place[k + 1] - place[k]) / (time[k + 1] - time[k])
        else:
            k = int(np.searchsorted(np.asarray(leader.time), self.record.start - 1e-9))
            v_n = mat @ leader.triples()[0][k] - turning
        return Nominal(lat, lon, height, quat, v_n, {"gyro_bias": self.bias})

    def _vibrations(self) -> list[float]:
        """Return the velocity random walks to try: first that of the samples' own scatter."""
        summariser = Summariser()
        summariser.push(self.record)
        seen = summariser.summary().noise_accel
        first = seen if seen > _NOISIER * self.spec.accelerometer.white else 0.0
        return [first, *(each for each in _VIBRATION if each > first)]

    def fine(
        self, rough: CoarseAlignment, cut: Aid, vibration: float | None
    ) -> tuple[FineAlignment, _Taken]:
        """Return the filter's result with the noise that its innovations agree with."""
        aids: list[Aid] = [cut if aid is self.leader else aid for aid in self.aids]
        measured = measurements(aids, self.record) + at_rest(self.rests, self.record)
        start = self.nominal(rough)
        # A coarse gyro turns by degrees within the span: linear is what the coarse stage left.
        about = replace(start, parameters={
            **start.parameters, "gyro_bias": self.bias + rough.gyro_bias,
            "accelerometer_bias": rough.accelerometer_bias,
        })  # fmt: skip
        for noise in self._vibrations() if vibration is None else (vibration,):
            found = fine(self.record, start, self.spec, noise, measured, aids, nominal=about)
            square = mean_square(found, measured)
            if square < _AGREES:
                break
        late = _delays(found, measured)
        moved = any(abs(each) > _PROMPT for each in late.values())
        if moved:
            # A delay is linear in the filter only where it is small: the stamps take most of it.
            measured = [_restamped(each, late.get(each.label, 0.0), self.record)
                        for each in measured]  # fmt: skip
            found = fine(self.record, start, self.spec, noise, measured, aids, nominal=about)
            square = mean_square(found, measured)
        return found, _Taken(tuple(measured), late if moved else {}, noise, square)


def _delays(found: FineAlignment, measured: Sequence[Measurement]) -> dict[str, float]:
    """Return the delay that was found of each aid whose delay is estimated, s."""
    return {
        aid.label: aid.delay + float(found.end.parameters[f"{aid.label}.delay"][0])
        for aid in measured if f"{aid.label}.delay" in found.end.layout
    }  # fmt: skip


def _restamped(aid: Measurement, late: float, record: ImuRecord) -> Measurement:
    """Return measurements with stamps that are earlier by a delay; what is left is estimated."""
    if not late:
        return aid
    time = np.asarray(aid.time) - late
    inside = (time >= record.start) & (time <= record.end)
    cut: dict[str, Any] = {
        name: np.asarray(getattr(aid, name))[inside] for name in ("value", "sigma")
        if np.ndim(getattr(aid, name)) and len(getattr(aid, name)) == len(time)
    }  # fmt: skip
    return replace(aid, time=time[inside], delay=0.0, **cut)


def mean_square(found: FineAlignment, measured: Sequence[Measurement]) -> float:
    """Return the mean squared normalised innovation of what was taken."""
    total, count = 0.0, 0
    for aid in measured:
        _, z, sigma, weight = found.filter.innovations(aid.label)
        good = (sigma > 0.0) & (weight > 0.0)[:, None]
        total += float(np.sum((z[good] / sigma[good]) ** 2))
        count += int(good.sum())
    return total / max(count, 1)


def _result(
    prepared: _Prepared, rough: CoarseAlignment, found: FineAlignment,
    taken: _Taken, spec: ImuSpec, warnings: list[str], at: str,
) -> MovingAlignment:  # fmt: skip
    measured, noise, square = taken.measured, taken.noise, taken.square
    record = prepared.record
    state = found.end if at == "end" else found.start
    phi = state.covariance[:3, :3]
    budget = (
        {name: part for name, part in found.budget.items() if np.any(part)}
        if at == "end" else {"all_sources": phi}
    )  # fmt: skip
    used, refused = {}, {}
    contradictions = []
    for aid in measured:
        weight = found.filter.innovations(aid.label)[3]
        used[aid.label], refused[aid.label] = int(np.sum(weight > 0)), int(np.sum(weight == 0))
        total = len(weight)
        if total and refused[aid.label] > _REFUSED * total:
            contradictions.append(
                f"{refused[aid.label]} of {total} measurements of {aid.label} were refused: the "
                "record's axes and units, or their sigma, are not what they are said to be"
            )
    if square > _WRONG:
        contradictions.append(
            f"innovations are {np.sqrt(square):.2g} times their sigma: the instrument's noise, the "
            "delay, the lever arm or the axes are not what they are said to be"
        )
    beyond, unusual = _beyond_prior(prepared, rough, found)
    contradictions += beyond
    warnings += unusual
    if found.moved > 1.0:
        contradictions.append(
            f"after {found.passes} passes the start still moves by {found.moved:.2g} sigma"
        )
    if noise > 0.0 and spec is not CONSUMER_MEMS:
        warnings.append(
            f"vibration: a velocity random walk of {noise:.2g} m/s/sqrt(s) was taken, "
            f"beside {spec.accelerometer.white:.2g} of the specification"
        )
    for each in prepared.aids:
        if isinstance(each, GnssFixes):
            contradictions += each.contradictions()
    summariser = Summariser()
    summariser.push(record)
    where = Site(state.lat / DEG, (state.lon / DEG + 180.0) % 360.0 - 180.0, state.height)
    b, a = (state.layout[f"{name}_bias"] for name in ("gyro", "accelerometer"))
    pick = [*range(b.start, b.stop), *range(a.start, a.stop)]
    fix = MovingAlignment(
        method=InMotion(rough.form, noise), site=where, start=record.start, end=record.end,
        samples=len(record), at=at, quat_nb=state.quat_nb, covariance=np.asarray(phi),
        budget=budget, bound=_bound(prepared, found, measured, at), warnings=tuple(warnings),
        spec=spec, orthonormality=None, gyro_bias=state.parameters["gyro_bias"],
        accel_bias=state.parameters["accelerometer_bias"],
        bias_covariance=state.covariance[np.ix_(pick, pick)], history=track_history(record),
        summary=summariser.summary(),
        inputs={"record": record.name}, state=state, coarse=rough, measured=measured,
        used=used, refused=refused, passes=found.passes, mean_square=square,
        restamped=taken.restamped,
        epochs=found.filter.history(),
        innovations={aid.label: found.filter.innovations(aid.label) for aid in measured},
        smoothed_heading=found.smoothed_heading,
    )  # fmt: skip
    contradicted = fix.contradicted(contradictions)
    assert isinstance(contradicted, MovingAlignment)
    return contradicted


def _beyond_prior(
    prepared: _Prepared, rough: CoarseAlignment, found: FineAlignment
) -> tuple[list[str], list[str]]:
    """Return contradictions and warnings of sensors' errors that are not what was specified.

    A wrong unit hides in a scale factor, wrong axes in a misalignment: these are large. A smaller
    one beyond the specification, as vibration makes, says little of the attitude. What bias and
    scale of an accelerometer add up to at the mean force is seen far better than either.
    """
    layout = found.start.layout
    off = difference(layout, found.start.nominal, prepared.nominal(rough))
    prior = prior_sigma(layout, prepared.spec, prepared.aids)
    name = prepared.spec.name
    contradictions, warnings = [], []
    for sensor in ("gyro", "accelerometer"):
        level = f"{sensor}_bias"
        size, sigma = off[layout[level]], prior[layout[level]]
        group = f"{sensor}_matrix"
        if group in layout:
            place = layout[group]
            matrix, spread = off[place].reshape(3, 3), prior[place].reshape(3, 3)
            if sensor == "accelerometer":
                mean = prepared.record.dvel.sum(axis=0) / prepared.record.duration
                size, sigma = size + matrix @ mean, np.hypot(sigma, np.abs(spread @ mean))
            beyond = np.abs(matrix) / np.maximum(spread, 1e-300)
            worst = float(beyond.max())
            if worst > _BEYOND:
                text = (
                    f"the {sensor}'s scale factor or misalignment is found {worst:.0f} times its "
                    f"1-sigma of '{name}'"
                )
                if np.any((beyond > _BEYOND) & (np.abs(matrix) > _GROSS)):
                    contradictions.append(f"{text}: units, axes or the specification are wrong")
                else:
                    warnings.append(f"{text} ({np.abs(matrix).max():.2g})")
        worst = float(np.max(np.abs(size) / np.maximum(sigma, 1e-300)))
        if worst > _BEYOND:
            contradictions.append(
                f"the {sensor}'s bias is found {worst:.0f} times its 1-sigma of '{name}': units, "
                "axes or the specification are wrong"
            )
    return contradictions, warnings


def _bound(
    prepared: _Prepared, found: FineAlignment, measured: Sequence[Measurement], at: str
) -> Array | None:
    """Return the bound along the path that was found, with the specification's noise."""
    flt = make_filter(
        found.start.nominal, prepared.spec, 0.0, measured, prepared.aids, smooth=at == "start"
    )
    run_pass(flt, prepared.record)
    if at == "start":
        return np.asarray(flt.smoothed().covariance[0][:3, :3])
    return np.asarray(filtered_end(flt)[0].covariance[:3, :3])


def track_history(record: ImuRecord) -> History:
    """Return the running sums of a record."""
    from schuler.kernels import tracking
    from schuler.kernels.states import TrackerState

    state = TrackerState.begin()
    nodes = np.zeros((tracking.NODE_CAPACITY, tracking.ROW))
    tracking.track(
        state.data, nodes, 1, float(not record.coning_corrected),
        float(not record.sculling_corrected), record.time, record.dt, record.dtheta, record.dvel,
    )  # fmt: skip
    return History.from_state(state.data, nodes)
