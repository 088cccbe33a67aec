"""The Cramér-Rao bound of an alignment in motion: the filter's covariance along a path.

Rows of measurements and transition are those of the path itself, so that nothing is linearised
about an error; the start is as good as unknown, and the biases have the specification as their
prior. No unbiased estimator of these measurements has less.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schuler._blas import with_one_blas_thread
from schuler.aiding import GnssFixes, ZeroVelocity
from schuler.alignment.moving.fine import filtered_end
from schuler.alignment.moving.setup import Aid, Nominal, at_rest, make_filter, measurements
from schuler.attitude import multiply, quat_to_matrix, quat_to_rotvec
from schuler.constants import ARCMIN, STAMP_ROUNDING
from schuler.earth import earth_rate, gravity, transport_rate
from schuler.errors import InputError
from schuler.ins import ErrorStateFilter
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec, load_spec
from schuler.trajectory import Trajectory
from schuler.units import time_text

__all__ = [
    "PathLimit", "limit_on", "limits_of_filter", "limits_on", "planned_fixes", "record_on",
]  # fmt: skip

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

    Examples
    --------
    >>> perfect = record_on(driven)
    >>> bool(np.abs(perfect.dtheta - drive.dtheta).max() < 1e-4)
    True
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

    Examples
    --------
    >>> from schuler.alignment import planned_fixes
    >>> len(planned_fixes(made.truth).time)
    61
    """
    count = int(np.floor((path.time[-1] - path.time[0]) * rate + 1e-6)) + 1
    time = path.time[0] + np.arange(count) / rate
    lat, lon, height = (np.interp(time, path.time, x) for x in (path.lat, path.lon, path.height))
    v = None
    if v_sigma is not None:
        v = np.column_stack([np.interp(time, path.time, c) for c in path.known("v_n").T])
    return GnssFixes(time, lat, lon, height, sigma, v, v_sigma or 0.1, name="gnss")


@dataclass(frozen=True, eq=False)
class PathLimit:
    """The best covariance that an alignment in motion can have at the end of a path.

    Parameters
    ----------
    duration : float
        s.
    covariance : (9, 9) float64
        Of phi (rad), velocity (m/s) and position (m), east, north, up.
    gyro_bias, accel_bias : (3,) float64
        1-sigma that the path leaves of the biases, rad/s and m/s^2.
    parameters : dict of str to array
        1-sigma of what is estimated of aids.
    """

    duration: float
    covariance: Array
    gyro_bias: Array
    accel_bias: Array
    parameters: dict[str, Array]

    @property
    def phi(self) -> Array:
        """Covariance of phi, rad^2, (3, 3)."""
        return self.covariance[:3, :3]

    @property
    def mounting_arcmin(self) -> list[float] | None:
        """1-sigma of a slave's mounting about its axes, arcmin; None without a master."""
        mounting = self.parameters.get("transfer.mounting")
        return None if mounting is None else [float(v) / ARCMIN for v in mounting]

    @property
    def sigma_arcmin(self) -> Array:
        """1-sigma of phi, arcmin, (3,)."""
        return np.asarray(np.sqrt(np.diag(self.phi)) / ARCMIN)


def limit_on(
    path: Trajectory, spec: ImuSpec | str | Path, aiding: Aid | Sequence[Aid | ZeroVelocity], *,
    record: ImuRecord | None = None, vibration: float = 0.0,
) -> PathLimit:  # fmt: skip
    """Return the Cramér-Rao bound of an alignment at the end of a path.

    Parameters
    ----------
    path : Trajectory
        With velocity and attitude: a plan, the truth of a simulation, or a path that was driven.
    spec : ImuSpec, str or path
        The instrument.
    aiding : GnssFixes, BodySpeed, or a sequence of them and of ZeroVelocity
        Instants and noise of what is measured; their values do not matter.
    record : ImuRecord, optional
        What a perfect instrument has along the path; `record_on` otherwise.
    vibration : float
        Least velocity random walk, m/s/sqrt(s).

    Raises
    ------
    InputError
        If the path has no velocity or attitude, or no measurement lies on it.

    Examples
    --------
    >>> from schuler.alignment import planned_fixes
    >>> bound = sc.limit_on(made.truth, "navigation-fog", planned_fixes(made.truth))
    >>> bound.sigma_arcmin.shape
    (3,)
    """
    return limits_on(path, spec, aiding, None, record=record, vibration=vibration)[0]


