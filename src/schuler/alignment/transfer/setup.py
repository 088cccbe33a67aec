"""The filter of a transfer alignment: states, priors, noise, and rows of the master."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.moving.setup import Nominal, layout_of, prior_sigma, process_noise
from schuler.alignment.transfer.master import (
    MasterNoise,
    MasterRates,
    rates_of,
    state_at,
    thinned,
)
from schuler.attitude import multiply, quat_to_matrix, quat_to_rotvec
from schuler.constants import DEG, STAMP_ROUNDING
from schuler.earth import moved
from schuler.errors import InputError
from schuler.ins import (
    Attitude,
    ErrorStateFilter,
    GroupNoise,
    Handling,
    Layout,
    Measurement,
    Position,
    Rate,
    Velocity,
)
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec
from schuler.trajectory import Trajectory

__all__ = ["MATCHES", "Flexure", "Known", "Matching", "parse_match"]

Array = NDArray[np.float64]

MATCHES = ("velocity", "attitude", "position", "rate")
"""What may be matched; a mode is one of them, or several with a plus sign between."""

MOUNTING_SIGMA = 5.0 * DEG
LEVER_SIGMA = 5.0
DELAY_SIGMA = 0.1
"""1-sigma of what nothing is known of: rad, m, s."""

_DIFFUSE_VELOCITY, _DIFFUSE_POSITION = 5.0, 20.0
"""1-sigma of the slave's velocity and position beside the master's, m/s and m."""

_WIDER = 10.0
"""The start's attitude is so much less sure than a row of the master: that row is used again."""

LEAST_ROWS = 5
"""Rows of a master that an alignment needs."""

_GATE = 0.999999
_CRITICAL = 2.146
"""b T of a critically damped process whose correlation falls to 1/e over T."""

_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


@dataclass(frozen=True)
class Flexure:
    """How the structure between master and slave bends.

    Parameters
    ----------
    sigma : float
        1 sigma of the angle about each axis, rad.
    time : float
        Correlation time, s.
    states : bool
        Estimate it as a second-order Gauss-Markov process; else it is white noise of the same
        sigma on the master's attitude, which is cheaper, and right where rows of the master are
        further apart than the correlation time.

    Raises
    ------
    InputError
        If one of both is not a positive number.

    Examples
    --------
    >>> Flexure(sigma=1e-3, time=0.3)
    Flexure(sigma=0.001, time=0.3, states=True)
    """

    sigma: float
    time: float = 0.5
    states: bool = True

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sigma) and self.sigma > 0.0 and self.time > 0.0):
            raise InputError(
                f"flexure needs a positive sigma and time, got {self.sigma} rad and {self.time} s"
            )


def parse_match(text: str) -> tuple[str, ...]:
    """Return the parts of a matching mode, as ``velocity+attitude``.

    Raises
    ------
    InputError
        For a part that there is not, or a mode that fixes no attitude.
    """
    parts = tuple(dict.fromkeys(part.strip() for part in text.split("+")))
    for part in parts:
        if part not in MATCHES:
            raise InputError(
                f"match is made of {', '.join(MATCHES)} with + between, as velocity+attitude; "
                f"got '{text}'"
            )
    if parts == ("rate",):
        raise InputError("rates alone fix a mounting and no attitude: match velocity+rate")
    return parts


@dataclass(frozen=True, eq=False)
class Known:
    """What is said of the mounting, the lever arm and the delay; None for what is to be found.

    Parameters
    ----------
    mounting : (4,) float64
        Quaternion from the slave's body to the master's: the start where it is estimated.
    mounting_sigma : float
        rad; 0 where it is known.
    lever : (3,) float64
        From the slave to the master, the slave's axes, m.
    lever_sigma : float
        m; 0 where it is known.
    delay : float
        A row of the master stamped t is valid at t - delay, s.
    delay_sigma : float
        s; 0 where it is known.
    """

    mounting: Array
    mounting_sigma: float
    lever: Array
    lever_sigma: float
    delay: float
    delay_sigma: float


