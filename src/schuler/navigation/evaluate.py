"""How good a path is against a reference: position, velocity, attitude, nmi/h, CEP, components.

A free inertial error is a sum of known tones (Britting, 1971, chapter 6): the Schuler pair at
w_s +- w_ie sinL (the Foucault beat), one at the Earth's rate, a constant, and a ramp in longitude.
`components` fits them by least squares.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler._result import Result
from schuler.attitude import multiply, psi_to_heading, quat_to_euler, quat_to_rotvec
from schuler.constants import ARCMIN, DEG
from schuler.earth import gravity, radii
from schuler.errors import InputError, expect
from schuler.navigation.error_model import error_matrix
from schuler.trajectory import Trajectory

__all__ = ["Components", "Evaluation", "cep", "components", "evaluate", "schuler_rate"]

Array = NDArray[np.float64]

NAUTICAL_MILE = 1852.0


def cep(errors: ArrayLike) -> float:
    """Return the circular error probable: the median length of (n, 2) horizontal errors, m.

    Examples
    --------
    >>> from schuler.navigation import cep
    >>> float(cep(np.array([[3.0, 4.0], [0.0, 1.0], [0.0, 2.0]])))
    2.0
    """
    e = np.asarray(errors, np.float64)
    if e.ndim != 2 or e.shape[1] != 2 or not len(e):
        raise InputError(f"expected errors of shape (n, 2), got {e.shape}")
    return float(np.median(np.hypot(e[:, 0], e[:, 1])))


def schuler_rate(lat: float, height: float = 0.0) -> float:
    """Return the Schuler rate sqrt(g/R) at a latitude (rad) and height (m), rad/s.

    Examples
    --------
    >>> round(2.0 * np.pi / schuler_rate(site.latitude) / 60.0, 1)
    84.5
    """
    rm, rn = (float(r) + height for r in radii(lat))
    return float(np.sqrt(float(gravity(lat, height)) / np.sqrt(rm * rn)))


@dataclass(frozen=True)
class Components:
    """Amplitudes of one error channel's tones.

    Parameters
    ----------
    schuler, foucault : float
        Of the two tones at the Schuler rate plus and minus w_ie sinL, summed and apart (the
        difference): the largest and the least swing of the beat.
    daily : float
        Of the tone at the Earth's rate.
    constant, slope : float
        And what grows per second.
    residual : float
        Root mean square of what is left.
    """

    schuler: float
    foucault: float
    daily: float
    constant: float
    slope: float
    residual: float


def components(time: ArrayLike, error: ArrayLike, lat: float, height: float = 0.0) -> Components:
    """Fit the tones of a free inertial error.

    Parameters
    ----------
    time, error : (n,) array_like
        s, and any unit.
    lat, height : float
        Where, rad and m.

    Raises
    ------
    InputError
        If the record is shorter than two Schuler periods.

    Examples
    --------
    >>> time = np.arange(0.0, 20000.0, 60.0)
    >>> rate = schuler_rate(site.latitude)
    >>> found = components(time, 100.0 * np.sin(rate * time), site.latitude)
    >>> [round(float(x)) for x in np.ravel(found.schuler)][:1]
    [104]
    """
    t, e = np.asarray(time, np.float64), np.asarray(error, np.float64)
    t = t - t[0]
    ws = schuler_rate(lat, height)
    if t[-1] * ws < 4.0 * np.pi:
        raise InputError(
            f"{t[-1] / 60:.0f} min are too short to tell tones apart: take 170 min or more"
        )
    # The tones are the error equations' own: the Schuler pair is split by the Foucault beat.
    tones = np.sort(np.linalg.eigvals(error_matrix(lat, height)).imag)[:-4:-1]
    daily, slow, fast = sorted(float(w) for w in tones)
    resolved = (fast - slow) * t[-1] > 0.5
    rates = [fast, slow, daily] if resolved else [0.5 * (fast + slow), daily]
    columns = [np.ones_like(t), t / t[-1]]
    for w in rates:
        columns += [np.cos(w * t), np.sin(w * t)]
    basis = np.column_stack(columns)
    found, *_ = np.linalg.lstsq(basis, e, rcond=None)
    swing = np.hypot(found[2::2], found[3::2])
    pair = (swing[0], swing[1]) if len(rates) == 3 else (swing[0], 0.0)
    return Components(
        float(pair[0] + pair[1]),
        float(abs(pair[0] - pair[1])),
        float(swing[-1]),
        float(found[0]),
        float(found[1] / t[-1]),
        float(np.std(e - basis @ found)),
    )


@dataclass(frozen=True, eq=False)
class Evaluation(Result):
    """A path's errors at the reference's times.

    Parameters
    ----------
    time : (n,) float64
        s.
    position : (n, 3) float64
        East, north, up, m.
    velocity : (n, 3) float64 or None
        East, north, up, m/s.
    phi : (n, 3) float64 or None
        Misalignment in ENU, rad: C_est = (I - [phi x]) C_true.
    euler : (n, 3) float64 or None
        Heading (clockwise), pitch, roll, rad.
    reference : str
    """

    time: Array
    position: Array = field(repr=False)
    velocity: Array | None = field(repr=False)
    phi: Array | None = field(repr=False)
    euler: Array | None = field(repr=False)
    lat: float
    height: float
    start: float
    reference: str

    @property
    def radial(self) -> Array:
        """Horizontal error, m, (n,)."""
        return np.hypot(self.position[:, 0], self.position[:, 1])

    @property
    def nmi_per_hour(self) -> float:
        """Slope through the start of the horizontal error, by least squares, nmi/h."""
        hours = (self.time - self.start) / 3600.0
        power = float(hours @ hours)
        return float(hours @ self.radial) / power / NAUTICAL_MILE if power > 0 else 0.0

    def components(self) -> dict[str, Components]:
        """Return the tones of the east and north error, where the path is long enough."""
        return {
            name: components(self.time, self.position[:, k], self.lat, self.height)
            for k, name in enumerate(("east", "north"))
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the figures, in customary units."""
        e, n, u = (float(v) for v in self.position[-1])
        out: dict[str, Any] = {
            "reference": self.reference, "rows": len(self.time), "time_s": float(self.time[-1]),
            "east_m": e, "north_m": n, "up_m": u, "down_m": -u,
            "horizontal_m": float(self.radial[-1]),
            "max_m": {k: float(np.abs(self.position[:, j]).max())
                      for j, k in enumerate(("east", "north", "up"))},
            "rms_m": {k: float(np.sqrt(np.mean(self.position[:, j] ** 2)))
                      for j, k in enumerate(("east", "north", "up"))},
            "cep_m": cep(self.position[:, :2]),
            "nmi_per_h": self.nmi_per_hour,
            "velocity_enu": None, "heading_deg": None, "pitch_deg": None, "roll_deg": None,
            "max_attitude_deg": None,
        }  # fmt: skip
        if self.velocity is not None:
            out["velocity_enu"] = [float(v) for v in self.velocity[-1]]
        if self.euler is not None and self.phi is not None:
            for k, name in enumerate(("heading", "pitch", "roll")):
                out[f"{name}_deg"] = float(self.euler[-1, k] / DEG)
            out["max_attitude_deg"] = float(np.linalg.norm(self.phi, axis=1).max() / DEG)
        return out

    def columns(self) -> dict[str, Any]:
        """Return the errors at each time of the reference."""
        out: dict[str, Any] = {"t [s]": self.time}
        for what, values, unit, name in (
            ("position", self.position, 1.0, "m"), ("velocity", self.velocity, 1.0, "m/s"),
            ("phi", self.phi, ARCMIN, "arcmin"),
        ):  # fmt: skip
            if values is not None:
                for k, side in enumerate(("east", "north", "up")):
                    out[f"{what} error {side} [{name}]"] = values[:, k] / unit
        return out

    def __str__(self) -> str:
        e = self.to_dict()
        lines = [
            f"error     {e['north_m']:.4f} m north, {e['east_m']:.4f} east, {e['down_m']:.4f} down "
            f"at {e['time_s']:.6g} s; {e['nmi_per_h']:.4f} nmi/h"
        ]
        if e["heading_deg"] is not None:
            lines.append(
                f"          heading {e['heading_deg']:.6f} deg, pitch {e['pitch_deg']:.6f}, roll "
                f"{e['roll_deg']:.6f}"
            )
        return "\n".join(lines)


