"""`transfer`: a slave's record and its master in, the slave's alignment out.

Sources: Kain and Cloutier (1989) for velocity and attitude matching; Groves (2013), chapter 15.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler._blas import with_one_blas_thread
from schuler.aiding import no_overlap
from schuler.alignment.history import History
from schuler.alignment.moving.fine import FineState
from schuler.alignment.moving.span import cut_span
from schuler.alignment.transfer.coarse import coarse_mounting
from schuler.alignment.transfer.free import free_run
from schuler.alignment.transfer.master import MasterNoise, state_at
from schuler.alignment.transfer.passes import Found, budget_and_bound, passes
from schuler.alignment.transfer.result import ByMaster, TransferAlignment, state_names
from schuler.alignment.transfer.setup import (
    DELAY_SIGMA,
    LEAST_ROWS,
    LEVER_SIGMA,
    MOUNTING_SIGMA,
    Flexure,
    Known,
    Matching,
    parse_match,
)
from schuler.attitude import multiply, quat_to_matrix, quat_to_rotvec, rotvec_to_quat
from schuler.constants import DEG, STAMP_ROUNDING
from schuler.earth import Site
from schuler.errors import InputError, expect
from schuler.ins import Layout
from schuler.record import ImuRecord, Summariser
from schuler.sensors import CONSUMER_MEMS, ImuSpec, load_spec
from schuler.trajectory import Trajectory
from schuler.units import time_text

__all__ = ["transfer"]

Array = NDArray[np.float64]

_WRONG = 3.0
"""Mean squared normalised innovation beyond which something is not as it was said to be."""

_REFUSED = 0.3
"""Share of refused rows that contradicts."""

_TURNED = 10.0 * DEG
"""A mounting that differs from what was known by so much is started from what both units feel."""

_SEEN, _SEEN_OF_NOTHING = 0.5, 0.1
"""Parts of the prior's sigma, and of that of a state of which nothing is known, that may stay."""

_NOTHING_KNOWN = {
    "phi": MOUNTING_SIGMA, "transfer.mounting": MOUNTING_SIGMA, "transfer.lever": LEVER_SIGMA,
    "transfer.delay": DELAY_SIGMA,
}  # fmt: skip

_LATEST = 0.5
"""A delay that is found is left so much of the record after the free navigation, s."""

_IDENTITY = (1.0, 0.0, 0.0, 0.0)
_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


