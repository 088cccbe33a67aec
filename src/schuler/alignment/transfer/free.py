"""Free navigation of a slave after its alignment, compared with its master."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.moving.setup import Nominal, layout_of, process_noise
from schuler.alignment.transfer.master import state_at
from schuler.attitude import multiply, quat_to_matrix, quat_to_rotvec, rotvec_to_quat
from schuler.constants import ARCMIN, STAMP_ROUNDING
from schuler.earth import moved, radii
from schuler.errors import InputError
from schuler.ins import ErrorStateFilter, OutputEpoch
from schuler.ins.frames import east_angle, to_east_north_up
from schuler.record import ImuRecord
from schuler.trajectory import Trajectory
from schuler.units import time_text

if TYPE_CHECKING:
    from schuler.alignment.transfer.result import TransferAlignment

__all__ = ["FreeRun", "free_run"]

Array = NDArray[np.float64]

_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


@dataclass(frozen=True, eq=False)
class FreeRun:
    """The slave's free navigation less the master's, by what was found of both.

    Parameters
    ----------
    time : (n,) float64
        s; rows of the master.
    attitude : (n, 3) float64
        phi of the slave's attitude, east, north, up, rad; what the mounting bends is in it.
    velocity, position : (n, 3) float64
        East, north, up, m/s and m; the position since the slave was let go.
    begin : float
        When that was, s.
    """

    time: Array
    attitude: Array
    velocity: Array
    position: Array
    begin: float

    @property
    def seconds(self) -> float:
        """Length, s."""
        return float(self.time[-1] - self.begin)

    def to_dict(self) -> dict[str, Any]:
        """Return the differences at the end, east, north, up."""
        return {
            "seconds": self.seconds, "velocity_m_s": self.velocity[-1].tolist(),
            "position_m": self.position[-1].tolist(),
            "attitude_arcmin": (self.attitude[-1] / ARCMIN).tolist(),
        }  # fmt: skip

    def __str__(self) -> str:
        v, r = np.linalg.norm(self.velocity[-1]), np.linalg.norm(self.position[-1])
        east, north, up = self.attitude[-1] / ARCMIN
        return (
            f"free for {self.seconds:.3g} s: {v:.3g} m/s and {r:.3g} m from the master, attitude "
            f"{east:.2f}', {north:.2f}', {up:.2f}' about east, north, up"
        )


def free_run(
    fix: TransferAlignment, record: ImuRecord, master: Trajectory, seconds: float
) -> FreeRun:
    """Navigate on without the master, and compare.

    Parameters
    ----------
    fix : TransferAlignment
        At the end of its span.
    record : ImuRecord
        That goes on after it.
    master : Trajectory
        That goes on as well.
    seconds : float
        How long.

    Raises
    ------
    InputError
        If record or master end before, or the result is that of the start of its span.

    Examples
    --------
    >>> found = sc.transfer(drive, driven, spec=spec, span=(0.0, 40.0))
    >>> free = free_run(found, drive, driven, seconds=10.0)
    >>> bool(np.abs(free.position[-1]).max() < 1.0)
    True
    """
    if fix.at != "end":
        raise InputError("a slave is let go at the end of its alignment: say at='end'")
    delay = fix.delay[0]
    begin, end = fix.end, fix.end + seconds
    due = master.time - delay
    last = min(record.end, float(due[-1]))
    if not seconds > 0.0 or end > last + 1e-6:
        raise InputError(
            f"to navigate free for {seconds:g} s record and master must go on to t = "
            f"{time_text(end)} s; "
            f"both have data to t = {time_text(last)} s: end the alignment earlier (span, --to)"
        )
    rest = record.between(begin, end)
    rows = np.flatnonzero(
        (due > begin + STAMP_ROUNDING) & (due <= min(end, rest.end) + STAMP_ROUNDING)
    )
    if not len(rows):
        raise InputError(f"{master.name}: no row of the master lies in the {seconds:g} s after it")
    state = fix.state
    lever, mounting = fix.lever, fix.mounting
    place = state_at(master, np.array([begin + delay]))
    arm = quat_to_matrix(state.quat_nb) @ lever
    there = moved(place.lat, place.lon, place.height, -arm[None])
    lat, lon, height = (float(x[0]) for x in there)
    nominal = Nominal(lat, lon, height, state.quat_nb, state.v_n, {})
    assert fix.spec is not None
    layout = layout_of(fix.spec, [])
    parameters = {name: state.parameters[name] for name in layout if name in state.parameters}
    flt = ErrorStateFilter(
        layout, nominal.site, nominal.quat_nb, 1e-12 * np.eye(layout.size),
        process_noise(layout, fix.spec, 0.0, seconds), [OutputEpoch(due[rows])], v_n=nominal.v_n,
        parameters=parameters, feedback=False,
    )  # fmt: skip
    flt.update(rest)
    gone = flt.history()
    rates = np.column_stack(
        [np.interp(due[rows], rest.time - 0.5 * rest.dt, c) for c in (rest.dtheta.T / rest.dt)]
    )
    return _beside(
        gone.quat_nb, gone.v_n, gone.quat_ne, gone.height, rates - state.parameters["gyro_bias"],
        master.rows(rows), lever, mounting, due[rows], begin,
    )  # fmt: skip


def _beside(
    quat: Array, v: Array, quat_ne: Array, height: Array, rate: Array, master: Trajectory,
    lever: Array, mounting: Array, time: Array, begin: float,
) -> FreeRun:  # fmt: skip
    lat, lon, angle = east_angle(quat_ne)
    zero = np.zeros(len(angle))
    north_up = rotvec_to_quat(np.column_stack([zero, zero, -angle]))
    quat = np.asarray(multiply(north_up, quat))
    v = np.stack([to_east_north_up(float(a)) @ each for a, each in zip(angle, v, strict=True)])
    mat = quat_to_matrix(quat)
    arm = mat @ lever
    # The Earth's rate turns a lever of metres by nothing that counts.
    v = v + np.einsum("iab,ib->ia", mat, np.cross(rate, lever))
    meridian, transverse = radii(master.lat)
    position = np.column_stack([
        (lon - master.lon + np.pi) % (2.0 * np.pi) - np.pi, lat - master.lat,
        height - master.height,
    ]) * np.column_stack([
        (transverse + master.height) * np.cos(master.lat), meridian + master.height,
        np.ones(len(lat)),
    ])  # fmt: skip
    other = np.asarray(multiply(master.known("quat_nb"), mounting))
    phi = -quat_to_rotvec(multiply(quat, other * _CONJUGATE))
    return FreeRun(time, phi, v - master.known("v_n"), position + arm, begin)