def _wrapped(angle: Array) -> Array:
    return np.asarray(np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi)


def evaluate(path: Trajectory, reference: Trajectory) -> Evaluation:
    """Compare a path with a reference at the reference's times.

    The path is interpolated between its rows (position with the velocity's cubic); give every row
    for a fast record. Reference times outside the path are passed over.

    Parameters
    ----------
    path : Trajectory
        With velocity and attitude, as `navigate` returns it.
    reference : Trajectory
        As `schuler.io.read_trajectory` reads it, or the truth of a simulation.

    Raises
    ------
    InputError
        If the two have no time in common, or the path lacks velocity or attitude.

    Examples
    --------
    >>> path = sc.navigate(record, sc.Start.from_angles(site, heading=30.0))
    >>> bool(np.abs(sc.evaluate(path, made.truth).position).max() < 50.0)
    True
    """
    from scipy.interpolate import CubicHermiteSpline

    expect(path, Trajectory, "path", "give what schuler.navigate returns")
    expect(reference, Trajectory, "reference", "read one with schuler.read_trajectory")

    t, v_n, quat_nb = path.time, path.known("v_n"), path.known("quat_nb")
    slack = 1e-6
    inside = (reference.time >= t[0] - slack) & (reference.time <= t[-1] + slack)
    if not np.any(inside):
        raise InputError(
            f"the reference '{reference.name}' ({reference.time[0]:.6g} to "
            f"{reference.time[-1]:.6g} s) and the path ({t[0]:.6g} to {t[-1]:.6g} s) have no "
            "time in common"
        )
    when = np.clip(reference.time[inside], t[0], t[-1])
    k = np.clip(np.searchsorted(t, when), 1, max(len(t) - 1, 1)) - (len(t) == 1)
    before = np.maximum(k - 1, 0)
    near = np.where(np.abs(t[k] - when) <= np.abs(when - t[before]), k, before)
    exact = np.abs(t[near] - when) < slack

    lat, lon, height = path.position.T
    rm, rn = radii(lat)
    rate = v_n / np.column_stack([(rn + height) * np.cos(lat), rm + height, 1 + 0 * rn])
    here = np.column_stack([lat, np.unwrap(lon), height])
    there = reference.position[inside]
    place, speed, turn = here[near], v_n[near], quat_nb[near]
    if not np.all(exact):
        spline = CubicHermiteSpline(t, here, rate[:, [1, 0, 2]])
        place = np.where(exact[:, None], place, spline(when))
        speed = np.column_stack([np.interp(when, t, v) for v in v_n.T])
        turn = _between(t, quat_nb, when, before, k)
    rm, rn = radii(there[:, 0])
    position = np.column_stack([
        _wrapped(place[:, 1] - there[:, 1]) * (rn + there[:, 2]) * np.cos(there[:, 0]),
        (place[:, 0] - there[:, 0]) * (rm + there[:, 2]),
        place[:, 2] - there[:, 2],
    ])  # fmt: skip
    velocity = None if reference.v_n is None else speed - reference.v_n[inside]
    phi = euler = None
    if reference.quat_nb is not None:
        true = reference.quat_nb[inside]
        # C_true C_est^T = I + [phi x].
        phi = quat_to_rotvec(multiply(true, turn * [1.0, -1.0, -1.0, -1.0]))
        a, b = quat_to_euler(turn), quat_to_euler(true)
        euler = np.column_stack([
            _wrapped(psi_to_heading(a[:, 0]) - psi_to_heading(b[:, 0])),
            a[:, 1] - b[:, 1], _wrapped(a[:, 2] - b[:, 2]),
        ])  # fmt: skip
    return Evaluation(
        when, position, velocity, phi, euler,
        float(np.mean(there[:, 0])), float(np.mean(there[:, 2])), float(t[0]), reference.name,
    )  # fmt: skip


