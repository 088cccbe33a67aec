"""`Path`: where a navigation went, row by row, with its uncertainty where that was asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path as File
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._files import replacing
from schuler._notebook import Shown
from schuler.attitude import heading_sigma, psi_to_heading, quat_to_euler
from schuler.constants import ARCMIN, DEG
from schuler.earth import radii
from schuler.errors import InputError
from schuler.kernels.states import ErrorStates, LocalRow, PathRow

__all__ = ["Path"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Path(Shown):
    """A navigation's result: its start, then one row every so many updates.

    Parameters
    ----------
    rows : (n, 13) float64
        `PathRow` by `PathRow`, in the wander frame.
    variances : (n, 15) float64 or None
        `ErrorStates` by `ErrorStates`.
    covariance : (15, 15) float64 or None
        At the end.
    name : str
        Of the record.
    """

    rows: Array = field(repr=False)
    variances: Array | None = field(default=None, repr=False)
    covariance: Array | None = field(default=None, repr=False)
    name: str = "record"

    def __len__(self) -> int:
        return len(self.rows)

    @cached_property
    def _local(self) -> LocalRow:
        from schuler.kernels.strapdown import local

        out = LocalRow.zeros(len(self.rows))
        local(np.ascontiguousarray(self.rows), out.data)
        return out

    @property
    def time(self) -> Array:
        """Times, s, (n,)."""
        return PathRow(self.rows).time

    @property
    def quaternion(self) -> Array:
        """q_b^n with n = East-North-Up, (n, 4)."""
        return self._local.quat_nb

    @property
    def euler(self) -> Array:
        """(psi, theta, gamma), rad, (n, 3)."""
        return quat_to_euler(self.quaternion)

    @property
    def velocity(self) -> Array:
        """East, north, up, m/s, (n, 3)."""
        return self._local.v_n

    @property
    def position(self) -> Array:
        """Latitude, longitude (rad, in (-pi, pi]) and height (m), (n, 3)."""
        return np.column_stack([self._local.lat, self._local.lon, self._local.height])

    @property
    def wander(self) -> Array:
        """Angle from east to the wander frame's first axis, counter-clockwise, rad, (n,)."""
        return self._local.wander

    @property
    def final_covariance(self) -> Array | None:
        """Covariance of the error states at the end, in East-North-Up, (15, 15)."""
        if self.covariance is None:
            return None
        c, s = np.cos(self.wander[-1]), np.sin(self.wander[-1])
        turn = np.eye(ErrorStates.size)
        phi, velocity, position = (
            f.start for f in (ErrorStates.phi, ErrorStates.velocity, ErrorStates.position)
        )
        for k in (phi, velocity, position):
            turn[k : k + 2, k : k + 2] = [[c, -s], [s, c]]
        # North turns with the place: an error of position to the east is one of heading.
        lat, _, height = self.position[-1]
        slip = np.tan(lat) / (float(radii(lat)[1]) + height)
        slipped = np.eye(ErrorStates.size)
        slipped[phi + 2, position] += slip
        slipped[velocity, position] += slip * self.velocity[-1, 1]
        slipped[velocity + 1, position] -= slip * self.velocity[-1, 0]
        turn = slipped @ turn
        return np.asarray(turn @ self.covariance @ turn.T)

    @property
    def final(self) -> dict[str, Any]:
        """The last row in the units that people speak."""
        psi, theta, gamma = quat_to_euler(self.quaternion[-1])
        lat, lon, height = self.position[-1]
        return {
            "time_s": float(self.time[-1]),
            "lat_deg": float(lat / DEG),
            "lon_deg": float(lon / DEG),
            "height_m": float(height),
            "velocity_enu": [float(v) for v in self.velocity[-1]],
            "heading_deg": float(psi_to_heading(psi) / DEG),
            "pitch_deg": float(theta / DEG),
            "roll_deg": float(gamma / DEG),
        }

    @property
    def sigma(self) -> dict[str, Any] | None:
        """1 sigma at the end: position (east, north, up; m), velocity, phi and heading (arcmin)."""
        p = self.final_covariance
        if p is None:
            return None
        s = ErrorStates(np.sqrt(np.diag(p)))
        return {
            "position_enu_m": [float(v) for v in s.position],
            "velocity_enu": [float(v) for v in s.velocity],
            "phi_enu_arcmin": [float(v) / ARCMIN for v in s.phi],
            "heading_arcmin": heading_sigma(self.quaternion[-1], p[:3, :3]) / ARCMIN,
        }

    def write(self, path: str | File) -> None:
        """Save as Parquet, whole or not at all; the columns are those of a simulation's truth.

        Raises
        ------
        InputError
            For another suffix, or if the file cannot be written.
        """
        import pyarrow as pa

        from schuler.io.sealed import write_sealed

        path = File(path)
        if path.suffix.lower() != ".parquet":
            raise InputError(f"{path}: a path is written as Parquet; name a file in .parquet")
        psi, theta, gamma = self.euler.T
        lat, lon, height = self.position.T
        columns: dict[str, Array] = {
            "t [s]": self.time, "heading [deg]": psi_to_heading(psi) / DEG,
            "pitch [deg]": theta / DEG, "roll [deg]": gamma / DEG,
            **dict(zip(("qw", "qx", "qy", "qz"), self.quaternion.T, strict=True)),
            **dict(zip(
                ("v_east [m/s]", "v_north [m/s]", "v_up [m/s]"), self.velocity.T, strict=True
            )),
            "lat [deg]": lat / DEG, "lon [deg]": lon / DEG, "height [m]": height,
        }  # fmt: skip
        if self.variances is not None:
            # Level variances swap between the axes as the frame wanders: their sum does not.
            of = ErrorStates(self.variances)
            level = of.position[:, 0] + of.position[:, 1]
            columns["sigma_horizontal [m]"] = np.sqrt(level)
            tilt = 0.5 * (of.phi[:, 0] + of.phi[:, 1])
            steep = np.tan(np.clip(theta, -1.5706, 1.5706)) ** 2
            heading = np.sqrt(of.phi[:, 2] + steep * tilt)
            columns["sigma_heading [arcmin]"] = np.minimum(heading, np.pi / 3**0.5) / ARCMIN
        table = pa.table({k: pa.array(np.ascontiguousarray(v)) for k, v in columns.items()})
        with replacing(path) as part:
            write_sealed(table, part, {}, compression="zstd", use_dictionary=False)

    def __str__(self) -> str:
        f = self.final
        e, n, u = f["velocity_enu"]
        lines = [
            f"position  {f['lat_deg']:.8f} deg N, {f['lon_deg']:.8f} deg E, {f['height_m']:.3f} m",
            f"velocity  {e:.4f} m/s east, {n:.4f} north, {u:.4f} up",
            f"attitude  heading {f['heading_deg']:.5f} deg, pitch {f['pitch_deg']:.5f} deg, "
            f"roll {f['roll_deg']:.5f} deg",
        ]
        s = self.sigma
        if s is not None:
            (pe, pn, pu), (ve, vn, vu) = s["position_enu_m"], s["velocity_enu"]
            a, b, c = s["phi_enu_arcmin"]
            lines.append(
                f"sigma     {pe:.4g} m east, {pn:.4g} north, {pu:.4g} up; {ve:.3g}, {vn:.3g}, "
                f"{vu:.3g} m/s; phi {a:.3g}', {b:.3g}', {c:.3g}'"
            )
        return "\n".join(lines)
