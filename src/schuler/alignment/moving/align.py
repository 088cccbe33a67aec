"""`align_moving`: a record and its aids in, an alignment with its uncertainty out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schuler._blas import with_one_blas_thread
from schuler.aiding import BodySpeed, BodyVelocity, GnssFixes, ZeroVelocity
from schuler.aiding.checks import check_speed
from schuler.alignment.history import History
from schuler.alignment.moving.beside import Beside, check_names
from schuler.alignment.moving.fine import FineAlignment, difference, filtered_end, run_pass
from schuler.alignment.moving.prepared import Prepared, Taken
from schuler.alignment.moving.result import InMotion, MovingAlignment
from schuler.alignment.moving.setup import (
    Aid,
    as_speed,
    make_filter,
    prior_sigma,
)
from schuler.alignment.moving.span import (
    bias_at_rest,
    common_span,
    cut_span,
    place_at_start,
)
from schuler.constants import DEG
from schuler.earth import Site
from schuler.errors import InputError, expect
from schuler.in_motion.coarse import CoarseAlignment
from schuler.ins import Measurement
from schuler.record import ImuRecord, Summariser
from schuler.sensors import CONSUMER_MEMS, ImuSpec, load_spec

__all__ = ["align_moving"]

Array = NDArray[np.float64]


_WRONG = 2.0
"""The same, beyond which record and aids contradict each other."""

_BEYOND = 6.0
"""Prior sigmas beyond which an estimate of the instrument contradicts its specification."""

_GROSS = 0.3
"""Scale factor or misalignment from which on it is another unit or axis."""

_REFUSED = 0.3
"""Share of refused measurements that contradicts."""


@with_one_blas_thread
def align_moving(
    record: ImuRecord,
    aiding: Aid | BodyVelocity | Sequence[Aid | BodyVelocity | Beside | ZeroVelocity],
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
    aiding : GnssFixes, BodySpeed, BodyVelocity, or a sequence of them and of others
        On the record's clock. HeadingFixes, Height and ZeroVelocity may stand beside them.
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
    beside = [each for each in told if isinstance(each, Beside)]
    given = [each for each in told if not isinstance(each, ZeroVelocity | Beside)]
    if not given:
        raise InputError("an alignment in motion needs aids: give GnssFixes or a BodySpeed")
    for each in given:
        if not isinstance(each, Aid | BodyVelocity):
            raise InputError(
                "aiding takes GnssFixes, BodySpeed, BodyVelocity, HeadingFixes, Height and "
                "ZeroVelocity, got "
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
    check_names([*aids, *beside])
    prepared = Prepared(
        part, leader, [*aids, *beside], used_spec, bias, place_at_start(leader, part, site), rests
    )
    first, rough = prepared.coarse()
    found, taken = prepared.fine(rough, first, vibration)
    return _result(prepared, rough, found, taken, instrument, warnings, at)


def _result(
    prepared: Prepared, rough: CoarseAlignment, found: FineAlignment,
    taken: Taken, spec: ImuSpec, warnings: list[str], at: str,
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
        bias_covariance=state.covariance[np.ix_(pick, pick)], history=History.of_record(record),
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
    prepared: Prepared, rough: CoarseAlignment, found: FineAlignment
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
    prepared: Prepared, found: FineAlignment, measured: Sequence[Measurement], at: str
) -> Array | None:
    """Return the bound along the path that was found, with the specification's noise."""
    flt = make_filter(
        found.start.nominal, prepared.spec, 0.0, measured, prepared.aids, smooth=at == "start"
    )
    run_pass(flt, prepared.record)
    if at == "start":
        return np.asarray(flt.smoothed().covariance[0][:3, :3])
    return np.asarray(filtered_end(flt)[0].covariance[:3, :3])
