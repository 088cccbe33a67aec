"""`ImuSpec`: an instrument's errors by type, in SI, from TOML with units or by grade.

Noise types and their symbols are those of IEEE Std 952-1997, annex C. For a rate sensor with
angle random walk N, bias instability B, rate random walk K and quantisation Q the Allan variance
at tau is N^2/tau + (2 ln2/pi) B^2 + K^2 tau/3 + 3 Q^2/tau^2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from schuler._files import read_toml
from schuler.errors import InputError, located, near
from schuler.sensors.by_axis import Ratios, parse_figure, ratios_of, rms, text_of
from schuler.sensors.grade_tables import GRADE_TABLES
from schuler.units import parse, to_unit

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_ONE_VALUE = ("gauss_markov_time", "misalignment", "non_orthogonality", "full_scale")
"""Figures of a triad, not of an axis."""

__all__ = ["GRADES", "AccelerometerSpec", "GyroSpec", "ImuSpec", "load_spec"]


@dataclass(frozen=True)
class _TriadSpec:
    """What gyros and accelerometers share; 1-sigma, the rms over the axes, SI."""

    bias: float = 0.0
    quantisation: float = 0.0
    bias_instability: float = 0.0
    gauss_markov: float = 0.0
    gauss_markov_time: float = 0.0
    scale_factor: float = 0.0
    scale_factor_asymmetry: float = 0.0
    misalignment: float = 0.0
    non_orthogonality: float = 0.0
    g2_sensitivity: float = 0.0
    temperature_sensitivity: float = 0.0
    full_scale: float = 0.0
    ratios: tuple[tuple[str, Ratios], ...] = ()
    """Of figures that differ by axis: x, y and z over the rms."""

    def __post_init__(self) -> None:
        for item in fields(self):
            if item.name == "ratios":
                continue
            value = getattr(self, item.name)
            if not (math.isfinite(value) and value >= 0):
                raise InputError(
                    f"{item.name}: expected a finite 1-sigma magnitude of 0 or more, got {value}"
                )
        if self.gauss_markov and not self.gauss_markov_time:
            raise InputError("gauss_markov needs its correlation time, gauss_markov_time")
        for name, _ in self.ratios:
            if name in _ONE_VALUE:
                raise InputError(f"{name} has one value for all axes; give one")

    def by_axis(self, name: str) -> float | NDArray[np.float64]:
        """Return a figure of each axis: one number where all have the same, (3,) where not.

        Examples
        --------
        >>> unit = sc.ImuSpec.from_dict({"gyro": {"bias": "1, 2, 2 deg/h"}, "accelerometer": {}})
        >>> [round(float(b) * 1e6, 2) for b in unit.gyro.by_axis("bias")]
        [4.85, 9.7, 9.7]
        """
        value: float = getattr(self, name)
        for each, ratios in self.ratios:
            if each == name:
                import numpy as np

                return value * np.array(ratios)
        return value

    def with_axes(self, **values: Sequence[float]) -> Self:
        """Return the same errors with figures of x, y and z.

        Examples
        --------
        >>> spec.gyro.with_axes(bias=[1e-8, 2e-8, 2e-8]).by_axis("bias").shape
        (3,)
        """
        kept = {name: ratios for name, ratios in self.ratios if name not in values}
        found = {name: ratios_of(each) for name, each in values.items()}
        kept |= {name: ratios for name, ratios in found.items() if ratios is not None}
        figures: dict[str, Any] = {name: rms(each) for name, each in values.items()}
        return replace(self, **figures, ratios=tuple(kept.items()))


@dataclass(frozen=True)
class GyroSpec(_TriadSpec):
    """Errors of each gyro axis, 1-sigma, SI.

    Parameters
    ----------
    bias : float
        Turn-on bias, rad/s.
    angle_random_walk : float
        N, rad/sqrt(s).
    quantisation : float
        Q, rad: the standard deviation of the angle's rounding, the step over sqrt(12).
    bias_instability : float
        B, rad/s: the coefficient, of which the Allan deviation's floor is 0.664.
    rate_random_walk : float
        K, rad/s/sqrt(s).
    gauss_markov, gauss_markov_time : float
        First-order Gauss-Markov noise: standard deviation (rad/s), correlation time (s).
    scale_factor, scale_factor_asymmetry : float
        Ratio; the asymmetry is half the difference between the two signs of input.
    misalignment, non_orthogonality : float
        Turn of the triad about each axis, and lean of its axes towards one another, rad.
    g_sensitivity, g2_sensitivity : float
        rad/s per m/s^2 of force on each axis, and per (m/s^2)^2 along the axis.
    temperature_sensitivity : float
        rad/s per K.
    full_scale : float
        Largest rate that is measured, rad/s; 0 is no limit.

    Examples
    --------
    >>> GyroSpec(bias=5e-8, angle_random_walk=1e-6).white
    1e-06
    """

    WHITE: ClassVar[str] = "angle_random_walk"
    DRIFT: ClassVar[str] = "rate_random_walk"
    angle_random_walk: float = 0.0
    rate_random_walk: float = 0.0
    g_sensitivity: float = 0.0

    @property
    def white(self) -> float:
        """White noise of the rate, rad/sqrt(s)."""
        return self.angle_random_walk

    @property
    def drift(self) -> float:
        """Random walk of the rate, rad/s/sqrt(s)."""
        return self.rate_random_walk


@dataclass(frozen=True)
class AccelerometerSpec(_TriadSpec):
    """Errors of each accelerometer axis, 1-sigma, SI.

    Parameters
    ----------
    bias : float
        Turn-on bias, m/s^2.
    velocity_random_walk : float
        N, m/s/sqrt(s).
    quantisation : float
        Q, m/s.
    bias_instability : float
        B, m/s^2.
    acceleration_random_walk : float
        K, m/s^2/sqrt(s).
    gauss_markov, gauss_markov_time : float
        m/s^2 and s.
    scale_factor, scale_factor_asymmetry, misalignment, non_orthogonality : float
        As for gyros.
    g2_sensitivity : float
        m/s^2 per (m/s^2)^2.
    temperature_sensitivity : float
        m/s^2 per K.
    full_scale : float
        m/s^2; 0 is no limit.

    Examples
    --------
    >>> AccelerometerSpec(bias=1e-4, velocity_random_walk=5e-5).white
    5e-05
    """

    WHITE: ClassVar[str] = "velocity_random_walk"
    DRIFT: ClassVar[str] = "acceleration_random_walk"
    velocity_random_walk: float = 0.0
    acceleration_random_walk: float = 0.0

    @property
    def white(self) -> float:
        """White noise of the specific force, m/s/sqrt(s)."""
        return self.velocity_random_walk

    @property
    def drift(self) -> float:
        """Random walk of the specific force, m/s^2/sqrt(s)."""
        return self.acceleration_random_walk


#: key -> (dimension, customary unit)
_SHARED_KEYS = {
    "gauss_markov_time": ("time", "s"),
    "scale_factor": ("ratio", "ppm"),
    "scale_factor_asymmetry": ("ratio", "ppm"),
    "misalignment": ("angle", "arcsec"),
    "non_orthogonality": ("angle", "arcsec"),
}
_GYRO_KEYS = {
    "bias": ("angular rate", "deg/h"),
    "angle_random_walk": ("angle random walk", "deg/sqrt(h)"),
    "quantisation": ("angle", "arcsec"),
    "bias_instability": ("angular rate", "deg/h"),
    "rate_random_walk": ("rate random walk", "deg/h/sqrt(h)"),
    "gauss_markov": ("angular rate", "deg/h"),
    "g_sensitivity": ("angular rate per acceleration", "deg/h/g"),
    "g2_sensitivity": ("angular rate per acceleration squared", "deg/h/g^2"),
    "temperature_sensitivity": ("angular rate per temperature", "deg/h/K"),
    "full_scale": ("angular rate", "deg/s"),
    **_SHARED_KEYS,
}
_ACCEL_KEYS = {
    "bias": ("acceleration", "ug"),
    "velocity_random_walk": ("velocity random walk", "ug/sqrt(Hz)"),
    "quantisation": ("velocity", "mm/s"),
    "bias_instability": ("acceleration", "ug"),
    "acceleration_random_walk": ("acceleration random walk", "ug/sqrt(h)"),
    "gauss_markov": ("acceleration", "ug"),
    "g2_sensitivity": ("acceleration per acceleration squared", "ug/g^2"),
    "temperature_sensitivity": ("acceleration per temperature", "ug/K"),
    "full_scale": ("acceleration", "g"),
    **_SHARED_KEYS,
}


#: the next unit, for a number that reaches a thousand
_LARGER = {"ug": "mg", "deg/h": "deg/s", "ug/sqrt(Hz)": "mg/sqrt(Hz)", "mm/s": "m/s"}


def _with_unit(part: _TriadSpec, name: str, unit: str) -> str:
    """Return a figure, or those of x, y and z, in the customary unit or the next larger one."""
    if to_unit(getattr(part, name), unit) >= 1000.0:
        unit = _LARGER.get(unit, unit)
    values = part.by_axis(name)
    return text_of([values] if isinstance(values, float | int) else values.tolist(), unit)


@dataclass(frozen=True)
class ImuSpec:
    """An instrument: its gyros, its accelerometers, its name and where the numbers come from.

    Examples
    --------
    >>> own = sc.ImuSpec.from_dict(
    ...     {"gyro": {"bias": "0.01 deg/h"}, "accelerometer": {"bias": "50 ug"}}
    ... )
    >>> round(own.gyro.bias * 1e9, 3)
    48.481
    """

    gyro: GyroSpec
    accelerometer: AccelerometerSpec
    name: str = "custom"
    source: str = ""
    dropout: float = 0.0
    """Probability that a sample is lost."""

    @classmethod
    def from_dict(cls, data: dict[str, Any], name: str = "custom") -> ImuSpec:
        """Make a spec from ``{"gyro": {"bias": "0.01 deg/h", ...}, "accelerometer": {...}}``.

        Raises
        ------
        InputError
            For an unknown key, a value without a unit or of another dimension, a negative
            value, or a missing section.
        """
        extra = set(data) - {"gyro", "accelerometer", "name", "source", "dropout"}
        if extra:
            raise InputError(
                f"instrument specification: unknown key '{sorted(extra)[0]}'; "
                "known: name, source, dropout, [gyro], [accelerometer]"
            )
        parts: list[dict[str, Any]] = []
        for section, keys in (("gyro", _GYRO_KEYS), ("accelerometer", _ACCEL_KEYS)):
            table = data.get(section)
            if not isinstance(table, dict):
                raise InputError(f"instrument specification: the section [{section}] is missing")
            values: dict[str, float] = {}
            ratios: list[tuple[str, Ratios]] = []
            for key, text in table.items():
                if key not in keys:
                    raise InputError(
                        f"instrument specification: unknown key '{section}.{key}'; "
                        f"known: {', '.join(keys)}"
                    )
                value, each = parse_figure(text, keys[key][0], f"{section}.{key}")
                values[key] = value
                if each is not None:
                    ratios.append((key, each))
            parts.append({**values, "ratios": tuple(ratios)})
        dropout = parse(data["dropout"], "ratio", "dropout") if "dropout" in data else 0.0
        if not 0.0 <= dropout < 0.5:
            raise InputError(
                f"instrument specification: dropout = '{data['dropout']}' must be from 0 to 50 %"
            )
        with located("instrument specification"):
            gyro, accelerometer = GyroSpec(**parts[0]), AccelerometerSpec(**parts[1])
        return cls(
            gyro,
            accelerometer,
            name=str(data.get("name", name)),
            source=str(data.get("source", "")),
            dropout=dropout,
        )

    @classmethod
    def from_toml(cls, path: str | Path) -> ImuSpec:
        """Read a spec from a TOML file with unit-bearing strings.

        Raises
        ------
        InputError
            If the file cannot be read, is not TOML, or holds a bad value.
        """
        path = Path(path)
        data = read_toml(path)
        with located(path):
            return cls.from_dict(data, name=path.stem)

    def with_white_noise(self, factor: float) -> ImuSpec:
        """Return the same instrument with its angle and velocity random walk times a factor.

        Examples
        --------
        >>> round(spec.with_white_noise(2.0).gyro.white / spec.gyro.white, 6)
        2.0
        """
        walk = factor * self.gyro.angle_random_walk
        return replace(
            self,
            gyro=replace(self.gyro, angle_random_walk=walk),
            accelerometer=replace(
                self.accelerometer,
                velocity_random_walk=factor * self.accelerometer.velocity_random_walk,
            ),
        )

    def describe(self) -> dict[str, dict[str, str]]:
        """Return the spec in customary units, as `from_dict` would take it.

        Examples
        --------
        >>> sorted(spec.describe())
        ['accelerometer', 'gyro']
        """
        out: dict[str, dict[str, str]] = {}
        for section, part, keys in (
            ("gyro", self.gyro, _GYRO_KEYS),
            ("accelerometer", self.accelerometer, _ACCEL_KEYS),
        ):
            out[section] = {
                f.name: _with_unit(part, f.name, keys[f.name][1])
                for f in fields(part)
                if f.name != "ratios" and getattr(part, f.name) > 0
            }
        return out


#: named grades, 1-sigma figures with their sources
GRADES: dict[str, ImuSpec] = {
    name: ImuSpec.from_dict(table, name) for name, table in GRADE_TABLES.items()
}


def load_spec(spec: str | Path | ImuSpec | None) -> ImuSpec | None:
    """Return a spec from a grade's name, a TOML file, or pass one through.

    Raises
    ------
    InputError
        If it is neither a known grade nor a readable file.

    Examples
    --------
    >>> sc.load_spec("tactical-fog").name
    'tactical-fog'
    """
    if spec is None or isinstance(spec, ImuSpec):
        return spec
    text = str(spec)
    if text in GRADES:
        return GRADES[text]
    if text.endswith(".toml") or Path(text).exists():
        return ImuSpec.from_toml(text)
    raise InputError(
        f"'{text}' is neither a grade ({', '.join(GRADES)}) nor a TOML file with a specification"
        + near(text, GRADES)
    )