@with_one_blas_thread
def transfer(
    record: ImuRecord,
    master: Trajectory,
    *,
    match: str = "velocity+attitude",
    span: tuple[float | None, float | None] | None = None,
    spec: ImuSpec | str | Path | None = None,
    mounting: ArrayLike | None = None,
    mounting_sigma: float | None = None,
    lever: ArrayLike | None = None,
    delay: float | None = None,
    noise: MasterNoise | None = None,
    flexure: Flexure | None = None,
    rate: float = 10.0,
    vibration: float | None = None,
    at: str = "end",
    then_free: float | None = None,
) -> TransferAlignment:
    """Align a slave unit by a master on the same vehicle.

    Parameters
    ----------
    record : ImuRecord
        Of the slave.
    master : Trajectory
        On the record's clock, with velocity and attitude.
    match : str
        Of velocity, attitude, position and rate, with + between.
    span : (float or None, float or None), optional
        Begin and end, s in the record's time; all that both have when not given, less what
        `then_free` takes.
    spec : ImuSpec, str or path, optional
        Of the slave; a MEMS of consumer grade when not given.
    mounting : (4,) array_like, optional
        Quaternion from the slave's body to the master's; found, from any, when not given.
    mounting_sigma : float, optional
        1-sigma about each axis of a mounting that is given, rad: it is then estimated.
    lever : (3,) array_like, optional
        From the slave to the master, the slave's axes, m; found when not given.
    delay : float, optional
        A row of the master stamped t is valid at t - delay, s; found when not given.
    noise : MasterNoise, optional
        Of the master's rows; when not given, that of a good one, or what the innovations show.
    flexure : Flexure, optional
        Of the structure between both.
    rate : float
        Rows of the master that are used, at most, Hz.
    vibration : float, optional
        Velocity random walk beside the specification's, m/s/sqrt(s); when not given, the least one
        with which the innovations agree with their sigma.
    at : {"end", "start"}
        The instant of the attitude.
    then_free : float, optional
        Navigate on alone for so many seconds, and compare with the master.

    Raises
    ------
    InputError
        If record and master have no common span, or the master lacks what is matched.

    Examples
    --------
    >>> fix = sc.transfer(drive, driven, spec=spec, span=(0.0, 40.0))
    >>> bool(np.abs(fix.mounting_deg).max() < 0.1)
    True
    """
    expect(record, ImuRecord, "record", "read a file with schuler.read")
    expect(master, Trajectory, "master", "read a file with schuler.read_trajectory")
    if at not in ("start", "end"):
        raise InputError(f"at must be start or end, got '{at}'")
    if vibration is not None and not (np.isfinite(vibration) and vibration >= 0.0):
        raise InputError(f"vibration must be 0 or more, got {vibration}")
    if not (np.isfinite(rate) and rate > 0.0):
        raise InputError(f"rate must be a positive number of rows a second, got {rate}")
    parts = parse_match(match)
    for name in ("v_n", "quat_nb"):
        master.known(name)
    instrument = load_spec(spec)
    warnings = []
    if instrument is None:
        instrument = CONSUMER_MEMS
        warnings.append(
            f"no instrument specification was given: taken for {instrument.name} (say --spec)"
        )
    known = _known(mounting, mounting_sigma, lever, delay)
    if then_free is not None and (span is None or span[1] is None):
        # What it is let go for comes after the alignment, a delay that is found included.
        late = _LATEST if delay is None else known.delay
        last = min(record.end, float(master.time[-1]) - late)
        begin = max(record.start, float(master.time[0]) - known.delay)
        begin = begin if span is None or span[0] is None else max(begin, span[0])
        if not last - then_free > begin:
            raise InputError(
                f"to navigate free for {then_free:g} s after the alignment record and master must "
                f"go on to t = {time_text(begin + then_free)} s and longer; both have data to "
                f"t = {time_text(last)} s"
            )
        span = (None if span is None else span[0], last - then_free)
    part = _common(cut_span(record, span), master, known.delay)
    if mounting is None:
        felt = coarse_mounting(part, master, known.delay, known.mounting)
        turned = float(np.linalg.norm(quat_to_rotvec(felt)))
        if turned > _TURNED:
            warnings.append(
                f"the slave is turned by about {turned / DEG:.0f} deg against the master, as the "
                "forces and rates of both show"
            )
            known = replace(known, mounting=felt)
    matching = Matching(
        part, master, parts, known, instrument, noise or MasterNoise(), flexure, rate
    )
    learnt, found = passes(matching, vibration, learn=noise is None)
    if learnt.noise is not matching.noise:
        taken = learnt.noise
        warnings.append(
            f"the master's noise was taken for {1e3 * taken.attitude:.2g} mrad, "
            f"{taken.velocity:.2g} m/s and {taken.position:.2g} m, as its innovations show "
            "(say --master-sigma)"
        )
    fix = _result(learnt, found, warnings, at)
    if then_free is not None:
        fix = replace(fix, free=free_run(fix, record, master, then_free))
    return fix


def _known(
    mounting: ArrayLike | None, mounting_sigma: float | None, lever: ArrayLike | None,
    delay: float | None,
) -> Known:  # fmt: skip
    """Return what is known, with the sigma of what is not."""
    quat = np.asarray(_IDENTITY if mounting is None else mounting, np.float64)
    if quat.shape != (4,) or not abs(float(np.linalg.norm(quat)) - 1.0) < 1e-6:
        raise InputError("mounting must be a unit quaternion (w, x, y, z)")
    if mounting_sigma is not None and not 0.0 <= mounting_sigma < np.pi:
        raise InputError(f"mounting_sigma must be an angle from 0, rad, got {mounting_sigma}")
    if mounting_sigma is None:
        mounting_sigma = MOUNTING_SIGMA if mounting is None else 0.0
    arm = np.asarray((0.0, 0.0, 0.0) if lever is None else lever, np.float64)
    if arm.shape != (3,) or not np.all(np.isfinite(arm)):
        raise InputError("lever must be three finite numbers, m")
    late = 0.0 if delay is None else float(delay)
    if not abs(late) < 10.0:
        raise InputError(f"delay must be within 10 s, got {delay} s")
    return Known(
        quat, mounting_sigma, arm, LEVER_SIGMA if lever is None else 0.0, late,
        DELAY_SIGMA if delay is None else 0.0,
    )  # fmt: skip


