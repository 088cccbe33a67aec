"""Windows of a drive, each aligned by itself, beside the smoothed heading of the whole.

A heading that moves has no mean to scatter about: what a window is off is its difference to the
smoother's heading of the whole span at the window's instant, over the sigma of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._blas import with_one_blas_thread
from schuler.aiding import BodyVelocity, ZeroVelocity
from schuler.alignment.moving.align import align_moving
from schuler.alignment.moving.result import MovingAlignment
from schuler.alignment.moving.setup import Aid
from schuler.alignment.windows import Windows
from schuler.constants import ARCMIN, DEG
from schuler.earth import Site
from schuler.errors import InputError
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec
from schuler.units import time_text

__all__ = ["MovingWindows", "align_moving_windows"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MovingWindows(Windows):
    """The alignment of a whole drive, and of each window in it.

    Parameters
    ----------
    off : (n,) float64
        Heading of each window less the smoothed one of the whole at the same instant, clockwise,
        rad.
    off_sigma : (n,) float64
        Its 1-sigma; that of the window alone where the whole knows no better.
    refused : tuple of (float, float, str)
        Begin and end of the windows that show no heading, s, and why.
    """

    off: Array = field(kw_only=True)
    off_sigma: Array = field(kw_only=True)
    refused: tuple[tuple[float, float, str], ...] = field(kw_only=True)

    def to_dict(self) -> dict[str, Any]:
        """Return the whole span's result with the windows' keys added."""
        out = super().to_dict()
        for row, off, sigma in zip(out["windows"], self.off, self.off_sigma, strict=True):
            row["difference_arcmin"], row["difference_sigma_arcmin"] = off / ARCMIN, sigma / ARCMIN
        out["windows_refused"] = [
            {"start_s": begin, "end_s": end, "reason": why} for begin, end, why in self.refused
        ]
        return out

    def __str__(self) -> str:
        said = f"{len(self.each)} windows of {self.length:g} s"
        if self.refused:
            said += f", {len(self.refused)} more without a heading"
        if not len(self.off):
            return said
        size = np.abs(self.off)
        inside = np.mean(size < 3.0 * self.off_sigma)
        return (
            f"{said}: median difference to the smoothed heading of the whole "
            f"{np.median(size) / DEG:.2f} deg, {100.0 * inside:.0f} % within 3 sigma"
        )


@with_one_blas_thread
def align_moving_windows(
    record: ImuRecord,
    aiding: Aid | BodyVelocity | Sequence[Aid | BodyVelocity | ZeroVelocity],
    length: float,
    site: Site | None = None,
    spec: ImuSpec | str | Path | None = None,
    *,
    span: tuple[float | None, float | None] | None = None,
    at: str = "end",
    vibration: float | None = None,
) -> MovingWindows:
    """Align each window of a drive that shares no sample with another, and the whole.

    Parameters
    ----------
    record, aiding, site, spec, span, at, vibration
        As in `align_moving`.
    length : float
        Length of a window, s; a last one that is not full is left out.

    Raises
    ------
    InputError
        If no window is full, the whole shows no heading, or none of the windows does.

    Examples
    --------
    >>> from schuler.alignment import align_moving_windows
    >>> len(align_moving_windows(drive, gnss, 20.0, spec=spec).each)
    2
    """
    if isinstance(length, bool) or not isinstance(length, Real) or not 0.0 < length < np.inf:
        raise InputError(f"the length of a window must be a positive number of s, got {length!r}")
    whole = align_moving(record, aiding, site, spec, span=span, at=at, vibration=vibration)
    begin, end = whole.start, whole.end
    if begin + length > end + 1e-9:
        raise InputError(
            f"no window of {length:g} s is full: the span goes from {time_text(begin)} to "
            f"{time_text(end)} s"
        )
    each: list[MovingAlignment] = []
    refused: list[tuple[float, float, str]] = []
    for k in range(int((end - begin + 1e-9) // length)):
        a, b = begin + k * length, begin + (k + 1) * length
        here = None if site is None else _place(whole, a, site)
        try:
            each.append(
                align_moving(record, aiding, here, spec, span=(a, b), at=at, vibration=vibration)
            )
        except InputError as error:
            refused.append((a, b, str(error)))
    if not each:
        raise InputError(f"none of the windows of {length:g} s has a heading: {refused[0][2]}")
    time, heading, sigma = whole.smoothed_heading
    off, off_sigma = [], []
    for window in each:
        true, known = _between(time, heading, sigma, window.time)
        off.append((window.heading_deg * DEG - true + np.pi) % (2.0 * np.pi) - np.pi)
        own = float(window.sigma_arcmin[2]) * ARCMIN
        off_sigma.append(float(np.hypot(own, known)))
    return MovingWindows(
        whole, float(length), tuple(each), off=np.array(off), off_sigma=np.array(off_sigma),
        refused=tuple(refused),
    )  # fmt: skip


def _place(whole: MovingAlignment, time: float, site: Site) -> Site:
    """Return where the vehicle was at an instant, by the whole's filter."""
    epochs = whole.epochs
    if not len(epochs):
        return site
    k = int(np.clip(np.searchsorted(epochs.time, time), 0, len(epochs) - 1))
    lat, lon, height = epochs.place
    return Site(float(lat[k]) / DEG, float(lon[k]) / DEG, float(height[k]))


def _between(time: Array, heading: Array, sigma: Array, at: float) -> tuple[float, float]:
    """Return heading and sigma at an instant, by a line between two epochs."""
    x, y = np.interp(at, time, np.cos(heading)), np.interp(at, time, np.sin(heading))
    return float(np.arctan2(y, x)), float(np.interp(at, time, sigma))
