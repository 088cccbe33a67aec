"""Scores of outages: the path against the fixes that were withheld, forward and smoothed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import GnssFixes
from schuler.attitude import quat_to_matrix
from schuler.earth import radii
from schuler.ins import ErrorStateFilter
from schuler.navigation.outages import Outages, OutageScore
from schuler.record import ImuRecord
from schuler.trajectory import Trajectory

if TYPE_CHECKING:
    from schuler.ins import Smoothed

__all__ = ["outage_scores"]

Array = NDArray[np.float64]


def outage_scores(
    outages: Outages, withheld: GnssFixes, taken: tuple[Array, Array, Array, Array],
    flt: ErrorStateFilter, smoothed: Smoothed | None, forward_path: Trajectory,
    path: Trajectory, record: ImuRecord, delay: float,
) -> dict[str, Any]:  # fmt: skip
    """Return the document's table of outages.

    Parameters
    ----------
    outages : Outages
    withheld : GnssFixes
    taken : tuple of array
        Times, innovations, their sigma and weights of the withheld fixes.
    flt : ErrorStateFilter
    smoothed : Smoothed or None
    forward_path, path : Trajectory
        Of the filter, and of the smoother where there is one.
    record : ImuRecord
    delay : float
        That was taken off the times of the fixes, s.
    """
    stamp = taken[0] + delay
    k = np.searchsorted(path.time, taken[0] - 1e-9)
    k = np.minimum(k, len(path) - 1)
    index = np.searchsorted(np.asarray(withheld.time), stamp - 1e-6)
    noise = np.asarray(withheld.sigma)[index] ** 2
    spans = outages.spans(record.start, float(np.asarray(withheld.time)[-1]) + 1e-6)
    variance = forward_path.known("variances")[k, 6:9] + noise
    forward = OutageScore.of(stamp, taken[1], variance, spans)
    out: dict[str, Any] = {
        "length_s": outages.length, "count": len(forward.horizontal), "forward": forward.to_dict(),
        "smoothed": None,
    }  # fmt: skip
    if smoothed is None:
        return out
    lat, lon, height = (np.asarray(x)[index] for x in (withheld.lat, withheld.lon, withheld.height))
    meridian, transverse = radii(lat)
    lever = np.asarray(withheld.lever, np.float64)
    name = f"{withheld.name}.lever"
    lever_now = np.broadcast_to(lever, (len(k), 3))
    if name in flt.layout:
        lever_now = _smoothed_values(flt, smoothed, name, lever)[k]
    name = f"{withheld.name}.delay"
    delay_now = np.zeros(len(k))
    if name in flt.layout:
        delay_now = _smoothed_values(flt, smoothed, name, np.zeros(1))[k, 0]
    assert path.v_n is not None
    assert path.quat_nb is not None
    antenna = np.einsum("iab,ib->ia", quat_to_matrix(path.quat_nb[k]), lever_now)
    antenna -= path.v_n[k] * delay_now[:, None]
    error = np.column_stack([
        ((path.lon[k] - lon + np.pi) % (2.0 * np.pi) - np.pi) * (transverse + height) * np.cos(lat),
        (path.lat[k] - lat) * (meridian + height), path.height[k] - height,
    ]) + antenna  # fmt: skip
    out["smoothed"] = OutageScore.of(
        stamp, error, path.known("variances")[k, 6:9] + noise, spans
    ).to_dict()
    return out


def _smoothed_values(flt: ErrorStateFilter, smoothed: Smoothed, group: str, given: Array) -> Array:
    """Return smoothed values of a group at each epoch; states are what is added to the given."""
    sign = -1.0 if float(flt.layout.sign[flt.layout[group]][0]) < 0.0 else 1.0
    found = smoothed.history[group] + sign * smoothed.error[1:, flt.layout[group]]
    return np.asarray(given + found)