def _common(record: ImuRecord, master: Trajectory, delay: float) -> ImuRecord:
    """Return the samples for which there is a master."""
    due = master.time - delay
    inside = (due >= record.start - STAMP_ROUNDING) & (due <= record.end + STAMP_ROUNDING)
    if not np.any(inside):
        raise no_overlap(
            master.name, "unstated", (float(due[0]), float(due[-1])), (record.start, record.end)
        )
    if inside.sum() < LEAST_ROWS:
        raise InputError(
            f"{master.name}: {int(inside.sum())} rows of the master lie between t = "
            f"{time_text(record.start)} and {time_text(record.end)} s, and a transfer alignment "
            "needs "
            f"{LEAST_ROWS}: take a longer span"
        )
    first = int(np.searchsorted(record.time, float(due[inside][0]) + STAMP_ROUNDING))
    last = int(np.searchsorted(record.time, float(due[-1]) - STAMP_ROUNDING)) + 1
    cut = record.rows(min(first, len(record) - 2), min(last, len(record)))
    widest = float(np.max(np.diff(due[inside]), initial=0.0))
    if widest > 5.0:
        k = int(np.argmax(np.diff(due[inside])))
        raise InputError(
            f"{master.name}: the master has no row for {widest:.3g} s after t = "
            f"{time_text(due[inside][k])} s: take a span without that (--from, --to)"
        )
    return cut


def _result(
    matching: Matching, found: Found, warnings: list[str], at: str
) -> TransferAlignment:  # fmt: skip
    known, fine, record, layout = matching.known, found.fine, matching.record, found.layout
    state = fine.end if at == "end" else fine.start
    phi = np.asarray(state.covariance[:3, :3])
    budget, bound = budget_and_bound(matching, found, at)
    if at == "start":
        budget = {"all_sources": phi}
    used, refused, contradictions = {}, {}, []
    for aid in found.measured:
        weight = fine.filter.innovations(aid.label)[3]
        used[aid.label], refused[aid.label] = int(np.sum(weight > 0)), int(np.sum(weight == 0))
        if len(weight) and refused[aid.label] > _REFUSED * len(weight):
            contradictions.append(
                f"{refused[aid.label]} of {len(weight)} rows of {aid.label.replace('_', ' ')} were "
                "refused: axes, units, clock or sigma are not what they are said to be"
            )
    if found.square > _WRONG:
        contradictions.append(
            f"innovations are {np.sqrt(found.square):.2g} times their sigma: the master's noise, "
            "flexure, or the slave's noise are not what they are said to be"
        )
    if fine.moved > 1.0:
        contradictions.append(
            f"after {fine.passes} passes the start still moves by {fine.moved:.2g} sigma"
        )
    if found.vibration > 0.0:
        warnings.append(f"vibration: a velocity random walk of {found.vibration:.2g} m/s/sqrt(s) "
                        "was taken")  # fmt: skip
    remaining, unseen = _remaining(layout, found.prior, state)
    turn = [name for name in unseen if name in ("heading", "mounting about up")]
    if turn:
        warnings.append(
            f"{' and '.join(turn)} {'were' if len(turn) > 1 else 'was'} not seen in this span: "
            "rock the wings, turn or brake"
        )
    pick = [
        *range(layout["gyro_bias"].start, layout["gyro_bias"].stop),
        *range(layout["accelerometer_bias"].start, layout["accelerometer_bias"].stop),
    ]
    sigma = np.sqrt(np.maximum(np.diag(state.covariance), 0.0))
    lever, lever_sigma = known.lever, np.zeros(3)
    if "transfer.lever" in layout:
        lever = known.lever + state.parameters["transfer.lever"]
        lever_sigma = sigma[layout["transfer.lever"]]
    late = known.delay_sigma
    if "transfer.delay" in layout:
        late = float(sigma[layout["transfer.delay"]][0])
    elif late:
        remaining["delay"], unseen = 1.0, (*unseen, "delay")
    delay = (found.delay + float(state.parameters.get("transfer.delay", np.zeros(1))[0]), late)
    mounting, spread = _mounting(matching, state, layout, delay[0])
    summariser = Summariser()
    summariser.push(record)
    where = Site(state.lat / DEG, (state.lon / DEG + 180.0) % 360.0 - 180.0, state.height)
    fix = TransferAlignment(
        method=ByMaster("+".join(matching.parts), found.vibration), site=where,
        start=record.start, end=record.end, samples=len(record), at=at, quat_nb=state.quat_nb,
        covariance=phi, budget=budget, bound=bound, warnings=tuple(warnings), spec=matching.spec,
        orthonormality=None, gyro_bias=state.parameters["gyro_bias"],
        accel_bias=state.parameters["accelerometer_bias"],
        bias_covariance=state.covariance[np.ix_(pick, pick)], history=History.of_record(record),
        summary=summariser.summary(),
        inputs={"record": record.name, "master": matching.master.name},
        state=state, coarse=None, measured=found.measured, used=used, refused=refused,
        passes=fine.passes, mean_square=found.square, restamped={},
        epochs=fine.filter.history(),
        innovations={aid.label: fine.filter.innovations(aid.label) for aid in found.measured},
        smoothed_heading=fine.smoothed_heading,
        mounting=mounting, mounting_covariance=spread, lever=np.asarray(lever, np.float64),
        lever_sigma=np.asarray(lever_sigma), delay=delay, remaining=remaining,
        not_observable=unseen,
    )  # fmt: skip
    contradicted = fix.contradicted(contradictions)
    assert isinstance(contradicted, TransferAlignment)
    return contradicted


