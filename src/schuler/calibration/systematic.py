"""Systematic calibration: a navigator's own errors, at a known place, show the sensors' errors.

The instrument is turned through a sequence in place and navigates; its velocity, which should
be zero whenever it rests, is all that is measured. It is a configuration of the error-state filter
(`schuler.ins`): attitude, velocity, 12 numbers a triad (bias and the matrix of scale and axes) and
the attitude at the start, without feedback; what it finds is the nominal of the next pass.
Source: Savage (2000), Strapdown Analytics II, chapter 18; error equations by Groves (2013), 14.2.

True = output - bias - matrix output, to first order. The frame of the instrument is that of its
accelerometers: x is theirs, y lies in the plane of their first two (three of the nine numbers of
the accelerometers' matrix are zero by that choice).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler._blas import with_one_blas_thread
from schuler._result import Result, table_of_rows
from schuler.attitude import multiply, rotvec_to_quat
from schuler.calibration.apply import Calibration
from schuler.constants import DEG, DEG_PER_HOUR, MICRO_G
from schuler.earth import Site
from schuler.errors import InputError
from schuler.ins import ErrorStateFilter, GroupNoise, Layout, ProcessNoise, ZeroVelocity
from schuler.record import ImuRecord
from schuler.units import to_unit

__all__ = ["NAMES", "SystematicFit", "calibrate_systematic"]

Array = NDArray[np.float64]

NAMES = (
    *(f"gyro bias {a}" for a in "xyz"), *(f"gyro {a}{b}" for a in "xyz" for b in "xyz"),
    *(f"accelerometer bias {a}" for a in "xyz"),
    *(f"accelerometer {a}{b}" for a in "xyz" for b in "xyz"),
)  # fmt: skip
_FREE = [k for k in range(24) if NAMES[k] not in (
    "accelerometer yx", "accelerometer zx", "accelerometer zy")]  # fmt: skip

_GROUPS = ("gyro_bias", "gyro_matrix", "accelerometer_bias", "accelerometer_matrix")
_LAYOUT = Layout(["phi", "velocity", *_GROUPS, ("start_attitude", 3)])
_SENSORS = slice(_LAYOUT["gyro_bias"].start, _LAYOUT["accelerometer_matrix"].stop)
"""The 24 numbers of `NAMES`, in their order."""


@dataclass(frozen=True, eq=False)
class SystematicFit(Result):
    """What a sequence of rotations has found.

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

    def to_dict(self) -> dict[str, Any]:
        """Return the result with the keys of the JSON schema `schuler.calibrate-systematic/1`."""
        return {
            "schema": "schuler.calibrate-systematic/1",
            "values": {
                name: {"value": float(v), "sigma": float(s)}
                for name, v, s in zip(NAMES, self.value, self.sigma, strict=True)
            },
            "unseen": self.unseen,
            "mean_squared_innovation": float(self.nis),
        }

    def rows(self) -> list[dict[str, Any]]:
        """Return each coefficient that was free: name, value, 1-sigma and their unit."""
        out = []
        for name, value, sigma in zip(NAMES, self.value, self.sigma, strict=True):
            if sigma == 0.0:
                continue
            unit = "ppm"
            if "bias" in name:
                unit = "deg/h" if name.startswith("gyro") else "ug"
            out.append(
                {
                    "name": name,
                    "value": to_unit(float(value), unit),
                    "sigma": to_unit(float(sigma), unit),
                    "unit": unit,
                    "seen": name not in self.unseen,
                }
            )
        return out

    def columns(self) -> dict[str, Any]:
        """Return `rows` as columns."""
        return table_of_rows(self.rows())

    def __str__(self) -> str:
        lines = [
            f"{row['name']:21} {row['value']:12.5g} ± {row['sigma']:.2g} {row['unit']}"
            for row in self.rows()
        ]
        return "\n".join(lines + [f"not observable: {name}" for name in self.unseen])


