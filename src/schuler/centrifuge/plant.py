"""A stabilised platform on a counter-rotating centrifuge: plant, unknowns, and what a test tells.

Source: Xu and Zhang (2017), Journal of National University of Defense Technology 39(1), 46-50.
Its force in the base frame (eq. 10) prints gravity's part downwards beside a centripetal force
inwards; `Plant.printed_gravity` takes it so. Its text prints two orders of the gimbals: eq. 7 and
the kinematics of eq. 15 are y, z, x; eq. 14 holds for z, y, x. Both are options.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.centrifuge.sums import node_integrals, sum_nodes, turn_products
from schuler.constants import ARCSEC, DEG, DEG_PER_HOUR, EARTH_RATE
from schuler.errors import InputError

__all__ = [
    "ORDERS",
    "PUBLISHED_ESTIMATES",
    "PUBLISHED_POSITIONS",
    "PUBLISHED_TRUTH",
    "Plant",
    "Tables",
    "coefficient_names",
    "coefficient_units",
    "direct_information",
    "position_matrices",
    "published_truth",
    "scheme_information",
]

Array = NDArray[np.float64]

#: orders of the gimbals, as the kernels number them
ORDERS = ("zyx", "yzx")

#: the published scheme: alpha, beta, gamma, deg
PUBLISHED_POSITIONS: tuple[tuple[float, float, float], ...] = (
    (45, 0, 167), (350, 0, 325), (209, 0, 182), (134, 0, 141), (106, 0, 338), (142, 0, 269),
)  # fmt: skip

GYRO_TERMS = ("D_F", "D_I", "D_O", "D_S", "D_II", "D_SS", "D_IO", "D_IS", "D_OS", "D_OO")
ACCEL_TERMS = ("k0", "k1", "k2", "k3", "k_IP")
MOUNTING = ("th_py", "th_pz", "th_oz")

#: the published truth in its units: deg/h, deg/h/g, deg/h/g^2; ug, ug/g, ...; arcsec (x, y, z)
PUBLISHED_TRUTH: dict[str, tuple[float, float, float]] = {
    "D_F": (7.370, 7.821, 1.654),
    "D_I": (1.083, 1.023, 0.933), "D_O": (1.083, 1.023, 0.933), "D_S": (1.083, 1.023, 0.933),
    "D_II": (0.060, 0.060, 0.060), "D_SS": (0.060, 0.060, 0.060),
    "D_IO": (0.045, 0.045, 0.045), "D_IS": (0.045, 0.045, 0.045), "D_OS": (0.045, 0.045, 0.045),
    "k0": (3500, 4250, 6310), "k1": (160, 100, 1100), "k2": (12, 12, 12), "k3": (3, 3, 3),
    "k_IP": (5, 5, 5),
    "th": (305, 305, 260),
}  # fmt: skip

_GYRO_UNITS = ("deg/h", *["deg/h/g"] * 3, *["deg/h/g^2"] * 6)
_ACCEL_UNITS = ("ug", "ug/g", "ug/g^2", "ug/g^3", "ug/g^2")


def coefficient_names(d_oo: bool = False) -> tuple[str, ...]:
    """Name the unknowns in their order: ``D_Fx`` to ``th_oz``; 45, or 48 with D_OO."""
    terms = GYRO_TERMS if d_oo else GYRO_TERMS[:-1]
    return (*(f"{term}{axis}" for term in (*terms, *ACCEL_TERMS) for axis in "xyz"), *MOUNTING)


def coefficient_units(d_oo: bool = False) -> tuple[tuple[str, ...], Array]:
    """Return the unknowns' spoken units and what one of each is inside (rad/s, g, rad)."""
    gyro = _GYRO_UNITS if d_oo else _GYRO_UNITS[:-1]
    names = [u for u in (*gyro, *_ACCEL_UNITS) for _ in "xyz"] + ["arcsec"] * 3
    factor = {"d": DEG_PER_HOUR, "u": 1e-6, "a": ARCSEC}
    return tuple(names), np.array([factor[name[0]] for name in names])


PUBLISHED_ESTIMATES = (
    7.3807, 7.7628, 1.6111, 1.0800, 1.0305, 0.9357, 1.0896, 1.0171, 0.9500, 1.0739, 1.0325, 0.9269,
    0.0603, 0.0603, 0.0606, 0.0606, 0.0609, 0.0603, 0.0448, 0.0462, 0.0451, 0.0446, 0.0451, 0.0447,
    0.0445, 0.0455, 0.0458, 3499.83, 4249.09, 6310.41, 159.75, 100.22, 1101.31, 12.02, 12.02, 11.99,
    2.99, 3.00, 3.01, 5.00, 4.98, 4.95, 304.98, 305.10, 259.95,
)  # fmt: skip
"""The document's estimates (its table 2), in the order of `coefficient_names`."""


