"""`navigate`: a record into a path, alone or with whatever else was measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from schuler.aiding import BodySpeed, GnssFixes
from schuler.earth import Site
from schuler.errors import InputError, expect
from schuler.ins import CustomMeasurement
from schuler.navigation.aid_measurements import AIDS, Aid
from schuler.navigation.aided import navigate_aided
from schuler.navigation.aided_result import AidedNavigation
from schuler.navigation.aiding_options import AidingOptions
from schuler.navigation.navigator import Navigator
from schuler.navigation.options import Gravity, Vertical
from schuler.navigation.outages import Outages
from schuler.navigation.start import Fix, MovingFix, Start
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec, SensorArray, load_spec
from schuler.trajectory import Trajectory

__all__ = ["navigate"]

Aiding = GnssFixes | BodySpeed | Aid | CustomMeasurement


@overload
def navigate(
    record: ImuRecord,
    start: Start | Site | MovingFix,
    fix: Fix | None = None,
    *,
    velocity: ArrayLike = (0.0, 0.0, 0.0),
    gravity: Gravity | str | None = None,
    vertical: Vertical | str | None = None,
    every: int = 1,
    spec: ImuSpec | str | None = None,
    subsamples: int | None = None,
    array: SensorArray | str | None = None,
) -> Trajectory: ...


@overload
def navigate(
    record: ImuRecord,
    start: Start | Site | MovingFix | None = None,
    fix: Fix | None = None,
    *,
    aiding: Aiding | Sequence[Aiding],
    spec: ImuSpec | str | None = None,
    smooth: bool = False,
    options: AidingOptions | None = None,
    outages: Outages | None = None,
) -> AidedNavigation: ...


def navigate(
    record: ImuRecord,
    start: Start | Site | MovingFix | None = None,
    fix: Fix | None = None,
    *,
    velocity: ArrayLike = (0.0, 0.0, 0.0),
    aiding: Aiding | Sequence[Aiding] | None = None,
    spec: ImuSpec | str | None = None,
    smooth: bool = False,
    options: AidingOptions | None = None,
    outages: Outages | None = None,
    gravity: Gravity | str | None = None,
    vertical: Vertical | str | None = None,
    every: int = 1,
    subsamples: int | None = None,
    array: SensorArray | str | None = None,
) -> Trajectory | AidedNavigation:
    """Navigate a record: free-inertial, or with aids.

    Parameters
    ----------
    record : ImuRecord
    start : Start, Site or MovingAlignment, optional
        Where it begins, at the record's start; a site goes with an alignment. With aids it may be
        left out: the start is then found from rest and the first motion.
    fix : Alignment, optional
        The attitude at the record's start, and its covariance.
    velocity : (3,) array_like
        East, north, up at the start, m/s, with a site.
    aiding : GnssFixes, BodySpeed, BodyVelocity, Height, HeadingFixes, ZeroRate or a sequence of \
them
        GNSS fixes are among them. The result is that of `navigate_aided`.
    spec : ImuSpec, str or path, optional
        The instrument.
    smooth : bool
        With aids: smooth afterwards.
    options : AidingOptions, optional
        With aids.
    outages : Outages, optional
        With aids: spans whose fixes are withheld, and scored.
    gravity, vertical, every, subsamples, array
        Without aids: as in `Navigator`.

    Returns
    -------
    Trajectory, or AidedNavigation with aids

    Raises
    ------
    InputError
        See `Navigator` and `navigate_aided`.

    Examples
    --------
    >>> path = sc.navigate(record, sc.Start.from_angles(site, heading=30.0))
    >>> path.quat_nb.shape
    (1201, 4)
    >>> sc.navigate(drive, aiding=gnss, spec=spec, smooth=True).consistent
    True
    """
    expect(record, ImuRecord, "record", "read a file with schuler.read")
    begin = None if start is None and aiding is not None else _start(start, fix, velocity)
    if aiding is None:
        given = {"smooth": smooth or None, "options": options, "outages": outages}
        for name, value in given.items():
            if value is not None:
                raise InputError(f"{name} goes with aids: give aiding, too")
        assert begin is not None
        navigator = Navigator(
            begin, gravity=gravity, vertical=vertical, every=every, spec=spec,
            subsamples=subsamples, array=array,
        )  # fmt: skip
        return navigator.update(record).path()
    alone: dict[str, object] = {
        "gravity": gravity, "vertical": vertical, "subsamples": subsamples, "array": array,
        "every": None if every == 1 else every,
    }  # fmt: skip
    for name, unused in alone.items():
        if unused is not None:
            raise InputError(f"{name} is for a navigation without aids: leave it out")
    told = list(aiding) if isinstance(aiding, Sequence) else [aiding]
    gnss = [each for each in told if isinstance(each, GnssFixes)]
    if len(gnss) != 1:
        raise InputError(
            f"an aided navigation takes GNSS fixes of one receiver, got {len(gnss)}: give one "
            "GnssFixes (schuler.read_gnss reads a file)"
        )
    speeds = [each for each in told if isinstance(each, BodySpeed)]
    others = [each for each in told if not isinstance(each, GnssFixes | BodySpeed)]
    for each in others:
        if not isinstance(each, (*AIDS, CustomMeasurement)):
            raise InputError(
                "aiding takes GnssFixes, BodySpeed, BodyVelocity, Height, HeadingFixes, ZeroRate "
                f"and measurements of your own, got {type(each).__name__}"
            )
    chosen = options or AidingOptions()
    return navigate_aided(
        record, gnss[0], start=begin, spec=load_spec(spec), speeds=speeds, aids=others,
        options=replace(chosen, smooth=chosen.smooth or smooth), outages=outages,
    )  # fmt: skip


def _start(start: object, fix: Fix | None, velocity: ArrayLike) -> Start:
    """Return where a navigation begins."""
    if isinstance(start, MovingFix) and not isinstance(start, Start):
        return Start.from_alignment(start)
    expect(start, (Start, Site), "start")
    if isinstance(start, Site):
        if fix is None:
            raise InputError("a site alone has no attitude: give an alignment, or a Start")
        return Start.from_alignment(start, fix, velocity)
    assert isinstance(start, Start)
    if fix is None:
        return start
    known = start.covariance
    covariance = np.zeros((9, 9)) if known is None else np.array(known, np.float64)
    if covariance.shape == (9, 9):
        covariance[:3], covariance[:, :3] = 0.0, 0.0
        covariance[:3, :3] = fix.covariance
    return replace(start, quat_nb=fix.quat_nb, covariance=covariance)
