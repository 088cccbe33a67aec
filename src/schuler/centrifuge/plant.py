"""A stabilised platform on a counter-rotating centrifuge: the plant.

Source: Xu and Zhang (2017), Journal of National University of Defense Technology 39(1), 46-50.
Its force in the base frame (eq. 10) prints gravity's part downwards beside a centripetal force
inwards; `Plant.printed_gravity` takes it so. Its text prints two orders of the gimbals: eq. 7 and
the kinematics of eq. 15 are y, z, x; eq. 14 holds for z, y, x. Both are options.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.constants import ARCSEC, DEG, DEG_PER_HOUR, EARTH_RATE
from schuler.errors import InputError

__all__ = ["ORDERS", "PUBLISHED_POSITIONS", "Plant"]

Array = NDArray[np.float64]

#: orders of the gimbals, as the kernels number them
ORDERS = ("zyx", "yzx")

#: the published scheme: alpha, beta, gamma, deg
PUBLISHED_POSITIONS: tuple[tuple[float, float, float], ...] = (
    (45, 0, 167), (350, 0, 325), (209, 0, 182), (134, 0, 141), (106, 0, 338), (142, 0, 269),
)  # fmt: skip


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

    Examples
    --------
    >>> plant = Plant(force=10.0)
    >>> plant.unknowns, plant.turns(20.0)
    (45, 10)
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
