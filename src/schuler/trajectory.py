"""`Trajectory`: where a vehicle was, how fast and how turned, over time.

The truth of a simulation, a reference file, a navigation's result and a master's navigation are all
this type. `schuler.io.read_trajectory` and `write_trajectory` are its reader and writer.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._result import Result
from schuler.attitude import heading_sigma, psi_to_heading, quat_to_euler
from schuler.constants import ARCMIN, DEG
from schuler.errors import InputError
from schuler.kernels.states import ErrorStates

__all__ = ["Trajectory"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Trajectory(Result):
    """Position over time, and where they are known velocity, attitude and their covariance.

    Parameters
    ----------
    time : (n,) float64
        s, increasing.
    lat, lon, height : (n,) float64
        rad, rad in (-pi, pi], m above the ellipsoid.
    v_n : (n, 3) float64 or None
        East, north, up, m/s.
    quat_nb : (n, 4) float64 or None
        Body to East-North-Up.
    variances : (n, 15) float64 or None
        Of the error states (`schuler.kernels.states.ErrorStates`) at each row; east and north are
        those of the frame that was navigated in.
    covariance : (15, 15) float64 or None
        Of the error states at the end, in East-North-Up.
    name : str

    Raises
    ------
    InputError
        For arrays of other shapes.

    Examples
    --------
    >>> path = made.truth
    >>> len(path.time) == len(record) + 1
    True
    """

    time: Array = field(repr=False)
    lat: Array = field(repr=False)
    lon: Array = field(repr=False)
    height: Array = field(repr=False)
    v_n: Array | None = field(default=None, repr=False)
    quat_nb: Array | None = field(default=None, repr=False)
    variances: Array | None = field(default=None, repr=False)
    covariance: Array | None = field(default=None, repr=False)
    name: str = "trajectory"

    def __post_init__(self) -> None:
        n = len(self.time)
        for name, shape in (
            ("time", (n,)), ("lat", (n,)), ("lon", (n,)), ("height", (n,)), ("v_n", (n, 3)),
            ("quat_nb", (n, 4)), ("variances", (n, ErrorStates.size)),
            ("covariance", (ErrorStates.size, ErrorStates.size)),
        ):  # fmt: skip
            value = getattr(self, name)
            if value is not None and np.shape(value) != shape:
                raise InputError(
                    f"a trajectory of {n} rows needs {name} of shape {shape}, got {np.shape(value)}"
                )

    def __len__(self) -> int:
        return len(self.time)

    def rows(self, which: slice | NDArray[np.int64]) -> Trajectory:
        """Return some of the rows; the covariance is that of the end, and goes."""

        def cut(value: Array | None) -> Array | None:
            return None if value is None else value[which]

        return replace(
            self, time=self.time[which], lat=self.lat[which], lon=self.lon[which],
            height=self.height[which], v_n=cut(self.v_n), quat_nb=cut(self.quat_nb),
            variances=cut(self.variances), covariance=None,
        )  # fmt: skip

    def joined(self, after: Trajectory, covariance: Array | None = None) -> Trajectory:
        """Return these rows and others after them, which know the same; the covariance is new.

        Examples
        --------
        >>> len(driven.rows(slice(0, 10)).joined(driven.rows(slice(10, 30))))
        30
        """

        def both(one: Array | None, other: Array | None) -> Array | None:
            return None if one is None or other is None else np.concatenate([one, other])

        return replace(
            self,
            time=np.concatenate([self.time, after.time]),
            lat=np.concatenate([self.lat, after.lat]),
            lon=np.concatenate([self.lon, after.lon]),
            height=np.concatenate([self.height, after.height]),
            v_n=both(self.v_n, after.v_n),
            quat_nb=both(self.quat_nb, after.quat_nb),
            variances=both(self.variances, after.variances),
            covariance=covariance,
        )

    @cached_property
    def position(self) -> Array:
        """Latitude, longitude (rad) and height (m), (n, 3)."""
        return np.column_stack([self.lat, self.lon, self.height])

    def known(self, name: str) -> Array:
        """Return ``"v_n"``, ``"quat_nb"`` or ``"variances"``, where there must be one.

        Raises
        ------
        InputError
            If the trajectory has none.

        Examples
        --------
        >>> driven.known("v_n").shape
        (1201, 3)
        """
        value: Array | None = getattr(self, name)
        if value is None:
            what = {"v_n": "velocity", "quat_nb": "attitude", "variances": "variances"}[name]
            raise InputError(f"the trajectory '{self.name}' has no {what}")
        return value

    @property
    def euler(self) -> Array:
        """(psi, theta, gamma), rad, (n, 3)."""
        return quat_to_euler(self.known("quat_nb"))

    @property
    def final(self) -> dict[str, Any]:
        """The last row in customary units; None for what is not known."""
        out: dict[str, Any] = {
            "time_s": float(self.time[-1]),
            "lat_deg": float(self.lat[-1] / DEG),
            "lon_deg": float(self.lon[-1] / DEG),
            "height_m": float(self.height[-1]),
            "velocity_enu": None if self.v_n is None else [float(v) for v in self.v_n[-1]],
            **dict.fromkeys(("heading_deg", "pitch_deg", "roll_deg")),
        }
        if self.quat_nb is not None:
            psi, theta, gamma = quat_to_euler(self.quat_nb[-1])
            out["heading_deg"] = float(psi_to_heading(psi) / DEG)
            out["pitch_deg"], out["roll_deg"] = float(theta / DEG), float(gamma / DEG)
        return out

    @property
    def sigma(self) -> dict[str, Any] | None:
        """1 sigma at the end: position (east, north, up; m), velocity, phi and heading (arcmin)."""
        p = self.covariance
        if p is None:
            return None
        s = ErrorStates(np.sqrt(np.diag(p)))
        return {
            "position_enu_m": [float(v) for v in s.position],
            "velocity_enu": [float(v) for v in s.velocity],
            "phi_enu_arcmin": [float(v) / ARCMIN for v in s.phi],
            "heading_arcmin": heading_sigma(self.known("quat_nb")[-1], p[:3, :3]) / ARCMIN,
        }

    def columns(self) -> dict[str, Array]:
        """Return the columns of a table, named with their units; angles in deg."""
        out: dict[str, Any] = {"t [s]": self.time}
        psi = theta = None
        if self.quat_nb is not None:
            psi, theta, gamma = self.euler.T
            out |= {
                "heading [deg]": psi_to_heading(psi) / DEG, "pitch [deg]": theta / DEG,
                "roll [deg]": gamma / DEG,
                **dict(zip(("qw", "qx", "qy", "qz"), self.quat_nb.T, strict=True)),
            }  # fmt: skip
        if self.v_n is not None:
            names = ("v_east [m/s]", "v_north [m/s]", "v_up [m/s]")
            out |= dict(zip(names, self.v_n.T, strict=True))
        out |= {
            "lat [deg]": self.lat / DEG, "lon [deg]": self.lon / DEG, "height [m]": self.height
        }  # fmt: skip
        if self.variances is not None:
            of = ErrorStates(self.variances)
            # Horizontal variances swap between the axes as the frame wanders: their sum does not.
            out["sigma_horizontal [m]"] = np.sqrt(of.position[:, 0] + of.position[:, 1])
            if theta is not None:
                tilt = 0.5 * (of.phi[:, 0] + of.phi[:, 1])
                steep = np.tan(np.clip(theta, -1.5706, 1.5706)) ** 2
                heading = np.sqrt(of.phi[:, 2] + steep * tilt)
                out["sigma_heading [arcmin]"] = np.minimum(heading, np.pi / 3**0.5) / ARCMIN
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return the name, the number of rows, both ends, and 1 sigma at the last."""
        return {
            "name": self.name, "rows": len(self), "start": self.rows(slice(0, 1)).final,
            "final": self.final, "sigma": self.sigma,
        }  # fmt: skip

    def __str__(self) -> str:
        f = self.final
        lines = [
            f"position  {f['lat_deg']:.8f} deg N, {f['lon_deg']:.8f} deg E, {f['height_m']:.3f} m"
        ]
        if f["velocity_enu"] is not None:
            e, n, u = f["velocity_enu"]
            lines.append(f"velocity  {e:.4f} m/s east, {n:.4f} north, {u:.4f} up")
        if f["heading_deg"] is not None:
            lines.append(
                f"attitude  heading {f['heading_deg']:.5f} deg, pitch {f['pitch_deg']:.5f} deg, "
                f"roll {f['roll_deg']:.5f} deg"
            )
        s = self.sigma
        if s is not None:
            (pe, pn, pu), (ve, vn, vu) = s["position_enu_m"], s["velocity_enu"]
            a, b, c = s["phi_enu_arcmin"]
            lines.append(
                f"sigma     {pe:.4g} m east, {pn:.4g} north, {pu:.4g} up; {ve:.3g}, {vn:.3g}, "
                f"{vu:.3g} m/s; phi {a:.3g}', {b:.3g}', {c:.3g}'"
            )
        return "\n".join(lines)
