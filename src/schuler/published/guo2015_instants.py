"""Attitude from gravity at two instants, by every reading of Guo and others' table 1 (2015)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.history import inertial_to_local
from schuler.attitude import rotate
from schuler.constants import ARCMIN
from schuler.earth import Site
from schuler.prefilter.base import held_frame
from schuler.record import ImuRecord

__all__ = ["FORMS", "NOISES", "READINGS", "SPANS", "instants", "phi_of", "two_instants"]

Array = NDArray[np.float64]

NOISES = ("per root hertz", "per sample")
#: how a pair of instants is laid into the record, and which span the record has
SPANS = {
    "100 s: t1 to 50 s, t2 = t1 + 50 s": "short",
    "20 min: t1 to 10 min, t2 = t1 + 10 min": "long",
    "20 min: t1 to 50 s, t2 in the second half": "long",
}
FORMS = ("eq. 6 and 9", "TRIAD")
READINGS = tuple((noise, span, form) for noise in NOISES for span in SPANS for form in FORMS)


def instants(span: str, share: float, duration: float) -> tuple[float, float]:
    """Return t1 and t2, s, of the pair at a share (0 to 1) of the spans.

    Parameters
    ----------
    span : str
        One of `SPANS`.
    share : float
    duration : float
        Of the record, s.
    """
    which = list(SPANS).index(span)
    half = 0.5 * duration
    if which < 2:
        return share * half, (1.0 + share) * half
    return share * 50.0, (1.0 + share) * half


def two_instants(
    record: ImuRecord, site: Site, pairs: list[tuple[float, float]]
) -> dict[str, Array]:
    """Return phi in i0 of C_ib0^i0, times C_ib0^i0, from the force at two instants.

    Parameters
    ----------
    record : ImuRecord
    site : Site
    pairs : list of (t1, t2)
        s since the start.

    Returns
    -------
    dict of str to (k, 3, 3) float64
        The estimated C_ib0^i0 by each of `FORMS`; that of equation 6 is not quite a rotation.
    """
    middle = record.time - 0.5 * record.dt
    force = rotate(held_frame(record), record.accel)
    rows = np.clip(np.searchsorted(record.time, np.array(pairs), "right"), 0, len(record) - 1)
    gravity = site.gravity * inertial_to_local(middle, site.latitude)[:, 2]
    f1, f2, g1, g2 = force[rows[:, 0]], force[rows[:, 1]], gravity[rows[:, 0]], gravity[rows[:, 1]]

    def columns(a: Array, b: Array) -> Array:
        return np.stack([a, b, np.cross(a, b)], axis=-1)

    def triad(a: Array, b: Array) -> Array:
        x = a / np.linalg.norm(a, axis=-1, keepdims=True)
        y = np.cross(a, b)
        y /= np.linalg.norm(y, axis=-1, keepdims=True)
        return np.stack([x, y, np.cross(x, y)], axis=-1)

    printed = np.linalg.solve(columns(g1, g2).swapaxes(-1, -2), columns(f1, f2).swapaxes(-1, -2))
    return {
        "eq. 6 and 9": np.asarray(printed, np.float64),
        "TRIAD": triad(g1, g2) @ triad(f1, f2).swapaxes(-1, -2),
    }


def phi_of(found: Array, true: Array) -> Array:
    """Return the antisymmetric part of C_est C^T = I + S - [phi x] as phi (..., 3), arcmin."""
    e = found @ true.T
    return np.stack(
        [e[..., 1, 2] - e[..., 2, 1], e[..., 2, 0] - e[..., 0, 2], e[..., 0, 1] - e[..., 1, 0]], -1
    ) / (2.0 * ARCMIN)
