"""What every motion gives: a chain of turning frames and a path, with their derivatives.

The body hangs on a chain of frames. The first turns against ENU by Euler angles (psi, theta,
gamma) about a centre that moves along a path; each further one turns against the one before about
a centre that a lever arm carries. A vehicle is one frame; a turntable on a ship is two.

Motions are analytic: value, rate and acceleration of every channel come from formulas. Between
the times at which they are asked the simulator takes the quintic through all three.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import euler_to_quat, multiply
from schuler.errors import InputError

__all__ = ["Carried", "Motion", "Sum", "Track", "angles_track"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Track:
    """A motion at n times.

    Parameters
    ----------
    path : (n, 3, 3) float64
        East, north and up way from the site (component), with first and second derivative (last
        axis): m, m/s, m/s^2. On a curved Earth the way is the integral of the velocity.
    angles : (n, k, 3, 3) float64
        psi, theta, gamma of each of k frames against the one before, with derivatives; rad.
    levers : (k, 3) float64
        From the centre of each frame to the centre of the next (the last: to the IMU), in that
        frame, m.

    Examples
    --------
    >>> from schuler.motion import Static
    >>> Static(30.0).track(np.array([0.0])).quat_nb.round(3).tolist()
    [[0.966, 0.0, 0.0, -0.259]]
    """

    path: Array
    angles: Array
    levers: Array

    @property
    def quat_nb(self) -> Array:
        """quat_nb (n, 4)."""
        q = euler_to_quat(self.angles[:, 0, :, 0])
        for k in range(1, self.angles.shape[1]):
            q = multiply(q, euler_to_quat(self.angles[:, k, :, 0]))
        return q


class Motion(Protocol):
    """A motion about a site.

    Examples
    --------
    >>> class Nodding:
    ...     def track(self, t):
    ...         angles = np.zeros((len(t), 3, 3))
    ...         s, c = 0.1 * np.sin(t), 0.1 * np.cos(t)
    ...         angles[:, 1] = np.column_stack([s, c, -s])
    ...         return angles_track(angles)
    >>> len(sc.simulate(Nodding(), site, 10.0, 20.0).record)
    200
    """

    def track(self, t: Array) -> Track:
        """Return the motion at times t (n,), s since its start."""
        ...


def angles_track(angles: Array, lever: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Track:
    """Return the track of one frame that turns about a centre at rest, from (n, 3, 3) angles."""
    n = len(angles)
    return Track(np.zeros((n, 3, 3)), angles[:, None], np.array([lever], np.float64))


@dataclass(frozen=True)
class Sum:
    """Motions of the same chain that add: a route with sway on it.

    Ways add, and so do the Euler angles frame by frame, each with its derivatives.

    Examples
    --------
    >>> from schuler.motion import Lines, Static, Sway
    >>> one = np.array([0.5])
    >>> sway = Sway(lines=(Lines("pitch", one, one, one),))
    >>> Sum((Static(30.0), sway)).track(np.array([0.0, 0.5])).quat_nb.shape
    (2, 4)
    """

    parts: tuple[Motion, ...]

    def track(self, t: Array) -> Track:
        """Return the sum at times t (n,), s."""
        tracks = [part.track(t) for part in self.parts]
        if len({x.angles.shape[1] for x in tracks}) != 1:
            raise InputError("motions that add must have the same number of turning frames")
        return Track(
            np.sum([x.path for x in tracks], axis=0),
            np.sum([x.angles for x in tracks], axis=0),
            np.sum([x.levers for x in tracks], axis=0),
        )


@dataclass(frozen=True)
class Carried:
    """A motion on board another: a turntable on a ship, at a lever arm (m, carrier's frame).

    Examples
    --------
    >>> from schuler.motion import Dwell, Static, Turn, Turntable
    >>> table = Turntable([Dwell(10.0), Turn("psi", 90.0)])
    >>> Carried(Static(30.0), table).track(np.array([0.0, 30.0])).quat_nb.shape
    (2, 4)
    """

    carrier: Motion
    motion: Motion
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def track(self, t: Array) -> Track:
        """Return the chain of both at times t (n,), s."""
        outer, inner = self.carrier.track(t), self.motion.track(t)
        if np.any(inner.path):
            raise InputError(
                "a motion on board may turn but not travel: give its way to the carrier"
            )
        levers = outer.levers.copy()
        levers[-1] += self.lever
        return Track(
            outer.path,
            np.concatenate([outer.angles, inner.angles], axis=1),
            np.concatenate([levers, inner.levers]),
        )
