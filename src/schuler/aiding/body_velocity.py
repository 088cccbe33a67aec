"""`BodyVelocity`: velocity over ground along the axes of a Doppler log (DVL)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.aiding.rows import checked_lever, checked_rows
from schuler.errors import InputError

__all__ = ["FRAMES", "BodyVelocity"]

Array = NDArray[np.float64]

FRAMES = {
    "RFU": np.eye(3),
    "FRD": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
    "FLU": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
}
"""Where a sensor's x, y, z point -> what turns its components into right, forward, up."""

PARTS = ("scale", "mount", "lever")
_NO_VALUE = -32.768
"""What Doppler logs write where they have none, m/s: the least number of 16 bits, in mm/s."""


@dataclass(frozen=True, eq=False)
class BodyVelocity:
    """Velocity over ground along a sensor's axes.

    Rows that cannot be used are left out and counted in `dropped`. The sensor measures
    ``(1 + scale) R (C v + w x lever)``: the velocity of its point in body axes, turned by its
    mounting.

    Parameters
    ----------
    time : (n,) array_like
        On the record's clock, s.
    velocity : (n, 3) array_like
        Along x, y, z of `frame`, m/s. The object has them right, forward, up.
    sigma : float or (n, 3) array_like
        1-sigma, m/s; in the same frame.
    frame : {"RFU", "FRD", "FLU"}
        Where x, y and z point; "RFU" once the object is made.
    valid : (n,) array_like, optional
        Zero where the instrument calls its value none (a bottom that was lost).
    scale, scale_sigma : float
        Scale factor, and its 1-sigma before anything is measured.
    mount, mount_sigma : (3,) array_like, float
        Rotation vector R from right, forward, up of the body to those of the sensor, rad, and its
        1-sigma about each axis.
    lever : (3,) array_like
        From the IMU to the sensor, body axes, m.
    estimate : tuple of str
        Which of "scale", "mount" and "lever" are estimated.
    name : str
    dropped : mapping of str to int
        Rows that were left out, by reason.
    clock : str
        What the times count, of `schuler.aiding.CLOCKS`.

    Raises
    ------
    InputError
        For arrays of other shapes, an unknown frame, or no usable row.

    Examples
    --------
    >>> found = BodyVelocity([0.0, 1.0], [[2.0, 0.1, 0.0], [2.0, 0.0, 0.5]], frame="FRD")
    >>> found.velocity.tolist()
    [[0.1, 2.0, 0.0], [0.0, 2.0, -0.5]]
    """

    time: ArrayLike
    velocity: ArrayLike
    sigma: ArrayLike = 0.02
    frame: str = "RFU"
    valid: ArrayLike | None = None
    scale: float = 0.0
    scale_sigma: float = 0.01
    mount: ArrayLike = (0.0, 0.0, 0.0)
    mount_sigma: float = 0.05
    lever: ArrayLike = (0.0, 0.0, 0.0)
    estimate: tuple[str, ...] = ()
    name: str = "dvl"
    dropped: Mapping[str, int] = field(default_factory=dict)
    clock: str = "unstated"

    def __post_init__(self) -> None:
        if self.frame not in FRAMES:
            raise InputError(
                f"{self.name}: frame must be one of {', '.join(FRAMES)}, got '{self.frame}'"
            )
        unknown = set(self.estimate) - set(PARTS)
        if unknown:
            raise InputError(f"{self.name}: cannot estimate {min(unknown)}; say {', '.join(PARTS)}")
        mount = np.asarray(self.mount, np.float64)
        if mount.shape != (3,) or not np.linalg.norm(mount) <= np.pi:
            raise InputError(
                f"{self.name}: a mounting is a rotation vector of at most half a turn in rad, got "
                f"{self.mount}"
            )
        if not (abs(self.scale) < 0.5 and self.scale_sigma > 0.0 and self.mount_sigma > 0.0):
            raise InputError(
                f"{self.name}: a scale factor is below 0.5 and sigma are positive, got "
                f"{self.scale}, {self.scale_sigma} and {self.mount_sigma}"
            )
        velocity = np.asarray(self.velocity, np.float64)
        valid = None if self.valid is None else np.asarray(self.valid, np.float64)
        if valid is not None and valid.shape != (len(velocity),):
            raise InputError(
                f"{self.name}: valid must be of shape ({len(velocity)},), got {valid.shape}"
            )
        if velocity.ndim == 2:
            with np.errstate(invalid="ignore"):
                there = np.all(np.abs(velocity - _NO_VALUE) > 1e-6, axis=1)
            valid = there.astype(np.float64) if valid is None else np.where(there, valid, 0.0)
        time, columns, sigma, dropped = checked_rows(
            self.name, self.time, {"velocity": velocity}, self.sigma, 3, self.dropped, valid
        )
        turn = FRAMES[self.frame]
        for key, value in (
            ("time", time), ("velocity", columns["velocity"] @ turn.T),
            ("sigma", sigma @ np.abs(turn).T), ("frame", "RFU"), ("valid", None), ("mount", mount),
            ("lever", checked_lever(self.lever, self.name)), ("dropped", dropped),
        ):  # fmt: skip
            object.__setattr__(self, key, value)

    def __len__(self) -> int:
        return len(np.asarray(self.time))
