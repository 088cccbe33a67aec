"""`align_moving`: a record and its aids in, an alignment with its uncertainty out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from schuler._blas import with_one_blas_thread
from schuler.aiding import BodySpeed, BodyVelocity, GnssFixes, ZeroVelocity
from schuler.aiding.checks import check_speed
from schuler.alignment.moving.beside import Beside, check_names
from schuler.alignment.moving.outcome import compose
from schuler.alignment.moving.prepared import Prepared
from schuler.alignment.moving.result import MovingAlignment
from schuler.alignment.moving.setup import Aid, as_speed
from schuler.alignment.moving.span import (
    bias_at_rest,
    common_span,
    cut_span,
    place_at_start,
)
from schuler.earth import Site
from schuler.errors import InputError, expect
from schuler.record import ImuRecord
from schuler.sensors import CONSUMER_MEMS, ImuSpec, load_spec

__all__ = ["align_moving", "instrument_of", "prepare"]


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
    instrument, warnings = instrument_of(spec)
    prepared = prepare(record, aids, instrument, site, span=span, beside=beside, rests=rests)
    first, rough = prepared.coarse()
    found, taken = prepared.fine(rough, first, vibration)
    return compose(prepared, rough, found, taken, instrument, warnings, at)


def instrument_of(spec: ImuSpec | str | Path | None) -> tuple[ImuSpec, list[str]]:
    """Return the instrument of an alignment in motion, and a warning where none was given."""
    instrument = load_spec(spec)
    if instrument is not None:
        return instrument, []
    return CONSUMER_MEMS, [
        f"no instrument specification was given: taken for {CONSUMER_MEMS.name} (say --spec)"
    ]


def prepare(
    record: ImuRecord, aids: Sequence[Aid], spec: ImuSpec, site: Site | None, *,
    span: tuple[float | None, float | None] | None = None, beside: Sequence[Beside] = (),
    rests: tuple[ZeroVelocity, ...] = (),
) -> Prepared:  # fmt: skip
    """Return a span with its aids, and what lies before it of the gyro bias.

    Raises
    ------
    InputError
        If record and aids have no common span, or contradict each other.
    """
    whole = cut_span(record, span)
    leader = next((aid for aid in aids if isinstance(aid, GnssFixes)), aids[0])
    part = common_span(whole, leader)
    for aid in aids:
        if isinstance(aid, BodySpeed) and isinstance(leader, GnssFixes):
            check_speed(aid, leader)
    bias, used_spec = bias_at_rest(record, part, leader, spec)
    check_names([*aids, *beside])
    return Prepared(
        part, leader, [*aids, *beside], used_spec, bias, place_at_start(leader, part, site), rests
    )