@with_one_blas_thread
def calibrate_systematic(
    record: ImuRecord, site: Site, start: ArrayLike, *, still_rate: float = 0.05 * DEG,
    gyro_noise: float = 0.003 * DEG / 60.0, accel_noise: float = 20.0 * MICRO_G,
    velocity_noise: float = 1e-3, attitude_prior: float = 0.1 * DEG,
    gyro_bias_prior: float = 1.0 * DEG_PER_HOUR, accel_bias_prior: float = 2000.0 * MICRO_G,
    matrix_prior: float = 2e-3, passes: int = 2, block: float = 0.2,
) -> SystematicFit:  # fmt: skip
    """Calibrate from a record of an instrument turned in place, at rest between the turns.

    Parameters
    ----------
    record : ImuRecord
    site : Site
    start : (4,) array_like
        quat_nb at the start, as the table or an alignment gives it.
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

    Examples
    --------
    >>> from schuler.motion import Dwell, Turn, Turntable
    >>> steps = [Dwell(5.0)]
    >>> for axis in ("psi", "theta", "gamma"):
    ...     steps += [Turn(axis, 90.0, 30.0, 60.0), Dwell(5.0)]
    >>> table = Turntable(steps)
    >>> turned = sc.simulate(table, site, 30.0, 20.0, spec, np.random.default_rng(1))
    >>> fit = calibrate_systematic(turned.record, site, turned.truth.quat_nb[0])
    >>> fit.to_dict()["schema"]
    'schuler.calibrate-systematic/1'
    """
    q0 = np.asarray(start, np.float64)
    if q0.shape != (4,) or abs(np.linalg.norm(q0) - 1.0) > 1e-6:
        raise InputError(f"start: expected a unit quaternion (w, x, y, z), got {q0.tolist()}")
    step = float(np.median(record.dt)) if len(record) else 0.0
    size = max(1, round(block / step)) if step else 0
    if size == 0 or len(record) < 100 * size:
        raise InputError("a systematic calibration needs a record of a hundred blocks or more")
    prior = np.zeros(_LAYOUT.size)
    for group, size_of_prior in (
        ("phi", attitude_prior), ("velocity", 1e-6), ("gyro_bias", gyro_bias_prior),
        ("gyro_matrix", matrix_prior), ("accelerometer_bias", accel_bias_prior),
        ("accelerometer_matrix", matrix_prior),
    ):  # fmt: skip
        prior[_LAYOUT[group]] = size_of_prior
    prior[[_SENSORS.start + k for k in range(24) if k not in _FREE]] = 0.0
    noise = ProcessNoise.of(_LAYOUT, {
        "phi": GroupNoise(gyro_noise**2), "velocity": GroupNoise(accel_noise**2),
    })  # fmt: skip
    end = (len(record) // size) * size
    rate = record.dtheta[:end].reshape(-1, size, 3).sum(axis=1)
    span = record.dt[:end].reshape(-1, size).sum(axis=1)
    rest = np.linalg.norm(rate, axis=1) / span < still_rate
    if rest.sum() < 20:
        raise InputError("the instrument is hardly ever at rest: nothing is measured")
    still = ZeroVelocity(record.time[size - 1 : end : size][rest], 0.0, velocity_noise)
    value, phi = np.zeros(24), np.zeros(3)
    nis, cov = 0.0, np.zeros((_LAYOUT.size, _LAYOUT.size))
    for _ in range(passes):
        f = _filter(site, q0, prior, noise, still, value, phi, block)
        f.update(record)
        found, cov, history = f.error_state, f.covariance, f.history()
        value = value + found[_SENSORS]
        phi = phi + found[_LAYOUT["start_attitude"]]
        nis = float(np.sum(history.mean_square * history.scalars) / np.sum(history.scalars))
    whole = np.sqrt(np.diag(cov))
    sigma, sigmas = whole[_SENSORS], {name: whole[_LAYOUT[name]] for name in _GROUPS}
    unseen = [
        NAMES[k] for k in _FREE if sigma[k] > 0.5 * prior[_SENSORS.start + k]
    ]  # fmt: skip
    done = _corrected(value)
    spread = {
        "gyro_bias": sigmas["gyro_bias"],
        "gyro_matrix": sigmas["gyro_matrix"].reshape(3, 3),
        "accel_bias": sigmas["accelerometer_bias"],
        "accel_matrix": sigmas["accelerometer_matrix"].reshape(3, 3),
    }
    calibration = Calibration(
        done.gyro_bias, done.accel_bias, done.gyro_matrix, done.accel_matrix,
        name="systematic", sigma=spread,
    )  # fmt: skip
    return SystematicFit(calibration, value, sigma, cov[_SENSORS, _SENSORS], unseen, nis)


def _corrected(value: Array) -> Calibration:
    """Return output -> true for errors: true = (1 - M) output - b = (1 - M) (output - b')."""
    parts = []
    for k in (0, 12):
        matrix = np.eye(3) - value[k + 3 : k + 12].reshape(3, 3)
        parts.append((np.asarray(np.linalg.solve(matrix, value[k : k + 3]), np.float64), matrix))
    return Calibration(parts[0][0], parts[1][0], parts[0][1], parts[1][1])


def _filter(
    site: Site, q0: Array, prior: Array, noise: ProcessNoise, still: ZeroVelocity, value: Array,
    phi: Array, block: float,
) -> ErrorStateFilter:  # fmt: skip
    """Return a filter that starts from what was found before; the prior stays where it was."""
    covariance = np.diag(prior**2)
    start, now = _LAYOUT["start_attitude"], _LAYOUT["phi"]
    # The attitude at the start is a copy of phi there: later velocities show it.
    covariance[start, start] = covariance[start, now] = covariance[now, start] = covariance[
        now, now
    ]
    error = np.zeros(_LAYOUT.size)
    error[now] = error[start] = -phi
    error[_SENSORS] = -value
    groups = {name: _LAYOUT[name] for name in _GROUPS}
    return ErrorStateFilter(
        _LAYOUT, site, np.asarray(multiply(rotvec_to_quat(phi), q0)), covariance, noise, [still],
        error_state=error, fixed_place=True, feedback=False, step=block,
        parameters={
            name: value[place.start - _SENSORS.start : place.stop - _SENSORS.start]
            for name, place in groups.items()
        },
    )  # fmt: skip
