"""The alignment methods by name; flags, files, sweeps, JSON and plugins take them from here."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._options import Registry
from schuler.alignment.method import Estimate, Method, Problem
from schuler.errors import InputError
from schuler.prefilter.registry import parse_prefilter

__all__ = [
    "METHODS",
    "Analytic",
    "Auto",
    "Gyrocompass",
    "Inertial",
    "KalmanAlignment",
    "parse_method",
]

Array = NDArray[np.float64]

ESTIMATORS = (
    "centred", "optimal", "wahba", "integral-triad", "instants-triad", "position-triad",
    "position-wahba", "fitted-triad", "fitted-position-triad", "velocity-growth",
)  # fmt: skip
BASES = ("gravity", "earth-rate")


@dataclass(frozen=True)
class Inertial(Method):
    """Alignment in the frozen inertial frame: gravity seen from there turns with the Earth.

    Angular sway drops out exactly, because the gyros carry the force into a frame that does not
    sway.

    Parameters
    ----------
    estimator : str
        "centred": least squares between all velocity integrals and their theory, both
        centred, so that an unknown constant velocity drops out. "optimal": the same series and
        the attitude of the base, weighted by the noise of both. "wahba": as centred without
        centring. "integral-triad": the integrals at the middle and at the end.
        "instants-triad": the specific force at the middle and at the end. "position-triad",
        "position-wahba", "fitted-triad", "fitted-position-triad", "velocity-growth": those of
        `schuler.alignment.stationary.integral_methods`.
    subsamples : int, optional
        Samples to one coning and sculling update, 1 to 4 (1 uses the sample before as well);
        by default chosen from the sampling rate.

    Examples
    --------
    >>> str(sc.align(record, site, sc.Inertial("wahba"), spec).method)
    'wahba'
    """

    estimator: str = "centred"
    subsamples: int | None = None

    def __post_init__(self) -> None:
        if self.estimator not in ESTIMATORS:
            raise InputError(
                f"estimator must be one of {', '.join(ESTIMATORS)}, got '{self.estimator}'"
            )
        if self.subsamples is not None and self.subsamples not in (1, 2, 3, 4):
            raise InputError(f"subsamples must be 1, 2, 3 or 4, got {self.subsamples}")

    def solve(self, problem: Problem) -> Estimate:
        """See `Method.solve`."""
        from schuler.alignment.estimate import inertial_estimate

        return inertial_estimate(self, problem)

    def attitude(self, problem: Problem) -> Array:
        """See `Method.attitude`."""
        from schuler.alignment.estimate import inertial_attitude

        return inertial_attitude(self, problem)


@dataclass(frozen=True)
class Analytic(Method):
    """The traditional analytic method: mean force and mean rate as the two vectors.

    It needs a base that stands still: sway enters in full.

    Parameters
    ----------
    base : {"gravity", "earth-rate"}
        The vector that is fitted exactly (where the Gram-Schmidt process starts).

    Examples
    --------
    >>> str(sc.align(record, site, sc.Analytic("earth-rate"), spec).method)
    'analytic-earth-rate'
    """

    base: str = "gravity"

    def __post_init__(self) -> None:
        if self.base not in BASES:
            raise InputError(f"base must be one of {', '.join(BASES)}, got '{self.base}'")

    def solve(self, problem: Problem) -> Estimate:
        """See `Method.solve`."""
        from schuler.alignment.estimate import analytic_estimate

        return analytic_estimate(self, problem)

    def attitude(self, problem: Problem) -> Array:
        """See `Method.attitude`."""
        from schuler.alignment.estimate import mean_solution

        return mean_solution(self, problem)[0]


@dataclass(frozen=True)
class Auto(Method):
    """The method that the record calls for (`schuler.alignment.estimate`).

    Parameters
    ----------
    subsamples : int, optional
        As in `Inertial`.

    Examples
    --------
    >>> sc.align(record, site, Auto(), spec).why is not None
    True
    """

    subsamples: int | None = None

    def solve(self, problem: Problem) -> Estimate:
        """See `Method.solve`."""
        from schuler.alignment.estimate import chosen_estimate

        return chosen_estimate(self.subsamples, problem)


@dataclass(frozen=True)
class KalmanAlignment(Method):
    """A Kalman filter over intervals of the record; memory is constant for any length.

    A step is no shorter than the distance of instants that are kept, of which there are 4096.

    Parameters
    ----------
    states : {10, 12, 15}
        10: level velocities, phi, level accelerometer biases and gyro biases, as Fang and Wan
        (1996), and the third accelerometer's bias where the unit is tilted; 12: all three
        velocities and accelerometer biases; 15: displacement as well.
    measurement : {"displacement", "velocity", "force"}
        What is known to be nothing: the displacement (bounded, so the strongest), the velocity,
        or the horizontal force.
    coloured : bool
        Take the vehicle's displacement for a Gauss-Markov motion instead of white noise.
    motion_time : float
        Its correlation time, s.
    base : bool
        Use that the base does not turn, as far as the record shows it.
    lever : bool
        Estimate the lever arm from the point that does not move.
    robust : {None, "huber", "igg3"}
        Weigh down, or refuse, measurements that are far off.
    adaptive : bool
        Follow the measurement noise by the innovations.
    azimuth : {"small", "large"}
        "large": level axes of unknown azimuth, linear for any; no start is needed.
    feedback : bool
        Correct attitude, velocity and biases after each step.
    passes : int
        Odd; passes forward, backward, forward ... of which the last one counts.
    step : float
        Time between measurements, s.
    noise : float, optional
        Sigma of what is measured: m, m/s or m/s^2; read from the record when not given.
    start : str
        The estimator of `Inertial` that the filter starts from; its prior is three sigmas of that
        at least, so that the record hardly counts twice.

    Examples
    --------
    >>> fix = sc.align(record, site, sc.KalmanAlignment(10, "velocity"), spec)
    >>> fix.covariance.shape
    (3, 3)
    """

    states: int = 15
    measurement: str = "displacement"
    coloured: bool = False
    motion_time: float = field(default=0.5, metadata={"unit": "time"})
    base: bool = True
    lever: bool = False
    robust: str | None = None
    adaptive: bool = False
    azimuth: str = "small"
    feedback: bool = True
    passes: int = 1
    step: float = field(default=1.0, metadata={"unit": "time"})
    noise: float | None = None
    start: str = "centred"

    def __post_init__(self) -> None:
        for name, value, known in (
            ("start", self.start, ESTIMATORS),
            ("states", self.states, (10, 12, 15)),
            ("measurement", self.measurement, ("displacement", "velocity", "force")),
            ("robust", self.robust, (None, "huber", "igg3")),
            ("azimuth", self.azimuth, ("small", "large")),
        ):
            if value not in known:
                raise InputError(f"{name} must be one of {', '.join(map(str, known))}, got {value}")
        if self.measurement == "displacement" and self.states != 15:
            raise InputError("a displacement is measured with 15 states")
        if self.coloured and self.measurement != "displacement":
            raise InputError("a coloured motion is one of the displacement")
        if self.azimuth == "large" and self.start != "centred":
            raise InputError("a filter of a large azimuth needs no start: leave it out")
        if self.passes < 1 or self.passes % 2 == 0:
            raise InputError(f"passes must be odd (forward last), got {self.passes}")
        if not (self.step > 0 and self.motion_time > 0):
            raise InputError("step and motion_time must be positive times")
        if self.noise is not None and not self.noise > 0:
            raise InputError(f"noise must be positive, got {self.noise}")

    def solve(self, problem: Problem) -> Estimate:
        """See `Method.solve`."""
        from schuler.alignment.estimate import inertial_estimate
        from schuler.alignment.stationary.kalman import kalman_alignment

        spec, start = problem.spec, None
        if self.start != "centred":
            begin = inertial_estimate(Inertial(self.start), replace(problem, at_end=False))
            start = begin.attitude, begin.covariance
        fine = kalman_alignment(
            problem.history, problem.site, self, spec, problem.at_end, problem.about, start
        )
        known = spec is not None
        return Estimate(
            self, fine.attitude, fine.budget, spec=spec, biases=fine.biases if known else None,
            bias_covariance=fine.bias_covariance if known else None,
            filter_history=fine.filter_history, best=fine.best,
        )  # fmt: skip


@dataclass(frozen=True)
class Gyrocompass(Method):
    """The classical two-stage gyrocompass loop with fixed gains.

    Parameters
    ----------
    level_share : float
        Part of the record for the level stage.
    pole : float, optional
        Pole of the azimuth stage, 1/s; by default as slow as the record allows.

    Examples
    --------
    >>> sc.align(record, site, sc.Gyrocompass(), spec).consistent
    True
    """

    level_share: float = 0.15
    pole: float | None = None

    def __post_init__(self) -> None:
        if not 0 < self.level_share < 1:
            raise InputError(f"level_share must be between 0 and 1, got {self.level_share}")
        if self.pole is not None and not self.pole > 0:
            raise InputError(f"pole must be positive, got {self.pole}")

    def solve(self, problem: Problem) -> Estimate:
        """See `Method.solve`."""
        from schuler.alignment.stationary.gyrocompass import compass_alignment

        if not problem.at_end:
            raise InputError("a gyrocompass loop gives the attitude at the end: say --at end")
        loop = compass_alignment(problem.history, problem.site, self, problem.spec)
        return Estimate(
            self, loop.attitude, loop.budget, spec=problem.spec, filter_history=loop.filter_history
        )


def _presets() -> dict[str, Method]:
    return {
        "auto": Auto(),
        **{name: Inertial(name) for name in ESTIMATORS},
        "kalman": KalmanAlignment(),
        "kalman-velocity": KalmanAlignment(12, "velocity"),
        "kalman-10": KalmanAlignment(10, "velocity"),
        "kalman-force": KalmanAlignment(12, "force"),
        "kalman-large": KalmanAlignment(azimuth="large"),
        "gyrocompass": Gyrocompass(),
        "analytic": Analytic(),
        "analytic-earth-rate": Analytic("earth-rate"),
    }


#: the names of the command line, of scenario files and of JSON
METHODS: Registry[Method] = Registry(
    "method", Method, "schuler.methods", _presets, {"prefilter": parse_prefilter}
)


def parse_method(method: Any = None) -> Method:
    """Return a method.

    Parameters
    ----------
    method : str, mapping or Method, optional
        A name of `METHODS` with options where they are wanted, as ``"kalman(states=12)"``, or a
        table with name and options; None is the default, auto.

    Raises
    ------
    InputError
        For an unknown name or option.

    Examples
    --------
    >>> parse_method("kalman(12, velocity, step=2 s)").to_table()
    {'name': 'kalman-velocity', 'options': {'step': 2.0}}
    """
    if method is None:
        return Auto()
    if isinstance(method, Method):
        return method
    return METHODS.from_table(method) if isinstance(method, dict) else METHODS.parse(str(method))