def published_truth() -> Array:
    """Return the published true coefficients (45,), rad/s a power of g, g a power of g, rad."""
    values = np.array([v for three in PUBLISHED_TRUTH.values() for v in three], dtype=np.float64)
    return values * coefficient_units()[1]


@dataclass(frozen=True)
class Plant:
    """A counter-rotating centrifuge and the noise of the platform's outputs.

    Parameters
    ----------
    force : float
        Centripetal acceleration, g.
    rate : float
        Of the arm, deg/s.
    latitude : float
        deg.
    noise : float
        White noise of an accelerometer's output sample, ug.
    sampling : float
        Output samples a second, Hz.
    attitude_prior : float
        1 sigma of each Euler angle at the start of a position, rad.
    d_oo : bool
        Look for D_OO as well: needs two levels of force or more.
    order : {"zyx", "yzx"}
        Order of the gimbals: C_r^p = Mz(gamma) My(beta) Mx(alpha), or My(gamma) Mz(beta) Mx(alpha).
    commanded : (3,) tuple of float
        Commanded rate of the gyros x, y, z (eq. 17), deg/h.
    servo_error : (3,) tuple of float
        Rate error of the servo loop in the platform's axes (eq. 16), deg/h.
    gyro_mounting : (6,) tuple of float
        Mounting angles of the gyros (eq. 4 to 6), ox, sx, oy, sy, oz, sz, arcsec.
    earth_centrifugal : bool
        Take Omega x (Omega x r) of the arm as well: 5e-9 g at 10 g.
    printed_gravity : bool
        Gravity's specific force points down, as eq. 10 prints it, and not up.
    """

    force: float = 10.0
    rate: float = 180.0
    latitude: float = 28.22
    noise: float = 10.0
    sampling: float = 50.0
    attitude_prior: float = 1e-3
    d_oo: bool = False
    order: str = "zyx"
    commanded: tuple[float, float, float] = (0.0, 0.0, 0.0)
    servo_error: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gyro_mounting: tuple[float, float, float, float, float, float] = (0.0,) * 6
    earth_centrifugal: bool = False
    printed_gravity: bool = False

    def __post_init__(self) -> None:
        for name in ("force", "rate", "noise", "sampling", "attitude_prior"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise InputError(f"a centrifuge's {name} must be positive, got {value}")
        if not abs(self.latitude) <= 90:
            raise InputError(f"latitude must be from -90 to 90 deg, got {self.latitude}")
        if self.order not in ORDERS:
            raise InputError(f"unknown gimbal order '{self.order}'; known: {', '.join(ORDERS)}")
        for name, count in (("commanded", 3), ("servo_error", 3), ("gyro_mounting", 6)):
            given = np.asarray(getattr(self, name), dtype=np.float64)
            if given.shape != (count,) or not np.isfinite(given).all():
                raise InputError(f"a platform's {name} must be {count} finite numbers")
        turn = self.sampling * 360.0 / self.rate
        if abs(turn - round(turn)) > 1e-6 or round(turn) < 8:
            raise InputError(
                f"a turn of the arm must hold a whole number of samples, eight or more: "
                f"{self.sampling:g} Hz at {self.rate:g} deg/s gives {turn:g}"
            )

    @property
    def omega(self) -> float:
        """Rate of the arm, rad/s."""
        return self.rate * DEG

    @property
    def period(self) -> float:
        """Time of a turn, s."""
        return 360.0 / self.rate

    @property
    def earth(self) -> Array:
        """Rate of the base (east, north, up), rad/s."""
        lat = self.latitude * DEG
        return EARTH_RATE * np.array([0.0, np.cos(lat), np.sin(lat)])

    @property
    def terms(self) -> int:
        """Terms of a gyro's model."""
        return 10 if self.d_oo else 9

    @property
    def unknowns(self) -> int:
        """How many coefficients are looked for."""
        return 3 * self.terms + 18

    @property
    def order_number(self) -> int:
        """The gimbals' order as the kernels number it."""
        return ORDERS.index(self.order)

    @property
    def gyro_axes(self) -> Array:
        """Axes I, O, S (rows) of each gyro in the platform, (3, 3, 3) (eq. 4 to 6)."""
        ox, sx, oy, sy, oz, sz = np.asarray(self.gyro_mounting, dtype=np.float64) * ARCSEC
        return np.array([
            [[1.0, -ox, -sx], [-sx, 0.0, -1.0], [ox, 1.0, 0.0]],
            [[oy, 1.0, -sy], [0.0, -sy, -1.0], [-1.0, oy, 0.0]],
            [[sz, -oz, 1.0], [1.0, 0.0, -sz], [0.0, 1.0, oz]],
        ])  # fmt: skip

    @property
    def turning(self) -> Array:
        """Commanded rate less the servo loop's error, in the platform, rad/s (eq. 16 to 18)."""
        commanded = self.gyro_axes[:, 0].T @ np.asarray(self.commanded, dtype=np.float64)
        return np.asarray((commanded - self.servo_error) * DEG_PER_HOUR)

    @property
    def is_still(self) -> bool:
        """Whether the platform keeps its attitude in inertial space, its gyros well mounted."""
        return not (any(self.commanded) or any(self.servo_error) or any(self.gyro_mounting))

    def harmonics(self, force: float | None = None) -> Array:
        """Return a, b, c (3, 3) of the base's force a + b cos wt + c sin wt, g (eq. 10)."""
        level = self.force if force is None else force
        _, north, up = self.earth / self.omega
        swing = level * (1.0 + 2.0 * up)
        down = -1.0 if self.printed_gravity else 1.0
        out = np.array([[0.0, 0.0, down], [-swing, 0.0, 0.0], [0.0, -swing, 2.0 * level * north]])
        if self.earth_centrifugal:
            # Omega (Omega r) - r Omega^2 of the arm's r.
            out[1, 0] -= level * (north**2 + up**2)
            out[2, 1:] += level * up * np.array([-up, north])
        return out

    def turns(self, dwell: float) -> int:
        """Return the turns of the arm in a dwell, s.

        Raises
        ------
        InputError
            If it is not a whole number, one or more.
        """
        turns = dwell / self.period
        if not (np.isfinite(turns) and round(turns) >= 1 and abs(turns - round(turns)) < 1e-6):
            raise InputError(
                f"a dwell must last a whole number of turns of the arm ({self.period:g} s each), "
                f"got {dwell:g} s"
            )
        return round(turns)


@dataclass(frozen=True)
class Tables:
    """What the closed form needs of a plant, a dwell and the levels of force; made once.

    Parameters
    ----------
    plant : Plant
    dwell : float
        s at a position.
    levels : tuple of float
        Forces, g; the plant's own where empty.
    order : int
        Nodes over a dwell; two are right to 1e-5 of a sigma up to half a minute, three beyond.
    """

    plant: Plant
    dwell: float
    levels: tuple[float, ...] = ()
    order: int = 0

    @cached_property
    def arrays(self) -> tuple[Array, Array, Array, Array]:
        """Return nodes (levels, q, 10), blend (levels, q, q), root (levels, 10, 10), omega."""
        plant = self.plant
        turns = plant.turns(self.dwell)
        order = self.order or (2 if self.dwell <= 30.0 else 3)
        at, weights = sum_nodes(turns, order)
        samples = round(plant.sampling * plant.period)
        root = np.linalg.cholesky(turn_products(samples, 1.0 / plant.sampling))
        blend = plant.period * node_integrals(at)
        levels = self.levels or (plant.force,)
        nodes = np.zeros((len(levels), len(at), 19))
        nodes[:, :, 0] = weights / (1e-6 * plant.noise) ** 2
        axis = plant.earth / EARTH_RATE
        cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        for q, x in enumerate(at):
            angle = EARTH_RATE * plant.period * (x + 0.5)
            turned = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
            for level, force in enumerate(levels):
                rotated = plant.harmonics(force) @ turned.T
                nodes[level, q, 1:10] = rotated.ravel()
                nodes[level, q, 10:] = np.cross(plant.earth, rotated).ravel()
        n = len(levels)
        return (
            nodes, np.repeat(blend[None], n, 0), np.repeat(root[None], n, 0),
            np.full(n, plant.omega),
        )  # fmt: skip

    @property
    def prior(self) -> float:
        """Information of an Euler angle at the start, 1/rad^2."""
        return 1.0 / self.plant.attitude_prior**2


def _angles(positions: ArrayLike) -> Array:
    """Return positions (p, 3) in rad from alpha, beta, gamma in deg, checked."""
    angles = np.atleast_2d(np.asarray(positions, dtype=np.float64))
    if angles.ndim != 2 or angles.shape[1] != 3 or not np.isfinite(angles).all():
        raise InputError(
            f"positions: expected rows of alpha, beta, gamma in deg, got shape {angles.shape}"
        )
    if np.any(np.abs(np.cos(angles[:, 1] * DEG)) < 0.05):
        raise InputError("positions: beta is too near 90 deg, where alpha and gamma are one turn")
    return np.ascontiguousarray(angles * DEG)


def _needs_still(plant: Plant) -> None:
    if not plant.is_still:
        raise InputError(
            "sums over positions hold for a platform that keeps its attitude: leave out the "
            "commanded rate, the servo error and the gyros' mounting angles"
        )


def position_matrices(
    tables: Tables, positions: ArrayLike, level: Sequence[int] | None = None
) -> Array:
    """Return what each position tells of the coefficients, (p, n, n), its attitude marginalised.

    Parameters
    ----------
    tables : Tables
    positions : (p, 3) array_like
        alpha, beta, gamma, deg.
    level : sequence of int, optional
        Which of the tables' levels of force each position has; the first where left out.

    Raises
    ------
    InputError
        For positions that are not numbers, or beta near 90 deg.
    """
    from schuler.kernels.centrifuge import many_positions

    angles = _angles(positions)
    _needs_still(tables.plant)
    which = np.zeros(len(angles), np.int64) if level is None else np.asarray(level, np.int64)
    plant = tables.plant
    out = np.zeros((len(angles), plant.unknowns, plant.unknowns))
    nodes, blend, root, omega = tables.arrays
    many_positions(
        angles, plant.order_number, which, nodes, blend, root, omega, plant.terms, tables.prior, out
    )
    return out


def scheme_information(
    plant: Plant, positions: ArrayLike, dwell: float, forces: Sequence[float] | None = None
) -> Array:
    """Return the information (n, n) of a scheme, in rad/s, g and rad.

    In closed form for a platform that keeps its attitude; with a commanded rate, a servo error or
    mounting angles of the gyros it is what the filter's covariance holds.

    Parameters
    ----------
    plant : Plant
    positions : (p, 3) array_like
        alpha, beta, gamma, deg.
    dwell : float
        s at each position, a whole number of turns of the arm.
    forces : sequence of float, optional
        Level of force at each position, g.

    Raises
    ------
    InputError
        For bad positions, dwells or forces.
    """
    rows = np.atleast_2d(np.asarray(positions, dtype=np.float64))
    if not plant.is_still:
        from schuler.centrifuge.filter import filter_information

        return filter_information(plant, rows, dwell, forces)
    if forces is None:
        return np.asarray(position_matrices(Tables(plant, dwell), rows).sum(axis=0))
    if len(forces) != len(rows) or not all(f > 0 for f in forces):
        raise InputError(f"forces: expected {len(rows)} positive numbers of g, got {list(forces)}")
    levels = tuple(sorted(set(map(float, forces))))
    which = [levels.index(float(f)) for f in forces]
    return np.asarray(position_matrices(Tables(plant, dwell, levels), rows, which).sum(axis=0))


def direct_information(
    plant: Plant, positions: ArrayLike, dwell: float, step: float = 0.005,
    forces: Sequence[float] | None = None,
) -> Array:  # fmt: skip
    """Return the same as `scheme_information`, added sample by sample: slow, and independent.

    Parameters
    ----------
    plant, positions, dwell, forces
        As there.
    step : float
        Of the integration, s; an output sample must be a whole number of them.
    """
    from schuler.kernels.centrifuge import direct_accumulation

    angles = _angles(positions)
    _needs_still(plant)
    every = round(1.0 / (plant.sampling * step))
    if every < 1 or abs(every * step * plant.sampling - 1.0) > 1e-9:
        raise InputError(f"an output sample must be a whole number of steps of {step:g} s")
    out = np.zeros((plant.unknowns, plant.unknowns))
    samples = plant.turns(dwell) * round(plant.period / step)
    for k, row in enumerate(angles):
        direct_accumulation(
            row, plant.order_number, plant.harmonics(None if forces is None else forces[k]),
            plant.omega, plant.earth, samples, step, every, plant.terms,
            (1e-6 * plant.noise) ** -2.0, plant.attitude_prior**-2.0, out,
        )  # fmt: skip
    return out