def _remaining(
    layout: Layout, prior: Array, state: FineState
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return what is left of the 1-sigma of each state by name, and which were not seen."""
    before = np.sqrt(np.diag(prior))
    now = np.sqrt(np.maximum(np.diag(state.covariance), 0.0))
    left: dict[str, float] = {}
    unseen = []
    for group in layout:
        place = layout[group]
        names = state_names(group, place.stop - place.start)
        for name, p0, p in zip(names, before[place], now[place], strict=False):
            left[name] = float(p / p0)
            if left[name] > _SEEN or p > _SEEN_OF_NOTHING * _NOTHING_KNOWN.get(group, np.inf):
                unseen.append(name)
    return left, tuple(unseen)


def right_jacobian(turn: Array) -> Array:
    """Return J (3, 3), where exp(turn + d) = exp(turn) exp(J d) for small d."""
    from schuler.kernels.measurement_rows import right_jacobian_row

    x, y, z = (float(v) for v in turn)
    return np.array([right_jacobian_row(row, (x, y, z)) for row in ((1.0, 0.0, 0.0),
                                                                    (0.0, 1.0, 0.0),
                                                                    (0.0, 0.0, 1.0))])  # fmt: skip


def _mounting(
    matching: Matching, state: FineState, layout: Layout, delay: float
) -> tuple[Array, Array]:
    """Return the mounting and its covariance: a state, or else attitude beside attitude."""
    known = matching.known
    if "transfer.mounting" in layout:
        turn = state.parameters["transfer.mounting"]
        place = layout["transfer.mounting"]
        found = np.asarray(multiply(known.mounting, rotvec_to_quat(turn)))
        # The state is a rotation vector; the error is one of what it turns.
        to_error = right_jacobian(turn)
        return found, to_error @ state.covariance[place, place] @ to_error.T
    if known.mounting_sigma == 0.0:
        return known.mounting, np.zeros((3, 3))
    beside = state_at(matching.master, np.array([state.time + delay])).quat_nb[0]
    found = np.asarray(multiply(beside * _CONJUGATE, state.quat_nb))
    mat = quat_to_matrix(state.quat_nb)
    own = state.covariance[:3, :3] + matching.noise.attitude**2 * np.eye(3)
    return found, np.asarray(mat.T @ own @ mat)
