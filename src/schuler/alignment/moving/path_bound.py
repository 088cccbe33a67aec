"""The Cramér-Rao bound of an alignment in motion: the filter's covariance along a path.

Rows of measurements and transition are those of the path itself, so that nothing is linearised
about an error; the start is as good as unknown, and the biases have the specification as their
prior. No unbiased estimator of these measurements has less.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import GnssFixes
from schuler.alignment.moving.setup import Aid, Nominal, make_filter, measurements
from schuler.attitude import multiply, quat_to_matrix, quat_to_rotvec
from schuler.earth import earth_rate, gravity, transport_rate
from schuler.errors import InputError
from schuler.ins import ErrorStateFilter
from schuler.ins.frames import east_angle, to_east_north_up
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec
from schuler.trajectory import Trajectory

__all__ = ["limit_on", "planned_fixes", "record_on"]

Array = NDArray[np.float64]


def record_on(path: Trajectory) -> ImuRecord:
    """Return the samples that a perfect instrument has along a path.

    Parameters
    ----------
    path : Trajectory
        With velocity and attitude, at the rate of the samples; between rows both change evenly.

    Raises
    ------
    InputError
        If velocity or attitude is missing, or there are fewer than three rows.
    """
    if len(path) < 3:
        raise InputError(f"{path.name}: a path needs three rows at least")
    quat, v = path.known("quat_nb"), path.known("v_n")
    dt = np.diff(path.time)
    lat, height = (0.5 * (x[1:] + x[:-1]) for x in (path.lat, path.height))
    mean_v = 0.5 * (v[1:] + v[:-1])
    earth = earth_rate(lat)
    frame = earth + transport_rate(lat, height, mean_v[:, 0], mean_v[:, 1])
    back = quat[:-1] * [1.0, -1.0, -1.0, -1.0]
    step = quat_to_rotvec(multiply(back, quat[1:]))
    middle = quat_to_matrix(_halfway(quat, step))
    dtheta = step + np.einsum("iab,ia->ib", middle, frame) * dt[:, None]
    force = np.diff(v, axis=0) / dt[:, None] + np.cross(earth + frame, mean_v)
    force[:, 2] += gravity(lat, height)
    dvel = np.einsum("iab,ia->ib", middle, force) * dt[:, None]
    return ImuRecord(path.time[1:], dt, dtheta, dvel, name=path.name)


def _halfway(quat: Array, step: Array) -> Array:
    from schuler.attitude import rotvec_to_quat

    return np.asarray(multiply(quat[:-1], rotvec_to_quat(0.5 * step)))


def planned_fixes(
    path: Trajectory, rate: float = 1.0, sigma: float = 3.0, v_sigma: float | None = 0.1
) -> GnssFixes:
    """Return the fixes that a receiver would have along a path, without noise.

    Parameters
    ----------
    path : Trajectory
    rate : float
        Hz.
    sigma, v_sigma : float
        1-sigma of position (m) and velocity (m/s; None for a receiver without velocity).
    """
    count = int(np.floor((path.time[-1] - path.time[0]) * rate + 1e-6)) + 1
    time = path.time[0] + np.arange(count) / rate
    lat, lon, height = (np.interp(time, path.time, x) for x in (path.lat, path.lon, path.height))
    v = None
    if v_sigma is not None:
        v = np.column_stack([np.interp(time, path.time, c) for c in path.known("v_n").T])
    return GnssFixes(time, lat, lon, height, sigma, v, v_sigma or 0.1, name="gnss")


def limit_on(
    path: Trajectory, spec: ImuSpec, aiding: Aid | Sequence[Aid], *,
    record: ImuRecord | None = None, vibration: float = 0.0,
) -> ErrorStateFilter:  # fmt: skip
    """Return a filter that was led along a path: its covariance is the bound.

    Parameters
    ----------
    path : Trajectory
        With velocity and attitude.
    spec : ImuSpec
        The instrument.
    aiding : GnssFixes, BodySpeed, or a sequence of them
        Instants and noise of what is measured; their values do not matter.
    record : ImuRecord, optional
        What a perfect instrument has along the path; `record_on` otherwise.
    vibration : float
        Least velocity random walk, m/s/sqrt(s).

    Raises
    ------
    InputError
        If the path has no velocity or attitude, or no measurement lies on it.
    """
    aids = [aiding] if isinstance(aiding, Aid) else list(aiding)
    samples = record_on(path) if record is None else record
    measured = measurements(aids, samples, gate=False)
    k = int(np.searchsorted(path.time, samples.start - 1e-9))
    nominal = Nominal(
        float(path.lat[k]), float(path.lon[k]), float(path.height[k]), path.known("quat_nb")[k],
        path.known("v_n")[k], {},
    )  # fmt: skip
    flt = make_filter(nominal, spec, vibration, measured, aids)
    flt.update(samples)
    return flt


def phi_covariance(flt: ErrorStateFilter) -> Array:
    """Return the covariance of phi (3, 3) in East-North-Up, rad^2."""
    turn = to_east_north_up(float(east_angle(flt.frame[None])[2][0]))
    return np.asarray(turn @ flt.covariance[:3, :3] @ turn.T)
