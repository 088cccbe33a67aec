"""The inertial-frame estimators of the field's toolboxes, for a fair comparison.

Each turns the velocity integral v(t) in ib0 and its theory G(t) in i0 into an attitude:

- "position-triad", "position-wahba": both integrated once more, then the two vectors at the middle
  and the end, or least squares over all;
- "fitted-triad", "fitted-position-triad": a cubic is fitted to the velocity (a quartic to the
  position) before the two vectors are taken from it, against a moving vehicle;
- "velocity-growth": tilt and heading from the slope and the curvature of the velocity that is left
  in the level of a first attitude (open-loop parameter estimation).

All are linear in the errors of v, so that their uncertainty follows as for the others.

Sources: Silson (2011) and Wu et al. (2011) for integrals and fits; Jiang (1998) for open-loop
estimation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.history import History, gravity_direction, inertial_to_local
from schuler.attitude import quat_to_matrix, rotvec_to_quat, skew
from schuler.estimate.vectors import triad, triad_jacobian, wahba_svd
from schuler.kernels.states import TrackerNode

__all__ = ["FIELD", "field_gain", "field_solve"]

Array = NDArray[np.float64]

FIELD = (
    "position-triad", "position-wahba", "fitted-triad", "fitted-position-triad", "velocity-growth",
)  # fmt: skip

_DEGREE = {"fitted-triad": 3, "fitted-position-triad": 4}


def _means(h: History, gravity: float, lat: float) -> tuple[Array, Array, Array]:
    """Return lengths of the stretches and the mean theory and velocity over them."""
    theory = gravity * gravity_direction(lat) * h.block_means(TrackerNode.sum_gravity)
    return np.diff(h.t), theory, h.block_means(TrackerNode.sum_v)


def _functionals(dt: Array, estimator: str) -> Array:
    """Return the weights (2, m) of the means over stretches in the two vectors of a TRIAD."""
    m = len(dt)
    position = "position" in estimator
    # The position at the end of each stretch.
    series = np.tril(np.ones((m, m))) * dt if position else np.eye(m)
    if estimator == "position-triad":
        return np.asarray(series[[m // 2, m - 1]])
    t = np.cumsum(dt) - (0.0 if position else 0.5 * dt)
    x = 2.0 * t / dt.sum() - 1.0
    degree = _DEGREE[estimator]
    at = np.polynomial.legendre.legvander(np.array([-1.0, 0.0, 1.0]), degree)
    fit = at @ np.linalg.pinv(np.polynomial.legendre.legvander(x, degree))
    # Against the fit's own start: an unknown velocity drops out.
    return np.asarray((fit[1:] - fit[:1]) @ series)


def field_solve(h: History, gravity: float, lat: float, estimator: str) -> Array:
    """Return R = C_ib0^i0 (3, 3) of a (thinned) history.

    Raises
    ------
    InputError
        If the vectors do not fix an attitude.
    """
    dt, theory, velocity = _means(h, gravity, lat)
    if estimator == "position-wahba":
        place = dt[:, None]
        g, v = np.cumsum(theory * place, axis=0), np.cumsum(velocity * place, axis=0)
        return wahba_svd(np.einsum("i,ia,ib->ab", dt, g, v))
    if estimator == "velocity-growth":
        r = field_solve(h, gravity, lat, "position-triad")
        local = inertial_to_local(0.5 * (h.t[1:] + h.t[:-1]), lat)[:, :2]
        for _ in range(2):
            gain = _growth_gain(h, local, theory)
            phi = np.einsum("iab,ib->a", gain, np.einsum("iab,ib->ia", local,
                                                         velocity @ r.T - theory))  # fmt: skip
            r = np.asarray(quat_to_matrix(rotvec_to_quat(phi)) @ r)
        return r
    c = _functionals(dt, estimator)
    (r1, r2), (v1, v2) = c @ theory, c @ velocity
    return triad(r2, r1, v2, v1)


def _growth_gain(h: History, local: Array, theory: Array) -> Array:
    """Return phi_0 (m, 3, 2) from the level velocity by plain least squares."""
    m = len(theory)
    design = np.zeros((m, 2, 5))
    design[:, :, :3] = local @ skew(theory)
    design[:, :, 3:] = np.eye(2)
    weight = np.sqrt(np.diff(h.t))
    inverse = np.linalg.pinv((design * weight[:, None, None]).reshape(2 * m, 5))
    gain = inverse[:3].reshape(3, m, 2).transpose(1, 0, 2)
    return np.asarray(gain * weight[:, None, None])


def field_gain(h: History, gravity: float, lat: float, estimator: str) -> Array:
    """Return phi_0 (m, 3, 3) from errors of v, in i0, constant over each stretch."""
    dt, theory, _ = _means(h, gravity, lat)
    if estimator == "position-wahba":
        g = np.cumsum(theory * dt[:, None], axis=0)
        s = np.einsum("i,ia,ib->ab", dt, g, g)
        a = np.trace(s) * np.eye(3) - s
        later = np.cumsum((dt[:, None, None] * skew(g))[::-1], axis=0)[::-1]
        return np.asarray(np.linalg.solve(a, dt[:, None, None] * later))
    if estimator == "velocity-growth":
        local = inertial_to_local(0.5 * (h.t[1:] + h.t[:-1]), lat)[:, :2]
        return np.asarray(-_growth_gain(h, local, theory) @ local)
    c = _functionals(dt, estimator)
    r1, r2 = c @ theory
    late, early = triad_jacobian(r2, r1)
    return np.asarray(np.einsum("jm,jab->mab", c, np.stack([early, late])))