@dataclass(frozen=True, eq=False)
class Matching:
    """A slave's record and its master, matched in some way.

    Parameters
    ----------
    record : ImuRecord
    master : Trajectory
    parts : tuple of str
        Of `MATCHES`.
    known : Known
    spec : ImuSpec
    noise : MasterNoise
    flexure : Flexure or None
    rate : float
        Rows of the master used, at most, Hz.
    """

    record: ImuRecord
    master: Trajectory
    parts: tuple[str, ...]
    known: Known
    spec: ImuSpec
    noise: MasterNoise
    flexure: Flexure | None
    rate: float

    @property
    def sees_mounting(self) -> bool:
        """Whether the mounting takes part in what is measured."""
        return "attitude" in self.parts or "rate" in self.parts

    @property
    def estimated(self) -> tuple[str, ...]:
        """Of mounting, lever and delay those that are states."""
        known = self.known
        out = []
        if known.mounting_sigma > 0.0 and self.sees_mounting:
            out.append("mounting")
        if known.lever_sigma > 0.0 and ("velocity" in self.parts or "position" in self.parts):
            out.append("lever")
        if known.delay_sigma > 0.0 and not (self.by_master and self.parts == ("velocity",)):
            out.append("delay")
        return tuple(out)

    @cached_property
    def master_rates(self) -> MasterRates:
        """The master's rates."""
        return rates_of(self.master)

    @cached_property
    def by_master(self) -> bool:
        """Whether the master tells the rate of the body better than a sample of the gyros."""
        return self.rate_sigma < self._sample_sigma and len(self.master_rates.rows) >= LEAST_ROWS

    @property
    def rate_sigma(self) -> float:
        """1-sigma of a rate of the master, rad/s."""
        return 0.95 * self.noise.attitude / self.master_rates.step

    @property
    def _sample_sigma(self) -> float:
        """1-sigma of a rate from two samples of the gyros, rad/s."""
        return 1.6 * self.spec.gyro.white / float(np.sqrt(np.median(self.record.dt)))

    def measured(
        self, delay: float, mounting: Array, *, gate: bool = True
    ) -> list[Measurement]:  # fmt: skip
        """Return the master's rows within the record, once a delay (s) is taken off their times.

        The mounting (4,) turns the master's rates. Without a gate all rows count: for passes whose
        start is still wrong by degrees.
        """
        due = self.master.time - delay
        record = self.record
        inside = np.flatnonzero(
            (due >= record.start - STAMP_ROUNDING) & (due <= record.end + STAMP_ROUNDING)
        )
        found = self.master_rates
        if self.by_master:
            inside = inside[np.isin(inside, found.rows)]
        k = inside[thinned(due[inside], self.rate)]
        rates = np.zeros((len(due), 6))
        turn = quat_to_matrix(mounting)
        rates[found.rows] = np.hstack([found.against_n @ turn, found.change @ turn])
        handling = Handling(gate=_GATE if gate else None, source="aiding")
        shared = dict.fromkeys(("mounting", "lever", "delay"), "transfer")
        estimate = self.estimated

        def of(
            kind: type[Measurement], rows: NDArray[np.int64], value: Array, sigma: float,
            what: str, **more: object,
        ) -> Measurement:  # fmt: skip
            """Return the measurements of a kind in some rows, with what is estimated of them."""
            own = tuple(part for part in estimate if part in kind.STATES)
            if kind is Velocity and self.by_master:
                # Where the gyros are noisy the accelerometers are: their noise, times a delay,
                # would make that look observable, and bias it.
                own = tuple(part for part in own if part != "delay")
            return kind(
                due[rows], value, sigma, name=f"master_{what}", handling=handling, shared=shared,
                estimate=own, rate_now=True, rates=rates[rows] if self.by_master else None,
                **more,  # type: ignore[arg-type]
            )  # fmt: skip

        master, noise = self.master, self.noise
        out = []
        if "velocity" in self.parts:
            v = master.known("v_n")[k]
            out.append(of(Velocity, k, v, noise.velocity, "velocity", lever=self.known.lever))
        if "position" in self.parts:
            place = master.position[k]
            lever = self.known.lever
            out.append(of(Position, k, place, noise.position, "position", lever=lever))
        if "attitude" in self.parts:
            sigma = noise.attitude
            if self.flexure is not None and not self.flexure.states:
                sigma = float(np.hypot(sigma, self.flexure.sigma))
            turn = quat_to_rotvec(master.known("quat_nb")[k])
            out.append(
                of(Attitude, k, turn, sigma, "attitude", mount=self.known.mounting)
            )  # fmt: skip
        if "rate" in self.parts:
            at = np.isin(found.rows, k)
            sigma = float(np.hypot(self.rate_sigma, self._sample_sigma))
            mount = self.known.mounting
            if np.any(at):
                out.append(
                    of(Rate, found.rows[at], found.inertial[at], sigma, "rate", mount=mount)
                )  # fmt: skip
        return out

    def layout(self, measured: list[Measurement]) -> Layout:
        """Return the error states."""
        base = layout_of(self.spec, [])
        groups: list[str | tuple[str, int]] = [
            (name, base[name].stop - base[name].start) for name in base
        ]
        groups += dict.fromkeys(group for aid in measured for group in aid.groups)
        if self.flexure is not None and self.flexure.states and "attitude" in self.parts:
            groups.append("flexure")
        return Layout(groups)

    def start(self, delay: float) -> Nominal:
        """Return the slave at the record's start, as the master and what is known have it."""
        record, known = self.record, self.known
        now = state_at(self.master, np.array([record.start + delay]))
        quat = np.asarray(multiply(now.quat_nb[0], known.mounting))
        mat = quat_to_matrix(quat)
        rate = self._first_rate()
        lat, lon, height = (
            float(x[0]) for x in moved(now.lat, now.lon, now.height, -(mat @ known.lever)[None])
        )
        v_n = now.v_n[0] - mat @ np.cross(rate, known.lever)
        # What is left of the delay is estimated about nothing; the prior is about what was known.
        parameters = {"transfer.delay": np.array([known.delay - delay])}
        return Nominal(lat, lon, height, quat, v_n, parameters)

    def _first_rate(self) -> Array:
        few = slice(0, 5)
        span = float(self.record.dt[few].sum())
        return np.asarray(self.record.dtheta[few].sum(axis=0) / span)

    def prior(self, layout: Layout, start: Nominal) -> Array:
        """Return the covariance (n, n) before anything is measured.

        The slave's attitude is the master's by the mounting: an error of the one is the other's.
        """
        known = self.known
        base = layout_of(self.spec, [])
        rate = self._first_rate()
        swing = float(np.linalg.norm(rate))
        late = known.delay_sigma
        diffuse = {
            "phi": 1.0,
            "velocity": float(np.hypot(_DIFFUSE_VELOCITY, swing * known.lever_sigma)),
            "position": _DIFFUSE_POSITION + float(np.linalg.norm(start.v_n)) * late,
        }
        sigma = np.zeros(layout.size)
        sigma[: base.size] = prior_sigma(base, self.spec, [], diffuse)
        for group, value in (
            ("transfer.mounting", known.mounting_sigma), ("transfer.lever", known.lever_sigma),
            ("transfer.delay", late),
        ):  # fmt: skip
            if group in layout:
                sigma[layout[group]] = value
        if "flexure" in layout and self.flexure is not None:
            first = layout["flexure"].start
            sigma[first : first + 3] = self.flexure.sigma
            sigma[first + 3 : first + 6] = self.flexure.sigma * _CRITICAL / self.flexure.time
        out = np.diag(sigma**2)
        bend = 0.0 if self.flexure is None else self.flexure.sigma
        near = np.hypot(_WIDER * self.noise.attitude, np.hypot(2.0 * bend, swing * late))
        turn = np.asarray(known.mounting_sigma**2 * np.eye(3))
        phi = layout["phi"]
        out[phi, phi] = turn + near**2 * np.eye(3)
        if "transfer.mounting" in layout:
            place = layout["transfer.mounting"]
            cross = -quat_to_matrix(start.quat_nb) @ turn
            out[phi, place], out[place, phi] = cross, cross.T
        return out

    def build(
        self, layout: Layout, start: Nominal, measured: list[Measurement], vibration: float,
        nominal: Nominal, error: Array, divided: bool,
    ) -> ErrorStateFilter:  # fmt: skip
        """Return a filter that starts at a nominal, whose prior's mean is at another."""
        more = {}
        if "flexure" in layout and self.flexure is not None:
            more["flexure"] = GroupNoise(
                0.0, self.flexure.sigma, self.flexure.time / _CRITICAL, "aiding"
            )
        parameters = {name: each for name, each in nominal.parameters.items() if name in layout}
        return ErrorStateFilter(
            layout, nominal.site, nominal.quat_nb, self.prior(layout, start),
            process_noise(
                layout, self.spec, vibration, self.record.end - self.record.start, more
            ), measured, v_n=nominal.v_n,
            error_state=error, parameters=parameters, feedback=False, budget=divided,
            smooth=not divided, keep_history=True,
        )  # fmt: skip
