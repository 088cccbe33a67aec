"""Alignment methods as values: small frozen dataclasses that flags, files and sweeps share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.prefilter import Prefilter

__all__ = [
    "METHODS",
    "PREFILTERS",
    "Analytic",
    "Auto",
    "Fine",
    "Gyrocompass",
    "Inertial",
    "Method",
    "parse_method",
    "parse_prefilter",
    "with_prefilter",
]

ESTIMATORS = (
    "centred", "optimal", "wahba", "integral-triad", "instants-triad", "position-triad",
    "position-wahba", "fitted-triad", "fitted-position-triad", "velocity-growth",
)  # fmt: skip
BASES = ("gravity", "earth-rate")


@dataclass(frozen=True)
class Inertial:
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
    prefilter : Prefilter, optional
        Applied to the whole record first, which is then held in memory.
    """

    estimator: str = "centred"
    subsamples: int | None = None
    prefilter: Prefilter | None = None

    def __post_init__(self) -> None:
        if self.estimator not in ESTIMATORS:
            raise InputError(
                f"estimator must be one of {', '.join(ESTIMATORS)}, got '{self.estimator}'"
            )
        if self.subsamples is not None and self.subsamples not in (1, 2, 3, 4):
            raise InputError(f"subsamples must be 1, 2, 3 or 4, got {self.subsamples}")

    def __str__(self) -> str:
        return self.estimator


@dataclass(frozen=True)
class Analytic:
    """The traditional analytic method: mean force and mean rate as the two vectors.

    It needs a base that stands still: sway enters in full.

    Parameters
    ----------
    base : {"gravity", "earth-rate"}
        The vector that is fitted exactly (where the Gram-Schmidt process starts).
    prefilter : Prefilter, optional
        As in `Inertial`.
    """

    base: str = "gravity"
    prefilter: Prefilter | None = None

    def __post_init__(self) -> None:
        if self.base not in BASES:
            raise InputError(f"base must be one of {', '.join(BASES)}, got '{self.base}'")

    def __str__(self) -> str:
        return "analytic" if self.base == "gravity" else "analytic-earth-rate"


@dataclass(frozen=True)
class Auto:
    """The method that the record calls for (`schuler.alignment.choose`).

    Parameters
    ----------
    subsamples : int, optional
        As in `Inertial`.
    prefilter : Prefilter, optional
        As in `Inertial`.
    """

    subsamples: int | None = None
    prefilter: Prefilter | None = None

    def __str__(self) -> str:
        return "auto"


@dataclass(frozen=True)
class Fine:
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
    prefilter : Prefilter, optional
        As in `Inertial`.
    """

    states: int = 15
    measurement: str = "displacement"
    coloured: bool = False
    motion_time: float = 0.5
    base: bool = True
    lever: bool = False
    robust: str | None = None
    adaptive: bool = False
    azimuth: str = "small"
    feedback: bool = True
    passes: int = 1
    step: float = 1.0
    noise: float | None = None
    prefilter: Prefilter | None = None

    def __post_init__(self) -> None:
        for name, value, known in (
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
        if self.passes < 1 or self.passes % 2 == 0:
            raise InputError(f"passes must be odd (forward last), got {self.passes}")
        if not (self.step > 0 and self.motion_time > 0):
            raise InputError("step and motion_time must be positive times")
        if self.noise is not None and not self.noise > 0:
            raise InputError(f"noise must be positive, got {self.noise}")

    def __str__(self) -> str:
        if self.azimuth == "large":
            return "kalman-large"
        if self.measurement == "displacement":
            return "kalman"
        return "kalman-10" if self.states == 10 else f"kalman-{self.measurement}"


@dataclass(frozen=True)
class Gyrocompass:
    """The classical two-stage gyrocompass loop with fixed gains.

    Parameters
    ----------
    level_share : float
        Part of the record for the level stage.
    pole : float, optional
        Pole of the azimuth stage, 1/s; by default as slow as the record allows.
    prefilter : Prefilter, optional
        As in `Inertial`.
    """

    level_share: float = 0.15
    pole: float | None = None
    prefilter: Prefilter | None = None

    def __post_init__(self) -> None:
        if not 0 < self.level_share < 1:
            raise InputError(f"level_share must be between 0 and 1, got {self.level_share}")
        if self.pole is not None and not self.pole > 0:
            raise InputError(f"pole must be positive, got {self.pole}")

    def __str__(self) -> str:
        return "gyrocompass"


Method = Inertial | Analytic | Auto | Fine | Gyrocompass

#: the names of the command line and of scenario files
METHODS: dict[str, Method] = {
    "auto": Auto(),
    **{name: Inertial(name) for name in ESTIMATORS},
    "kalman": Fine(),
    "kalman-velocity": Fine(12, "velocity"),
    "kalman-10": Fine(10, "velocity"),
    "kalman-force": Fine(12, "force"),
    "kalman-large": Fine(azimuth="large"),
    "gyrocompass": Gyrocompass(),
    "analytic": Analytic(),
    "analytic-earth-rate": Analytic("earth-rate"),
}


def parse_method(method: str | Method | None) -> Method:
    """Return the method of a name (`METHODS`); None is the default, auto.

    Raises
    ------
    InputError
        For an unknown name.
    """
    if method is None:
        return Auto()
    if isinstance(method, (Inertial, Analytic, Auto, Fine, Gyrocompass)):
        return method
    found = METHODS.get(str(method).strip().lower())
    if found is None:
        raise InputError(f"unknown method '{method}'; the methods are {', '.join(METHODS)}")
    return found


#: the names of the command line
PREFILTERS = (
    "emd", "gate", "gate-printed", "hankel", "lowpass", "lowpass-zero-phase", "wavelet",
)  # fmt: skip


def parse_prefilter(name: str | None, gravity: float) -> Prefilter | None:
    """Return the prefilter of a name (`PREFILTERS`) with its defaults; None is none.

    Parameters
    ----------
    name : str or None
    gravity : float
        m/s^2, for the gate.

    Raises
    ------
    InputError
        For an unknown name.
    """
    if name is None or name.strip().lower() == "none":
        return None
    from schuler.prefilter import Emd, Gate, Hankel, LowPass, Wavelet

    known: dict[str, Prefilter] = {
        "emd": Emd(),
        "gate": Gate(gravity),
        "gate-printed": Gate(gravity, two_sided=False),
        "hankel": Hankel(),
        "lowpass": LowPass(),
        "lowpass-zero-phase": LowPass(zero_phase=True),
        "wavelet": Wavelet(),
    }
    found = known.get(name.strip().lower())
    if found is None:
        raise InputError(f"unknown prefilter '{name}'; the prefilters are {', '.join(PREFILTERS)}")
    return found


def with_prefilter(method: Method, prefilter: Prefilter | None) -> Method:
    """Return the method with another prefilter."""
    return replace(method, prefilter=prefilter)
