"""The Cramér-Rao limit of a static alignment: what no method can beat.

In position i a base at rest reads f = C_i^T (I + [phi x]) g up + nabla and
w = C_i^T (I + [phi x]) w_ie + eps, with one phi and constant biases for all positions. The turns
between them are known exactly (an indexing table), or as well as the gyros' angle random walk lets
them be tracked for as long as they take. The noise of the averages over stretches, correlated
over all of the test by flicker and random walk, is weighted by its inverse covariance. The biases
have the specification as their prior; phi has none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._blas import with_one_blas_thread
from schuler._files import check_keys, number, read_toml
from schuler.attitude import euler_to_quat, quat_to_matrix, skew
from schuler.constants import DEG
from schuler.earth import Site
from schuler.errors import InputError, expect, located
from schuler.estimate.information import covariance_of, gls_information
from schuler.sensors import ImuSpec
from schuler.sensors.theory import mean_covariance
from schuler.units import parse

__all__ = ["Limit", "Position", "limit", "load_positions", "position_limit"]

Array = NDArray[np.float64]

_STEPS = 48
"""Stretches into which the whole test is cut; a position has four at least."""

_NAMES = (
    "phi east", "phi north", "phi up",
    "gyro bias x", "gyro bias y", "gyro bias z",
    "accelerometer bias x", "accelerometer bias y", "accelerometer bias z",
)  # fmt: skip


@dataclass(frozen=True)
class Position:
    """A dwell at an attitude.

    Parameters
    ----------
    heading_ccw_deg, pitch_deg, roll_deg : float
        psi counter-clockwise, pitch and roll.
    dwell : float
        s.
    turn : float
        How long the gyros track the turn to this position, s; 0 is a turn known exactly.
    """

    heading_ccw_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    dwell: float = 300.0
    turn: float = 0.0

    def __post_init__(self) -> None:
        angles = (self.heading_ccw_deg, self.pitch_deg, self.roll_deg)
        if not all(np.isfinite(angles)):
            raise InputError(f"a position's angles must be finite, got {angles}")
        if not (np.isfinite(self.dwell) and self.dwell > 0):
            raise InputError(f"a position's dwell must be a positive time, got {self.dwell} s")
        if not (np.isfinite(self.turn) and self.turn >= 0):
            raise InputError(f"a position's turn must be a time of 0 or more, got {self.turn} s")

    @property
    def matrix(self) -> Array:
        """C_b^n (3, 3)."""
        euler = np.array([self.heading_ccw_deg, self.pitch_deg, self.roll_deg]) * DEG
        return quat_to_matrix(euler_to_quat(euler))


@dataclass(frozen=True, eq=False)
class Limit:
    """The best covariance that any estimator can have.

    Parameters
    ----------
    duration : float
        Time in all positions, s.
    covariance : (9, 9) float64
        Of phi (east, north, up; rad), gyro bias (rad/s) and accelerometer bias (m/s^2), both in
        body axes.
    """

    duration: float
    covariance: Array

    @property
    def phi(self) -> Array:
        """Covariance of phi, rad^2, (3, 3)."""
        return self.covariance[:3, :3]

    @property
    def sigma_arcmin(self) -> Array:
        """1-sigma of phi, arcmin, (3,)."""
        return np.asarray(np.sqrt(np.diag(self.phi)) / (DEG / 60.0))

    @property
    def gyro_bias(self) -> Array:
        """1-sigma of the gyro bias that the test leaves, rad/s, (3,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[3:6]))

    @property
    def accel_bias(self) -> Array:
        """1-sigma of the accelerometer bias that the test leaves, m/s^2, (3,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[6:9]))


def _stretches(dwells: Array) -> tuple[NDArray[np.int64], Array, Array]:
    """Return position, start and length of each stretch."""
    count = np.maximum(4, np.round(_STEPS * dwells / dwells.sum()).astype(np.int64))
    which = np.repeat(np.arange(len(dwells)), count)
    dt = (dwells / count)[which]
    return which, np.cumsum(dt) - dt, dt


@with_one_blas_thread
def position_limit(
    spec: ImuSpec, site: Site, positions: Sequence[Position], interval: float = 0.01
) -> Limit:
    """Return the Cramér-Rao limit of dwells at a sequence of attitudes.

    Parameters
    ----------
    spec : ImuSpec
        The instrument; its biases are the prior. A sensor said to be free of errors is taken as a
        billionth of its signal.
    site : Site
        Latitude and height.
    positions : sequence of Position
        One after the other.
    interval : float
        Sampling interval, s.

    Raises
    ------
    InputError
        If there is no position, the interval is not positive, or phi cannot be seen (at a
        pole).

    Examples
    --------
    >>> start, turned = Position(300.0), Position(heading_ccw_deg=180.0, dwell=300.0)
    >>> one = position_limit(spec, site, [start]).sigma_arcmin[2]
    >>> two = position_limit(spec, site, [start, turned]).sigma_arcmin[2]
    >>> bool(two < 0.9 * one)
    True
    """
    if not positions:
        raise InputError("a limit needs one position at least")
    if not (np.isfinite(interval) and interval > 0):
        raise InputError(f"the sampling interval must be a positive time, got {interval} s")
    if abs(np.cos(site.latitude)) < 1e-6:
        raise InputError("at a pole the heading is not observable by the Earth's rotation")
    which, start, dt = _stretches(np.array([p.dwell for p in positions]))
    turned = np.stack([p.matrix.T for p in positions])[which]
    up = np.array([0.0, 0.0, site.gravity])
    # What tracking a turn leaves unknown is a rotation of all positions from there on.
    drift = spec.gyro.white**2 * np.array([p.turn for p in positions])
    tracked = [k for k in range(1, len(positions)) if drift[k] > 0]
    size = 9 + 3 * len(tracked)
    information = np.zeros((size, size))
    for part, signal, column in ((spec.gyro, site.earth_rate, 3), (spec.accelerometer, up, 6)):
        strength = float(np.linalg.norm(signal))
        h = np.zeros((len(dt), 3, size))
        h[:, :, :3] = -turned @ skew(signal)
        for k, position in enumerate(tracked):
            after = which >= position
            h[after, :, 9 + 3 * k : 12 + 3 * k] = h[after, :, :3]
        h[:, :, column : column + 3] = np.eye(3)
        noise = mean_covariance(part, start, dt, interval)
        # Noise that is negligible beside the bias keeps the inverse in its digits.
        noise += np.eye(len(dt)) * max(1e-4 * part.bias, 1e-9 * strength) ** 2
        information += gls_information(h, noise)
        bias = max(part.bias, 1e-9 * strength)
        information[range(column, column + 3), range(column, column + 3)] += 1.0 / bias**2
    for k, position in enumerate(tracked):
        own = range(9 + 3 * k, 12 + 3 * k)
        information[own, own] += 1.0 / drift[position]
    names = _NAMES + tuple(f"turn {position}" for position in tracked for _ in range(3))
    return Limit(float(dt.sum()), covariance_of(information, names)[:9, :9])


@with_one_blas_thread
def limit(spec: ImuSpec, site: Site, duration: float, interval: float = 0.01) -> Array:
    """Return the Cramér-Rao limit on the covariance of phi for a base at rest.

    Parameters
    ----------
    spec : ImuSpec
        The instrument.
    site : Site
        Latitude and height.
    duration : float
        Time, s.
    interval : float
        Sampling interval, s.

    Returns
    -------
    (3, 3) float64
        rad^2 in ENU; it does not depend on the attitude.

    Raises
    ------
    InputError
        If the duration or the interval is not positive.

    Examples
    --------
    >>> covariance = sc.limit(spec, site, 300.0)
    >>> sigma = np.rad2deg(np.sqrt(np.diag(covariance))) * 60.0
    >>> bool(2.0 < sigma[2] < 10.0)  # heading, arcmin
    True
    """
    expect(spec, ImuSpec, "spec", "schuler.load_spec gives one of a grade or a file")
    expect(site, Site, "site", "say schuler.Site(lat, lon, height)")
    expect(duration, Real, "duration", "give it in seconds")
    if not (np.isfinite(duration) and duration > 0):
        raise InputError(f"the duration must be a positive time, got {duration} s")
    return position_limit(spec, site, [Position(dwell=duration)], interval).phi


def load_positions(path: str | Path) -> list[Position]:
    r"""Read positions from TOML: ``[[position]]`` tables with angles and ``dwell = "300 s"``.

    Raises
    ------
    InputError
        If the file cannot be read, is not TOML, or holds a bad value, naming the position.

    Examples
    --------
    >>> from pathlib import Path
    >>> text = '[[position]]\nheading_ccw_deg = 30\ndwell = "300 s"\n'
    >>> length = Path("positions.toml").write_text(text)
    >>> load_positions("positions.toml")[0].dwell
    300.0
    """
    data = read_toml(path)
    tables = data.pop("position", None)
    if data or not isinstance(tables, list) or not tables:
        raise InputError(f"{path}: expected one or more [[position]] tables and nothing else")
    return [_position(table, f"{path}: position {k}") for k, table in enumerate(tables, 1)]


def _position(table: Any, where: str) -> Position:
    keys = ("heading_ccw_deg", "pitch_deg", "roll_deg", "dwell", "turn")
    check_keys(table, keys, where)
    values: dict[str, float] = {}
    for key in keys:
        if key not in table:
            continue
        value = table[key]
        if key in ("dwell", "turn"):
            values[key] = parse(value, "time", f"{where}: {key}")
        else:
            values[key] = number(value, f"{where}: {key}", " of degrees")
    with located(where):
        return Position(**values)
