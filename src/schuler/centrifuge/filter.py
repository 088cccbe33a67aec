"""A platform's coefficients from a centrifuge test, by the extended Kalman filter of 48 states.

Source: as `schuler.centrifuge.plant`; 5 ms of propagation, 20 ms to a measurement. The
truth for simulations takes another road: the rotation matrix itself, by Runge and Kutta's fourth
order, not the filter's angles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.centrifuge.coefficients import coefficient_names, coefficient_units
from schuler.centrifuge.information import checked_angles
from schuler.centrifuge.plant import Plant
from schuler.errors import InputError

__all__ = ["Ekf", "PlatformFit", "fit_platform"]

Array = NDArray[np.float64]

#: 1 sigma of the coefficients before the test, in their customary units
PRIOR = {"D_F": 30.0, "D_": 5.0, "D__": 0.5, "k0": 2e4, "k1": 5e3, "k2": 100.0, "k3": 30.0,
         "k_": 50.0, "th": 2000.0}  # fmt: skip


@dataclass(frozen=True)
class Ekf:
    """The filter's options.

    Parameters
    ----------
    passes : int
        The first is the plain extended filter; each further one runs through the whole test again,
        linearised about what the one before has found (Gauss and Newton's iteration).
    square_root : bool
        Carry a square root of the covariance (Potter).
    step : float
        Of the propagation, s.
    drift_noise : float
        White noise of the gyros' drift, deg/sqrt(h); the square-root filter has none.
    first_noise : float
        Noise of the outputs in the first of several passes, in parts of the plant's: it keeps the
        filter from being sure before it is near. A single pass has the plant's own.

    Examples
    --------
    >>> Ekf(passes=2, square_root=True)
    Ekf(passes=2, square_root=True, step=0.005, drift_noise=0.0, first_noise=10.0)
    """

    passes: int = 4
    square_root: bool = False
    step: float = 0.005
    drift_noise: float = 0.0
    first_noise: float = 10.0

    def __post_init__(self) -> None:
        if self.passes < 1:
            raise InputError(f"a filter runs through the test once or more, got {self.passes}")
        if not self.first_noise >= 1:
            raise InputError(
                f"the noise of a filter's first pass must be 1 or more times the plant's, got "
                f"{self.first_noise:g}"
            )
        if not self.step > 0 or not self.drift_noise >= 0:
            raise InputError("a filter's step must be positive and its drift noise 0 or more")
        if self.square_root and self.drift_noise > 0:
            raise InputError(
                "the square-root filter takes no drift noise: leave it out, or square_root"
            )


@dataclass(frozen=True)
class PlatformFit:
    """Coefficients with their covariance.

    Parameters
    ----------
    names, units : tuple of str
    factor : (n,) float64
        What one of the unit is inside.
    value : (n,) float64
        rad/s, g, rad.
    covariance : (n, n) float64
    nis : float
        Mean squared normalised innovation: about 1 where model and noise are right.
    samples : int
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    factor: Array
    value: Array
    covariance: Array
    nis: float
    samples: int

    @property
    def sigma(self) -> Array:
        """1 sigma of each coefficient, inside units."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def correlation(self) -> Array:
        """Correlation of the coefficients' errors (n, n)."""
        return np.asarray(self.covariance / np.outer(self.sigma, self.sigma))


def prior_sigma(plant: Plant) -> Array:
    """Return the coefficients' 1 sigma before the test (n,), inside units."""
    out = []
    for name in coefficient_names(plant.d_oo):
        stem = name[:-1]
        if stem in PRIOR:
            out.append(PRIOR[stem])
        elif name.startswith("D"):
            out.append(PRIOR["D_" if len(stem) == 3 else "D__"])
        else:
            out.append(PRIOR["k_" if name.startswith("k") else "th"])
    return np.asarray(np.array(out) * coefficient_units(plant.d_oo)[1])


def fit_platform(
    plant: Plant, positions: ArrayLike, outputs: Sequence[Array] | Array,
    method: Ekf | None = None, forces: Sequence[float] | None = None,
    first: Sequence[float] | None = None,
) -> PlatformFit:  # fmt: skip
    """Find the coefficients from a test's outputs; they start at zero.

    Parameters
    ----------
    plant : Plant
    positions : (p, 3) array_like
        Nominal alpha, beta, gamma, deg.
    outputs : (p, m, 3) array_like, or p arrays (m, 3)
        Accelerometer outputs at each position, g.
    method : Ekf
    forces : sequence of float, optional
        Level of force at each position, g.
    first : sequence of float, optional
        Time of the first output of each position since the arm stood along the base's x, s; one
        sample where left out.

    Raises
    ------
    InputError
        For shapes that do not fit, values that are not numbers, or a step that does not divide an
        output sample.

    Examples
    --------
    >>> from schuler.centrifuge import PUBLISHED_POSITIONS, published_truth, simulate_platform
    >>> truth, rng = published_truth(), np.random.default_rng(1)
    >>> outputs = simulate_platform(Plant(), PUBLISHED_POSITIONS, 2.0, truth, rng)[0]
    >>> fit = fit_platform(Plant(), PUBLISHED_POSITIONS, outputs, Ekf(passes=1))
    >>> fit.names[0], fit.units[0]
    ('D_Fx', 'deg/h')
    """
    from schuler.kernels.platform import filter_position

    method = method or Ekf()
    nominal = checked_angles(positions)
    rows = [np.ascontiguousarray(one, dtype=np.float64) for one in outputs]
    if len(rows) != len(nominal) or any(one.ndim != 2 or one.shape[1] != 3 for one in rows):
        raise InputError(
            f"expected outputs of {len(nominal)} positions, (samples, 3) each, got "
            f"{', '.join(str(one.shape) for one in rows) or 'none'}"
        )
    for k, one in enumerate(rows, 1):
        bad = np.flatnonzero(~np.isfinite(one).all(axis=1))
        if bad.size:
            raise InputError(
                f"the accelerometer outputs of position {k} are not finite numbers at sample "
                f"{bad[0] + 1} of {len(one)}"
            )
    if forces is not None and (len(forces) != len(nominal) or not all(f > 0 for f in forces)):
        raise InputError(
            f"forces: expected {len(nominal)} positive numbers of g, got {list(forces)}"
        )
    levels = [plant.harmonics(force) for force in forces or [plant.force] * len(nominal)]
    every = round(1.0 / (plant.sampling * method.step))
    if every < 1 or abs(every * method.step * plant.sampling - 1.0) > 1e-9:
        raise InputError(f"an output sample must be a whole number of steps of {method.step:g} s")
    begun = _first_steps(plant, first, len(nominal), method.step, every)
    n = plant.unknowns
    sigma = prior_sigma(plant)
    state = np.zeros(n + 6)
    walk = (np.deg2rad(method.drift_noise) / 60.0) ** 2
    start = nominal.copy()
    for lap in range(method.passes):
        innovation_sums = np.zeros(2)
        wider = method.first_noise if lap == 0 and method.passes > 1 else 1.0
        held = np.diag(np.concatenate([sigma, np.zeros(6)]))
        if not method.square_root:
            held = held**2
        off = np.zeros(n + 6)
        # The coefficients were zero before the test, whatever they are linearised about.
        off[:n] = -state[:n]
        seen = []
        state_start = np.zeros_like(nominal)
        for k, row in enumerate(nominal):
            state[n : n + 3] = state[n + 3 :] = start[k]
            back = _turn_per_angle(start[k], plant.order)
            off[n : n + 3] = off[n + 3 :] = -back @ (row - start[k])
            held = _at_new_position(held, plant.attitude_prior * back, method.square_root)
            filter_position(
                state, off, held, begun[k], rows[k], plant.order_number, plant.gyro_axes,
                plant.turning, levels[k], plant.omega, plant.earth, method.step, every,
                plant.terms, (1e-6 * wider * plant.noise) ** 2, walk, lap > 0,
                int(method.square_root), innovation_sums,
            )  # fmt: skip
            _refuse_divergence(state, held, k, method.square_root)
            state_start[k] = state[n + 3 :]
            seen.append(_start_given(held, state + off, off[n + 3 :], method.square_root))
        state[:n] += off[:n]
        for k, (gain, then, turned) in enumerate(seen):
            # What later positions told of the coefficients tells of this one's start as well.
            turned = turned + gain @ (state[:n] - then)
            base = state_start[k] if lap == 0 else start[k]
            start[k] = base - np.linalg.solve(_turn_per_angle(base, plant.order), turned)
    held = held[:n]
    cov = held @ held.T if method.square_root else 0.5 * (held[:, :n] + held[:, :n].T)
    units, factor = coefficient_units(plant.d_oo)
    return PlatformFit(
        coefficient_names(plant.d_oo), units, factor, state[:n].copy(), cov,
        float(innovation_sums[0] / max(innovation_sums[1], 1.0)), int(innovation_sums[1]),
    )  # fmt: skip


def _refuse_divergence(state: Array, held: Array, position: int, square_root: bool) -> None:
    sound = np.isfinite(state).all() and np.isfinite(held).all()
    if not sound or not (square_root or (np.diag(held) > 0.0).all()):
        raise InputError(
            f"the filter diverged at position {position + 1}: the outputs are not of this plant "
            "and scheme; look at the positions and their order, the gimbals' order, the unit, and "
            "the arm's angle at the first sample"
        )


def _first_steps(
    plant: Plant, first: Sequence[float] | None, count: int, step: float, every: int
) -> list[int]:
    """Return the steps since the arm's zero that lie before each position's first sample."""
    if first is None:
        return [0] * count
    begun = [round(t / step) - every for t in first]
    off = [abs((b + every) * step - t) for b, t in zip(begun, first, strict=True)]
    if len(begun) != count or max(off) > 0.1 * step:
        raise InputError(
            f"the first output of each of {count} positions must stand a whole number of steps of "
            f"{step:g} s after the arm's zero, got {[float(t) for t in first]}"
        )
    return begun


def filter_information(
    plant: Plant, positions: ArrayLike, dwell: float, forces: Sequence[float] | None = None
) -> Array:
    """Return the information (n, n) of a scheme by the filter's covariance, linearised about zero.

    Takes what `schuler.centrifuge.direct_information` does not: commanded rate, servo error,
    mounting angles of the gyros.
    """
    from schuler.kernels.platform import filter_position

    nominal, n, method = checked_angles(positions), plant.unknowns, Ekf()
    samples = plant.turns(dwell) * round(plant.sampling * plant.period)
    every = round(1.0 / (plant.sampling * method.step))
    sigma = prior_sigma(plant)
    held = np.diag(np.concatenate([sigma, np.zeros(6)]) ** 2)
    state, off = np.zeros(n + 6), np.zeros(n + 6)
    for k, row in enumerate(nominal):
        state[n : n + 3] = state[n + 3 :] = row
        held = _at_new_position(
            held, plant.attitude_prior * _turn_per_angle(row, plant.order), False
        )
        filter_position(
            state, off, held, 0, np.zeros((samples, 3)), plant.order_number, plant.gyro_axes,
            plant.turning, plant.harmonics(None if forces is None else forces[k]), plant.omega,
            plant.earth, method.step, every, plant.terms, (1e-6 * plant.noise) ** 2, 0.0, True, 0,
            np.zeros(2),
        )  # fmt: skip
    scaled = held[:n, :n] / np.outer(sigma, sigma)
    inner = np.linalg.inv(0.5 * (scaled + scaled.T)) - np.eye(n)
    return np.asarray(inner / np.outer(sigma, sigma))


def _turn_per_angle(angles: Array, order: str) -> Array:
    """Return T^-1 (eq. 14 for z, y, x): how p turns with its angles."""
    sb, cb = np.sin(angles[1]), np.cos(angles[1])
    sg, cg = np.sin(angles[2]), np.cos(angles[2])
    if order == "yzx":
        return np.array([[cb * cg, -sg, 0.0], [-sb, 0.0, 1.0], [cb * sg, cg, 0.0]])
    return np.array([[cb * cg, sg, 0.0], [-cb * sg, cg, 0.0], [sb, 0.0, 1.0]])


def _start_given(
    held: Array, estimate: Array, turned: Array, square_root: bool
) -> tuple[Array, Array, Array]:
    """Return how a position's start follows the coefficients, these, and the start's turn."""
    n = len(held) - 6
    cov = held @ held.T if square_root else held
    scale = 1.0 / np.sqrt(np.diag(cov)[:n])
    inner = cov[:n, :n] * np.outer(scale, scale)
    gain = np.linalg.solve(inner, (scale * cov[n + 3 :, :n]).T).T * scale
    return gain, estimate[:n].copy(), turned.copy()


def _at_new_position(held: Array, spread: Array, square_root: bool) -> Array:
    """Forget the attitude: keep what is known of the coefficients, put the prior in."""
    n = len(held) - 6
    out = np.zeros_like(held)
    if square_root:
        out[:n, :n] = np.asarray(np.linalg.qr(held[:n].T, mode="r")).T
        out[n : n + 3, n : n + 3] = out[n + 3 :, n : n + 3] = spread
    else:
        out[:n, :n] = held[:n, :n]
        for rows in (slice(n, n + 3), slice(n + 3, n + 6)):
            for columns in (slice(n, n + 3), slice(n + 3, n + 6)):
                out[rows, columns] = spread @ spread.T
    return out