@with_one_blas_thread
def limits_on(
    path: Trajectory, spec: ImuSpec | str | Path, aiding: Aid | Sequence[Aid | ZeroVelocity],
    times: Sequence[float] | None, *, record: ImuRecord | None = None, vibration: float = 0.0,
) -> list[PathLimit]:  # fmt: skip
    """Return the bounds of alignments that end at several times, in one pass over the path.

    Parameters
    ----------
    path, spec, aiding, record, vibration
        As in `limit_on`.
    times : sequence of float or None
        s since the path's start, increasing; None is the end.

    Raises
    ------
    InputError
        As `limit_on`, and for a time that the path does not last.
    """
    instrument = load_spec(spec)
    if instrument is None:
        raise InputError("a bound needs an instrument: give its specification")
    told = [aiding] if isinstance(aiding, Aid) else list(aiding)
    rests = [each for each in told if isinstance(each, ZeroVelocity)]
    aids: list[Aid] = [each for each in told if not isinstance(each, ZeroVelocity)]
    samples = record_on(path) if record is None else record
    for aid in aids:
        time = np.asarray(aid.time)
        if not np.any(
            (time >= samples.start - STAMP_ROUNDING) & (time <= samples.end + STAMP_ROUNDING)
        ):
            raise InputError(
                f"{aid.name}: no measurement lies on the path, which goes from t = "
                f"{time_text(samples.start)} to {time_text(samples.end)} s"
            )
    measured = measurements(aids, samples, gate=False) + at_rest(rests, samples)
    k = int(np.searchsorted(path.time, samples.start - STAMP_ROUNDING))
    nominal = Nominal(
        float(path.lat[k]), float(path.lon[k]), float(path.height[k]), path.known("quat_nb")[k],
        path.known("v_n")[k], {},
    )  # fmt: skip
    # Nothing is fed back: the covariance is that of rows along the path itself.
    flt = make_filter(nominal, instrument, vibration, measured, aids)
    return limits_of_filter(flt, samples, path.name, times)


def limits_of_filter(
    flt: ErrorStateFilter, samples: ImuRecord, name: str, times: Sequence[float] | None
) -> list[PathLimit]:
    """Return what a filter without feedback knows at several times of perfect samples.

    Parameters
    ----------
    flt : ErrorStateFilter
    samples : ImuRecord
    name : str
        Of the path.
    times : sequence of float or None
        As in `limits_on`.

    Raises
    ------
    InputError
        For a time that the path does not last.
    """
    lasts = samples.end - samples.start
    wanted = [lasts] if times is None else list(times)
    if wanted[-1] > lasts + 1e-6 or not all(
        first < second for first, second in zip([0.0, *wanted], wanted, strict=False)
    ):
        raise InputError(
            f"{name}: the path lasts {lasts:.6g} s; times must grow and end with it at the "
            f"latest, got {', '.join(f'{each:g} s' for each in wanted)}"
        )
    out, done = [], None
    for each in wanted:
        flt.update(samples.between(done, samples.start + each + STAMP_ROUNDING))
        done = samples.start + each + STAMP_ROUNDING
        out.append(_limit_now(flt, samples.start))
    return out


def _limit_now(flt: ErrorStateFilter, start: float) -> PathLimit:
    end, _ = filtered_end(flt)
    sigma = np.sqrt(np.maximum(np.diag(end.covariance), 0.0))
    parts = {name: sigma[end.layout[name]] for name in end.layout if "." in name}
    return PathLimit(
        flt.time - start, end.covariance[:9, :9], sigma[end.layout["gyro_bias"]],
        sigma[end.layout["accelerometer_bias"]], parts,
    )  # fmt: skip
