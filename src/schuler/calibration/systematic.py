"""Systematic calibration: a navigator's own errors, at a known place, show the sensors' errors.

The instrument is turned through a sequence on the spot and navigates; its velocity, which should
be zero whenever it rests, is all that is measured. A Kalman filter of 30 states (attitude,
velocity, and 12 numbers a triad: bias and the matrix of scale and axes) is led by the error
equations along the navigator's own path, and what it finds corrects the record for the next pass.
Source: Savage (2000), Strapdown Analytics II, chapter 18; error equations by Groves (2013), 14.2.

True = output - bias - matrix output, to first order. The frame of the instrument is that of its
accelerometers: x is theirs, y lies in the plane of their first two (three of the nine numbers of
the accelerometers' matrix are zero by that choice).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.attitude import quat_to_matrix
from schuler.calibration.apply import Calibration
from schuler.constants import DEG, DEG_PER_HOUR, MICRO_G
from schuler.earth import Site
from schuler.errors import InputError
from schuler.record import ImuRecord

__all__ = ["NAMES", "SystematicFit", "calibrate_systematic"]

Array = NDArray[np.float64]

NAMES = (
    *(f"gyro bias {a}" for a in "xyz"), *(f"gyro {a}{b}" for a in "xyz" for b in "xyz"),
    *(f"accelerometer bias {a}" for a in "xyz"),
    *(f"accelerometer {a}{b}" for a in "xyz" for b in "xyz"),
)  # fmt: skip
_FREE = [k for k in range(24) if NAMES[k] not in (
    "accelerometer yx", "accelerometer zx", "accelerometer zy")]  # fmt: skip


@dataclass(frozen=True)
class SystematicFit:
    """What a turning sequence tells.

    Parameters
    ----------
    calibration : Calibration
    value, sigma : (24,) float64
        Of `NAMES`: rad/s, rad/rad, m/s^2, 1.
    covariance : (24, 24) float64
    unseen : list of str
        What keeps more than half of what was not known before.
    nis : float
        Mean squared normalised innovation of the last pass.
    """

    calibration: Calibration
    value: Array
    sigma: Array
    covariance: Array
    unseen: list[str]
    nis: float


def calibrate_systematic(
    record: ImuRecord, site: Site, start: ArrayLike, *, still_rate: float = 0.05 * DEG,
    gyro_noise: float = 0.003 * DEG / 60.0, accel_noise: float = 20.0 * MICRO_G,
    velocity_noise: float = 1e-3, attitude_prior: float = 0.1 * DEG,
    gyro_bias_prior: float = 1.0 * DEG_PER_HOUR, accel_bias_prior: float = 2000.0 * MICRO_G,
    matrix_prior: float = 2e-3, passes: int = 2, block: float = 0.2,
) -> SystematicFit:  # fmt: skip
    """Calibrate from a record of an instrument turned on the spot, at rest between the turns.

    Parameters
    ----------
    record : ImuRecord
    site : Site
    start : (4,) array_like
        q_b^n at the start, as the table or an alignment gives it.
    still_rate : float
        The instrument rests where its mean rate over a block is below this, rad/s.
    gyro_noise, accel_noise : float
        Random walks, rad/sqrt(s), m/s/sqrt(s).
    velocity_noise : float
        Of the measured zero, m/s.
    attitude_prior, gyro_bias_prior, accel_bias_prior, matrix_prior : float
        1 sigma before the test: rad, rad/s, m/s^2, 1.
    passes : int
    block : float
        Step of the filter, s.

    Raises
    ------
    InputError
        For a record too short or never at rest, or a start that is not a quaternion.
    """
    q0 = np.asarray(start, np.float64)
    if q0.shape != (4,) or abs(np.linalg.norm(q0) - 1.0) > 1e-6:
        raise InputError(f"start: expected a unit quaternion (w, x, y, z), got {q0.tolist()}")
    step = float(np.median(record.dt)) if len(record) else 0.0
    size = max(1, round(block / step)) if step else 0
    if size == 0 or len(record) < 100 * size:
        raise InputError("a systematic calibration needs a record of a hundred blocks or more")
    prior = np.zeros(30)
    prior[:3], prior[3:6] = attitude_prior, 1e-6
    prior[6:9], prior[9:18] = gyro_bias_prior, matrix_prior
    prior[18:21], prior[21:30] = accel_bias_prior, matrix_prior
    prior[[6 + k for k in range(24) if k not in _FREE]] = 0.0
    value = np.zeros(24)
    phi = np.zeros(3)
    nis, cov = 0.0, np.zeros((30, 30))
    for _ in range(passes):
        offset = np.concatenate([-phi, np.zeros(3), -value])
        found, cov, nis, turned = _pass(
            _corrected(value).apply(record), site, _turned(q0, phi), prior, offset, size,
            still_rate, gyro_noise, accel_noise, velocity_noise,
        )  # fmt: skip
        value = value + found
        phi = phi + turned
    sigma = np.sqrt(np.diag(cov)[6:])
    unseen = [
        NAMES[k] for k in _FREE if sigma[k] > 0.5 * prior[6 + k]
    ]  # fmt: skip
    done = _corrected(value)
    spread = {
        "gyro_bias": sigma[:3], "gyro_matrix": sigma[3:12].reshape(3, 3),
        "accel_bias": sigma[12:15], "accel_matrix": sigma[15:].reshape(3, 3),
    }  # fmt: skip
    calibration = Calibration(
        done.gyro_bias, done.accel_bias, done.gyro_matrix, done.accel_matrix,
        name="systematic", sigma=spread,
    )  # fmt: skip
    return SystematicFit(calibration, value, sigma, cov[6:, 6:], unseen, nis)


def _corrected(value: Array) -> Calibration:
    """Return output -> true for errors: true = (1 - M) output - b = (1 - M) (output - b')."""
    parts = []
    for k in (0, 12):
        matrix = np.eye(3) - value[k + 3 : k + 12].reshape(3, 3)
        parts.append((np.asarray(np.linalg.solve(matrix, value[k : k + 3]), np.float64), matrix))
    return Calibration(parts[0][0], parts[1][0], parts[0][1], parts[1][1])


def _turned(q: Array, phi: Array) -> Array:
    """Return the attitude (1 + [phi x]) q: the start with its found error taken out."""
    from schuler.attitude import multiply, rotvec_to_quat

    return np.asarray(multiply(rotvec_to_quat(phi), q))


def _pass(
    record: ImuRecord, site: Site, q0: Array, prior: Array, offset: Array, size: int,
    still_rate: float, gyro_noise: float, accel_noise: float, velocity_noise: float,
) -> tuple[Array, Array, float, Array]:  # fmt: skip
    """Navigate, filter the errors, and return what is left of them."""
    from schuler.kernels.turns import navigate_on_the_spot

    state = np.zeros(13)
    state[:4] = q0
    path = np.empty((len(record), 7))
    navigate_on_the_spot(
        state, float(not record.coning_corrected), float(not record.sculling_corrected),
        site.earth_rate, site.gravity, record.dt, record.dtheta, record.dvel, path,
    )  # fmt: skip
    c = quat_to_matrix(path[:, :4])
    w, f = record.dtheta, record.dvel
    blocks = len(record) // size
    n = blocks * size

    def sums(x: Array) -> Array:
        return np.asarray(x[:n].reshape(blocks, size, *x.shape[1:]).sum(axis=1))

    turn_bias = sums(c * record.dt[:, None, None])
    turn = sums(c[:, :, :, None] * w[:, None, None, :]).reshape(blocks, 3, 9)
    push = sums(c[:, :, :, None] * f[:, None, None, :]).reshape(blocks, 3, 9)
    force = sums(np.einsum("nij,nj->ni", c, f))
    span = sums(record.dt)
    rate = np.linalg.norm(sums(w), axis=1) / span
    rest = rate < still_rate
    if rest.sum() < 20:
        raise InputError("the instrument is hardly ever at rest: nothing is measured")
    speed = path[size - 1 : n : size, 4:7]
    earth = site.earth_rate
    spin = np.array([[0, -earth[2], earth[1]], [earth[2], 0, -earth[0]], [-earth[1], earth[0], 0]])
    x = offset.copy()
    p = np.diag(prior**2)
    phi = np.eye(30)
    eye = np.eye(3)
    # phi at the start follows along, to correct the start: three more columns.
    start = p[:, :3].copy()
    first = x[:3].copy()
    tally = count = 0.0
    for k in range(blocks):
        t = span[k]
        fx, fy, fz = force[k]
        lift = np.array([[0, -fz, fy], [fz, 0, -fx], [-fy, fx, 0]])
        phi[:3, :3] = eye - t * spin
        phi[3:6, :3] = lift
        phi[3:6, 3:6] = eye - 2.0 * t * spin
        phi[:3, 6:9], phi[:3, 9:18] = -turn_bias[k], -turn[k]
        phi[3:6, :3] = lift @ (eye - 0.5 * t * spin)
        phi[3:6, 6:9] = -0.5 * lift @ turn_bias[k]
        phi[3:6, 9:18] = -0.5 * lift @ turn[k]
        phi[3:6, 18:21], phi[3:6, 21:30] = turn_bias[k], push[k]
        x = phi @ x
        p = phi @ p @ phi.T
        start = phi @ start
        p[[0, 1, 2], [0, 1, 2]] += gyro_noise**2 * t
        p[[3, 4, 5], [3, 4, 5]] += accel_noise**2 * t
        if not rest[k]:
            continue
        for i in range(3):
            spread = p[3 + i, 3 + i] + velocity_noise**2
            miss = speed[k, i] - x[3 + i]
            gain = p[:, 3 + i] / spread
            follow = start[3 + i].copy()
            x = x + gain * miss
            first = first + follow * miss / spread
            start = start - np.outer(gain, follow)
            p = p - np.outer(gain, p[3 + i])
            tally += miss * miss / spread
            count += 1.0
        p = 0.5 * (p + p.T)
    return x[6:], p, tally / max(count, 1.0), first