def sigma_at(evaluation: Evaluation, path: Trajectory) -> dict[str, Array]:
    """Return 1-sigma of a path at an evaluation's times, (n, 3) each: position, velocity, phi.

    Parameters
    ----------
    evaluation : Evaluation
    path : Trajectory
        With variances; its velocity and position axes are those of the frame navigated in.

    Raises
    ------
    InputError
        If the path has no variances.
    """
    known = path.known("variances")
    sigma = np.sqrt(np.column_stack([
        np.interp(evaluation.time, path.time, column) for column in known[:, :9].T
    ]))  # fmt: skip
    return {"phi": sigma[:, :3], "velocity": sigma[:, 3:6], "position": sigma[:, 6:9]}


def normalised_rms(evaluation: Evaluation, path: Trajectory) -> dict[str, float | None]:
    """Return the rms of found errors over their sigma: 1 where sigma is right; None if not known.

    Parameters
    ----------
    evaluation : Evaluation
    path : Trajectory
        With variances.
    """
    sigma = sigma_at(evaluation, path)
    errors = {
        "position": evaluation.position, "velocity": evaluation.velocity, "phi": evaluation.phi
    }  # fmt: skip
    return {
        name: None if error is None else float(
            np.sqrt(np.mean((error / np.maximum(sigma[name], 1e-12)) ** 2))
        )
        for name, error in errors.items()
    }  # fmt: skip


def _between(t: Array, q: Array, when: Array, a: Array, b: Array) -> Array:
    """Return quaternions between rows a and b by constant rate."""
    from schuler.attitude import rotvec_to_quat

    part = (when - t[a]) / np.maximum(t[b] - t[a], 1e-12)
    turn = quat_to_rotvec(multiply(q[a] * [1.0, -1.0, -1.0, -1.0], q[b]))
    return multiply(q[a], rotvec_to_quat(part[:, None] * turn))
