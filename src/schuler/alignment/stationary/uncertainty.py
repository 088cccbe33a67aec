"""Covariance of the attitude by source, from how it responds to every error of the instrument.

`Responses` holds, for each stretch of the history, how phi (east, north, up) at the wanted
instant responds to a unit of angle or of velocity that was added to the increments in it, given
in i0. Every noise type of the specification is then a sum over stretches:

- bias: (sum of V C dt) squared;
- white noise N: N^2 sum of V V^T dt;
- random walk K of the bias: with the responses summed from each stretch to the end;
- bias instability B: 1/f noise as a sum of first-order Gauss-Markov processes, log-spaced in
  correlation time (two-sided spectrum B^2 / (2 pi f), IEEE Std 952-1997, C.1.3);
- quantisation Q: the difference of two white errors of the integral, so its ends and the change
  of V in between.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.history import History, inertial_to_local
from schuler.alignment.stationary.inertial import BLOCKS, Weights, weights
from schuler.attitude import quat_to_matrix, skew
from schuler.sensors import AccelerometerSpec, GyroSpec, ImuSpec
from schuler.sensors.theory import flicker_correlation, gauss_markov_correlation

__all__ = [
    "Responses",
    "analytic_responses",
    "inertial_responses",
    "instrument_budget",
    "mean_attitude",
    "part_covariance",
    "weighted_responses",
]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Responses:
    """How phi in n responds to errors of the increments.

    Parameters
    ----------
    t, dt : (m,) float64
        Middle (since the start) and length of each stretch, s.
    attitude : (m, 3, 3) float64
        C_b^i0 in the middle of each stretch.
    gyro, accel : (m, 3, 3) float64
        phi per rad and per m/s of error in i0, added evenly over the stretch.
    weights : Weights or None
        phi in n per m/s of error of the velocity integral; None for the analytic method.
    interval : float
        Sampling interval, s.
    """

    t: Array
    dt: Array
    attitude: Array
    gyro: Array
    accel: Array
    weights: Weights | None
    interval: float

    def bias_jacobian(self, which: str) -> Array:
        """Return d phi / d bias (3, 3), bias in body axes, for "gyro" or "accel"."""
        v = self.gyro if which == "gyro" else self.accel
        return np.asarray(np.einsum("iab,ibc,i->ac", v, self.attitude, self.dt))


def middle_attitude(h: History, r: Array) -> Array:
    """Return C_b^i0 (k-1, 3, 3) in the middle of each stretch of a history."""
    a, b = h.quat[:-1], h.quat[1:]
    # Neighbouring quaternions may differ in sign; their normalised mean is the middle.
    mean = a + b * np.where(np.sum(a * b, axis=1) < 0, -1.0, 1.0)[:, None]
    # Half a turn between instants leaves no mean: then either end serves.
    size = np.linalg.norm(mean, axis=1)
    mean = np.where((size > 1e-6)[:, None], mean / np.maximum(size, 1e-6)[:, None], a)
    return np.asarray(r @ quat_to_matrix(mean))


def mean_attitude(fine: History, thin: History, r: Array) -> Array:
    """Return the mean of C_b^i0 (m, 3, 3) over each stretch of a thinned history.

    From the history before thinning, so that a turn within a stretch is followed.
    """
    steps = middle_attitude(fine, r) * np.diff(fine.t)[:, None, None]
    total = np.concatenate([np.zeros((1, 3, 3)), np.cumsum(steps, axis=0)])
    ends = np.searchsorted(fine.t, thin.t)
    return np.asarray(np.diff(total[ends], axis=0) / np.diff(thin.t)[:, None, None])


def inertial_responses(
    h: History, r: Array, gravity: float, lat: float, estimator: str, at_end: bool
) -> Responses:
    """Return the responses of an inertial-frame estimator with the solution `r` = C_ib0^i0."""
    w, h = weights(h, gravity, lat, estimator, BLOCKS)
    attitude = middle_attitude(h, r)
    return weighted_responses(h, w, None, attitude, gravity, lat, at_end)


def weighted_responses(
    h: History, w: Weights, angle: Array | None, attitude: Array, gravity: float, lat: float,
    at_end: bool,
) -> Responses:  # fmt: skip
    """Return the responses of an estimate that is linear in velocities and attitudes.

    Parameters
    ----------
    h : History
        Thinned to the stretches of the weights.
    w : Weights
        phi_0 from errors of the velocity, in i0.
    angle : (m, 3, 3) float64, optional
        phi_0 from errors of the tracked attitude over each stretch, in i0.
    attitude : (m, 3, 3) float64
        C_b^i0 over each stretch.
    gravity, lat, at_end
        m/s^2, rad, and whether phi is that at the end.
    """
    dg = np.diff(h.theory(gravity, lat), axis=0)
    # What is added evenly over a stretch is in v at the later ones in full, and in its own mean,
    # taken at the ends of its updates, by their mean share.
    share = h.mean_shares()[:, None, None]
    later = np.cumsum(w.block[::-1], axis=0)[::-1] - w.block
    accel = later + share * w.block
    for row, point in zip(w.position, w.point, strict=True):
        accel[:row] += point
    force = accel @ skew(dg)
    tail = np.cumsum(force[::-1], axis=0)[::-1] - force
    gyro = -(tail + 0.5 * force)
    if angle is not None:
        gyro = gyro + np.cumsum(angle[::-1], axis=0)[::-1] - (1.0 - share) * angle
    if at_end:
        gyro = gyro - np.eye(3)
    c = inertial_to_local(h.duration if at_end else 0.0, lat)
    return Responses(
        0.5 * (h.t[1:] + h.t[:-1]),
        np.diff(h.t),
        attitude,
        c @ gyro,
        c @ accel,
        w.rotated(c),
        h.duration / max(h.samples, 1),
    )


def analytic_responses(
    h: History, c_nb: Array, gravity: float, earth_rate: Array, base: str
) -> Responses:
    """Return the responses of the analytic method: means over the whole record, in n."""
    h, _ = h.thin(BLOCKS)
    g, (_, wn, wu) = gravity, earth_rate
    # phi_E and phi_N level the force; phi_U points the rate (spec of the analytic method).
    accel, gyro = np.zeros((3, 3)), np.zeros((3, 3))
    if base == "gravity":
        accel[0, 1], accel[1, 0] = -1.0 / g, 1.0 / g
    else:
        accel[1, 0] = 1.0 / g
        # The rate is fitted exactly: the tilt about east takes its error across.
        gyro[0, 2], gyro[0, 1] = wn / (wn**2 + wu**2), -wu / (wn**2 + wu**2)
    accel[2, 0] = wu / (wn * g)
    gyro[2, 0] = -1.0 / wn
    total = h.duration
    m = len(h) - 1
    return Responses(
        0.5 * (h.t[1:] + h.t[:-1]),
        np.diff(h.t),
        np.broadcast_to(c_nb, (m, 3, 3)),
        np.broadcast_to(gyro / total, (m, 3, 3)),
        np.broadcast_to(accel / total, (m, 3, 3)),
        None,
        total / max(h.samples, 1),
    )


def _squared(v: Array, weight: Array) -> Array:
    m, a, b = v.shape
    x = (v * np.sqrt(weight)[:, None, None]).transpose(1, 0, 2).reshape(a, m * b)
    return np.asarray(x @ x.T)


def part_covariance(
    part: GyroSpec | AccelerometerSpec, body: Array, dt: Array, interval: float,
    unit: Array | None = None,
) -> dict[str, Array]:  # fmt: skip
    """Return the covariance (a, a) that each error type of a sensor triad or axis makes.

    Parameters
    ----------
    part : GyroSpec or AccelerometerSpec
    body : (m, a, b) float64
        Response of a quantities to the increments of b axes, added evenly over each stretch.
    dt : (m,) float64
        Length of each stretch, s.
    interval : float
        Sampling interval, s.
    unit : (a, a) float64, optional
        What white noise of unit density makes, where it is known already.
    """
    out: dict[str, Array] = {}
    total = body * dt[:, None, None]
    if part.bias:
        j = total.sum(axis=0)
        out["bias"] = part.bias**2 * (j @ j.T)
    if part.white:
        out["white"] = part.white**2 * (_squared(body, dt) if unit is None else unit)
    if part.quantisation:
        inner = _squared(np.diff(body, axis=0), 2.0 * interval / (dt[1:] + dt[:-1]))
        ends = body[0] @ body[0].T + body[-1] @ body[-1].T
        out["quantisation"] = part.quantisation**2 * (inner + ends)
    if part.bias_instability:
        flat = total.reshape(len(total), -1)
        mixed = (flicker_correlation(dt) @ flat).reshape(total.shape)
        out["bias_instability"] = part.bias_instability**2 * np.einsum("iab,icb->ac", total, mixed)
    if part.gauss_markov:
        flat = total.reshape(len(total), -1)
        mixed = (gauss_markov_correlation(part.gauss_markov_time, dt) @ flat).reshape(total.shape)
        out["gauss_markov"] = part.gauss_markov**2 * np.einsum("iab,icb->ac", total, mixed)
    if part.drift:
        later = np.cumsum(total[::-1], axis=0)[::-1]
        out["drift"] = part.drift**2 * _squared(later, dt)
    return out


_NAMES = {
    "gyro": {"white": "angle_random_walk", "drift": "rate_random_walk"},
    "accelerometer": {"white": "velocity_random_walk", "drift": "acceleration_random_walk"},
}


def _geometric(part: GyroSpec | AccelerometerSpec, mean: Array, j: Array) -> dict[str, Array]:
    """Return what scale factor and axis errors make of a steady input, as biases.

    Parameters
    ----------
    part : GyroSpec or AccelerometerSpec
    mean : (3,) float64
        Mean rate or force, body axes.
    j : (3, 3) float64
        d phi / d bias.
    """
    out: dict[str, Array] = {}
    for name, sigma, shape in (
        ("scale_factor", part.scale_factor, np.diag(mean**2)),
        ("scale_factor_asymmetry", part.scale_factor_asymmetry, np.diag(mean**2)),
        # A turn a of the triad makes a x mean; leaning axes mix each input into those before it.
        ("misalignment", part.misalignment, skew(mean) @ skew(mean).T),
        (
            "non_orthogonality",
            part.non_orthogonality,
            np.diag([mean[1] ** 2 + mean[2] ** 2, mean[2] ** 2, 0.0]),
        ),
    ):
        if sigma:
            out[name] = sigma**2 * (j @ shape @ j.T)
    return out


def instrument_budget(
    responses: Responses, spec: ImuSpec, mean_rate: Array, mean_force: Array
) -> dict[str, Array]:
    """Return the covariance of phi (3, 3), rad^2, of each error source of a specification.

    Parameters
    ----------
    responses : Responses
    spec : ImuSpec
    mean_rate, mean_force : (3,) float64
        Over the record, body axes, rad/s and m/s^2: what scale and axis errors act on, and what
        g-sensitive gyros feel.
    """
    r = responses
    out: dict[str, Array] = {}
    for name, v, part, mean in (
        ("gyro", r.gyro, spec.gyro, mean_rate),
        ("accelerometer", r.accel, spec.accelerometer, mean_force),
    ):
        for kind, cov in part_covariance(part, v @ r.attitude, r.dt, r.interval).items():
            out[f"{name}_{_NAMES[name].get(kind, kind)}"] = cov
        j = r.bias_jacobian("gyro" if name == "gyro" else "accel")
        for kind, cov in _geometric(part, mean, j).items():
            out[f"{name}_{kind}"] = cov
        if part.g2_sensitivity:
            out[f"{name}_g2_sensitivity"] = (
                part.g2_sensitivity**2 * j @ np.diag(mean_force**4) @ j.T
            )
    if spec.gyro.g_sensitivity:
        j = r.bias_jacobian("gyro")
        size = float(mean_force @ mean_force)
        out["gyro_g_sensitivity"] = spec.gyro.g_sensitivity**2 * size * (j @ j.T)
    return out
