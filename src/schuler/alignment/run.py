"""`align`: a record in, an alignment out, at rest or in motion."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from schuler._blas import with_one_blas_thread
from schuler.alignment.aligner import HOW_RECORD, Aligner
from schuler.alignment.method import Method
from schuler.alignment.result import Alignment
from schuler.earth import Site
from schuler.errors import InputError, expect
from schuler.record import ImuRecord, without_spikes
from schuler.record.spikes import spikes_warning
from schuler.sensors import ImuSpec, SensorArray, load_array

if TYPE_CHECKING:
    from schuler.aiding import BodySpeed, BodyVelocity, GnssFixes, ZeroVelocity

    Aid = BodySpeed | BodyVelocity | GnssFixes

__all__ = ["align"]

Span = tuple[float | None, float | None]


@with_one_blas_thread
def align(
    record: ImuRecord,
    site: Site | None = None,
    method: Method | str | None = None,
    spec: ImuSpec | str | Path | None = None,
    *,
    at: str = "end",
    array: SensorArray | str | None = None,
    aiding: Aid | Sequence[Aid | ZeroVelocity] | None = None,
    span: Span | None = None,
    vibration: float | None = None,
) -> Alignment:
    """Align a record: attitude and heading with a consistent uncertainty.

    Parameters
    ----------
    record : ImuRecord
        A stationary, possibly disturbed vehicle, or with `aiding` one that moves.
    site : Site, optional
        Latitude and height; with GNSS fixes it is the first of them.
    method : Method or str, optional
        `Auto()` by default; at rest only.
    spec : ImuSpec, str or path, optional
        The instrument, for the parts of the uncertainty that the record cannot show.
    at : {"end", "start"}
        The instant of the attitude.
    array : SensorArray or str, optional
        Geometry of redundant gyros.
    aiding : GnssFixes, BodySpeed, BodyVelocity, or a sequence of them and of others, optional
        What else was measured on a vehicle that moves, on the record's clock. HeadingFixes, Height
        and ZeroVelocity may stand beside them.
    span : (float or None, float or None), optional
        Begin and end, s in the record's time; the whole record when not given.
    vibration : float, optional
        In motion: velocity random walk on the vehicle, m/s/sqrt(s); the least one that agrees with
        the measurements when not given.

    Returns
    -------
    Alignment
        In motion a `MovingAlignment`, which has velocity and position, too.

    Raises
    ------
    InputError
        See `Aligner`; in motion if the span shows no heading, with what is missing.

    Examples
    --------
    >>> fix = sc.align(record, site, spec="navigation-fog")
    >>> fix.consistent
    True
    >>> sc.align(drive, aiding=gnss, span=(10.0, 50.0), spec=spec).consistent
    True
    """
    expect(record, ImuRecord, "record", HOW_RECORD)
    if array is not None and aiding is not None:
        record, array = load_array(array).fuse(record), None
    said: list[str] = []
    if record.quality is None and record.dtheta.shape[1] == record.dvel.shape[1] == 3:
        # A record that was read has been looked through already.
        record, spikes = without_spikes(record)
        said = [spikes_warning(spikes)] if spikes else []
    if aiding is not None:
        from schuler.alignment.moving.align import align_moving

        if method is not None:
            raise InputError(
                "an alignment in motion has a method of its own: leave out the method beside aiding"
            )
        moving = align_moving(record, aiding, site, spec, span=span, at=at, vibration=vibration)
        return moving.noting(said, {})
    if site is None:
        raise InputError("an alignment at rest needs the latitude: give schuler.Site(lat, height=)")
    if vibration is not None:
        raise InputError("vibration is for an alignment in motion: give aiding, too")
    if span is not None:
        record = record.between(*span)
    return (
        Aligner(site, method, spec, at=at, array=array).update(record).solution().noting(said, {})
    )
