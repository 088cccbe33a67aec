"""`TransferAlignment`: what a slave learnt of itself from its master."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.method import Estimate, Method, Problem
from schuler.alignment.moving.result import MovingAlignment
from schuler.alignment.transfer.free import FreeRun
from schuler.attitude import psi_to_heading, quat_to_euler
from schuler.constants import DEG
from schuler.errors import InputError

__all__ = ["ByMaster", "TransferAlignment"]

Array = NDArray[np.float64]

_AXES = ("right", "forward", "up")


@dataclass(frozen=True)
class ByMaster(Method):
    """What a `TransferAlignment` was made with: it needs more than a record.

    Parameters
    ----------
    match : str
        What was matched, as ``velocity+attitude``.
    vibration : float
        Velocity random walk beside the specification's, m/s/sqrt(s).

    Examples
    --------
    >>> ByMaster("velocity+attitude", vibration=0.01)
    ByMaster(prefilter=None, match='velocity+attitude', vibration=0.01)
    """

    match: str = "velocity+attitude"
    vibration: float = 0.0

    def solve(self, problem: Problem) -> Estimate:
        """See `Method.solve`.

        Raises
        ------
        InputError
            Always: a transfer alignment needs a master.
        """
        raise InputError("a transfer alignment needs a master: say schuler.transfer(record, ...)")

    def to_table(self) -> dict[str, Any]:
        """Return name and options."""
        return {"name": "transfer", "options": {"match": self.match, "vibration": self.vibration}}

    def __str__(self) -> str:
        return f"transfer alignment by {self.match.replace('+', ' and ')}"


@dataclass(frozen=True, eq=False)
class TransferAlignment(MovingAlignment):
    """A transfer alignment; what a `MovingAlignment` has, and how the slave is mounted.

    Parameters
    ----------
    mounting : (4,) float64
        Quaternion M from the slave's body to the master's, C_slave = C_master M.
    mounting_covariance : (3, 3) float64
        Of the rotation by which it is wrong, M (I + [dm x]), the slave's axes, rad^2; zero where
        it was given.
    lever, lever_sigma : (3,) float64
        From the slave to the master, the slave's axes, m.
    delay : (float, float)
        A row of the master stamped t is valid at t - delay; with its 1-sigma, s.
    remaining : dict of str to float
        What is left of each state's 1-sigma: sqrt(P / P0).
    not_observable : tuple of str
        States that the span did not show: more than half of that is left, or more than half a
        degree, half a metre or 10 ms of what nothing was known of.
    free : FreeRun or None
        What the slave did by itself afterwards.
    """

    mounting: Array = field(kw_only=True)
    mounting_covariance: Array = field(kw_only=True, repr=False)
    lever: Array = field(kw_only=True)
    lever_sigma: Array = field(kw_only=True, repr=False)
    delay: tuple[float, float] = field(kw_only=True)
    remaining: dict[str, float] = field(kw_only=True, repr=False)
    not_observable: tuple[str, ...] = field(kw_only=True)
    free: FreeRun | None = field(kw_only=True, default=None, repr=False)

    @property
    def mounting_deg(self) -> tuple[float, float, float]:
        """Yaw (clockwise), pitch and roll of the slave on the master, deg."""
        psi, theta, gamma = (float(x) for x in quat_to_euler(self.mounting))
        yaw = (float(psi_to_heading(psi)) / DEG + 180.0) % 360.0 - 180.0
        return yaw, theta / DEG, gamma / DEG

    @property
    def mounting_sigma(self) -> Array:
        """1-sigma of the mounting about the slave's axes right, forward, up, rad, (3,)."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.mounting_covariance), 0.0)))

    def to_dict(self) -> dict[str, Any]:
        """Return the keys of an alignment in motion, and ``"transfer"``."""
        out = super().to_dict()
        out["transfer"] = {
            "mounting_deg": list(self.mounting_deg),
            "mounting_sigma_deg": (self.mounting_sigma / DEG).tolist(),
            "lever_m": self.lever.tolist(), "lever_sigma_m": self.lever_sigma.tolist(),
            "delay_s": list(self.delay), "remaining": self.remaining,
            "not_observable": list(self.not_observable),
            "free": None if self.free is None else self.free.to_dict(),
        }  # fmt: skip
        return out

    def estimate_rows(self) -> list[tuple[str, str]]:
        """Return names and values with 1-sigma of what was found of the mounting, in words."""
        yaw, pitch, roll = self.mounting_deg
        s = self.mounting_sigma / DEG
        arm = ", ".join(f"{v:.3f} ± {e:.2g}" for v, e in zip(self.lever, self.lever_sigma,
                                                             strict=True))  # fmt: skip
        out = [
            ("mounting", f"yaw {yaw:.4f}, pitch {pitch:.4f}, roll {roll:.4f} deg "
             f"(± {s[0]:.2g}, {s[1]:.2g}, {s[2]:.2g} deg about right, forward, up)"),
            ("lever arm to the master", f"{arm} m"),
            ("delay of the master", f"{1e3 * self.delay[0]:.2f} ± {1e3 * self.delay[1]:.2g} ms"),
        ]  # fmt: skip
        if self.not_observable:
            out.append(("not observable:", ", ".join(self.not_observable)))
        if self.free is not None:
            told = str(self.free)
            out.append((told.partition(":")[0] + ":", told.partition(": ")[2]))
        return out


def state_names(group: str, size: int) -> list[str]:
    """Return what a person calls the states of a group, or nothing for those of no interest."""
    if group == "phi":
        return ["tilt about east", "tilt about north", "heading"]
    if group == "transfer.delay":
        return ["delay"]
    told = {
        "transfer.mounting": "mounting about", "transfer.lever": "lever arm",
        "gyro_bias": "gyro bias", "accelerometer_bias": "accelerometer bias",
    }.get(group)  # fmt: skip
    return [] if told is None else [f"{told} {axis}" for axis in _AXES[:size]]
