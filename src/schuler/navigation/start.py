"""`Start`: where, how fast and how turned a navigation begins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.attitude import euler_to_quat, heading_to_psi
from schuler.constants import DEG
from schuler.earth import Site
from schuler.errors import InputError
from schuler.ins.frames import frame_quaternion
from schuler.kernels.states import (
    StrapdownState,
)

__all__ = ["Fix", "MovingFix", "Start"]

Array = NDArray[np.float64]


class Fix(Protocol):
    """What a start needs of an alignment."""

    @property
    def quat_nb(self) -> Array:
        """quat_nb, (4,)."""

    @property
    def covariance(self) -> Array:
        """Of phi, rad^2, (3, 3)."""

    @property
    def budget(self) -> dict[str, Array]:
        """Its parts by source."""


@runtime_checkable
class MovingFix(Protocol):
    """What a start needs of an alignment in motion."""

    @property
    def site(self) -> Site:
        """Where the vehicle was."""

    @property
    def quat_nb(self) -> Array:
        """quat_nb, (4,)."""

    @property
    def v_n(self) -> Array:
        """East, north, up, m/s, (3,)."""

    @property
    def start_covariance(self) -> Array:
        """Of phi, velocity and position, (9, 9)."""


@dataclass(frozen=True, eq=False)
class Start:
    """Where, how fast and how turned a navigation begins.

    Parameters
    ----------
    site : Site
    quat_nb : (4,) array_like
        Body to East-North-Up.
    v_n : (3,) array_like
        East, north, up, m/s.
    covariance : (9, 9) array_like, optional
        Of phi (rad), velocity (m/s) and position (m), in ENU; zero when not given.

    Examples
    --------
    >>> start = sc.Start.from_angles(site, heading=90.0, velocity=(10.0, 0.0, 0.0))
    >>> start.v_n
    (10.0, 0.0, 0.0)
    """

    site: Site
    quat_nb: ArrayLike
    v_n: ArrayLike = (0.0, 0.0, 0.0)
    covariance: ArrayLike | None = None

    @classmethod
    def from_angles(
        cls,
        site: Site,
        heading: float,
        pitch: float = 0.0,
        roll: float = 0.0,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> Start:
        """Make a start from heading (clockwise from north), pitch and roll, deg."""
        psi = float(heading_to_psi(heading * DEG))
        return cls(site, euler_to_quat([psi, pitch * DEG, roll * DEG]), velocity)

    @classmethod
    def from_alignment(
        cls, site: Site | MovingFix, fix: Fix | None = None, velocity: ArrayLike = (0.0, 0.0, 0.0)
    ) -> Start:
        """Make a start from an alignment's attitude and covariance.

        Parameters
        ----------
        site : Site or MovingAlignment
            Where the vehicle stands; an alignment in motion alone knows place and velocity.
        fix : Alignment, optional
            At rest; an alignment in motion gives its velocity, too.
        velocity : (3,) array_like
            East, north, up, m/s, beside an alignment at rest.

        Raises
        ------
        InputError
            If place or alignment is missing.

        Examples
        --------
        >>> start = sc.Start.from_alignment(site, sc.align(record, site, spec=spec))
        >>> start.covariance.shape
        (9, 9)
        """
        if isinstance(site, MovingFix):
            return cls(site.site, site.quat_nb, site.v_n, site.start_covariance)
        if isinstance(fix, MovingFix):
            return cls(site, fix.quat_nb, fix.v_n, fix.start_covariance)
        if fix is None or not isinstance(site, Site):
            raise InputError(
                "a start from an alignment at rest needs its place, too: say "
                "Start.from_alignment(site, fix)"
            )
        cov = np.zeros((9, 9))
        # Deflection tilts the attitude and the force alike: no velocity comes of it.
        known = fix.budget.get("gravity", np.zeros((3, 3)))
        cov[:3, :3] = fix.covariance - known
        return cls(site, fix.quat_nb, velocity, cov)

    def state(self) -> StrapdownState:
        """Return the kernel's state at the start.

        Raises
        ------
        InputError
            For a quaternion or velocity of another shape, or not finite.

        Examples
        --------
        >>> float(sc.Start.from_alignment(site, fix).state().height)
        500.0
        """
        q, v = np.asarray(self.quat_nb, np.float64), np.asarray(self.v_n, np.float64)
        if q.shape != (4,) or not abs(np.linalg.norm(q) - 1.0) < 1e-6:
            raise InputError("a start needs a unit quaternion of four numbers")
        if v.shape != (3,) or not np.all(np.isfinite(v)):
            raise InputError("a start needs three finite velocities: east, north, up")
        state = StrapdownState.zeros()
        state.quat_nb = q / np.linalg.norm(q)
        state.v_n = v
        state.quat_en = frame_quaternion(self.site.latitude, self.site.longitude)
        state.height = self.site.height
        return state
