"""The field's units by a small closed table: ``"0.01 deg/h"`` to SI and back.

The table is closed on purpose: an unknown unit is an error that lists the known ones, never a
guess. It is tested against Pint. ``g`` is the standard gravity 9.80665 m/s^2.
"""

from __future__ import annotations

import math
import re

from schuler.constants import ARCMIN, ARCSEC, DEG, STANDARD_GRAVITY
from schuler.errors import InputError, near

__all__ = [
    "UNITS",
    "convert",
    "dimension_of",
    "known_unit",
    "parse",
    "parse_factor",
    "percent",
    "significant",
    "time_text",
    "to_unit",
]  # fmt: skip

_H = 3600.0
_SQRT_H = 60.0
_UG = 1e-6 * STANDARD_GRAVITY
_MG = 1e-3 * STANDARD_GRAVITY

#: unit -> (factor to SI, dimension)
UNITS: dict[str, tuple[float, str]] = {
    "s": (1.0, "time"),
    "ms": (1e-3, "time"),
    "us": (1e-6, "time"),
    "ns": (1e-9, "time"),
    "min": (60.0, "time"),
    "h": (_H, "time"),
    "Hz": (1.0, "frequency"),
    "kHz": (1e3, "frequency"),
    "m": (1.0, "length"),
    "mm": (1e-3, "length"),
    "km": (1e3, "length"),
    "rad": (1.0, "angle"),
    "mrad": (1e-3, "angle"),
    "urad": (1e-6, "angle"),
    "deg": (DEG, "angle"),
    "arcmin": (ARCMIN, "angle"),
    "arcsec": (ARCSEC, "angle"),
    "rad/s": (1.0, "angular rate"),
    "mrad/s": (1e-3, "angular rate"),
    "deg/s": (DEG, "angular rate"),
    "mdeg/s": (1e-3 * DEG, "angular rate"),
    "deg/h": (DEG / _H, "angular rate"),
    "rad/h": (1.0 / _H, "angular rate"),
    "arcsec/s": (ARCSEC, "angular rate"),
    "rad/sqrt(s)": (1.0, "angle random walk"),
    "rad/s/sqrt(Hz)": (1.0, "angle random walk"),
    "deg/sqrt(s)": (DEG, "angle random walk"),
    "deg/sqrt(h)": (DEG / _SQRT_H, "angle random walk"),
    "deg/s/sqrt(Hz)": (DEG, "angle random walk"),
    "deg/h/sqrt(Hz)": (DEG / _H, "angle random walk"),
    "rad/s/sqrt(s)": (1.0, "rate random walk"),
    "deg/h/h": (DEG / _H / _H, "angular acceleration"),
    "deg/h/sqrt(h)": (DEG / _H / _SQRT_H, "rate random walk"),
    "deg/s/sqrt(h)": (DEG / _SQRT_H, "rate random walk"),
    "m/s": (1.0, "velocity"),
    "mm/s": (1e-3, "velocity"),
    "m/s^2": (1.0, "acceleration"),
    "mm/s^2": (1e-3, "acceleration"),
    "g": (STANDARD_GRAVITY, "acceleration"),
    "mg": (_MG, "acceleration"),
    "ug": (_UG, "acceleration"),
    "mGal": (1e-5, "acceleration"),
    "g*s": (STANDARD_GRAVITY, "velocity"),
    "mg*s": (_MG, "velocity"),
    "ug*s": (_UG, "velocity"),
    "m/s/sqrt(s)": (1.0, "velocity random walk"),
    "m/s^2/sqrt(Hz)": (1.0, "velocity random walk"),
    "m/s/sqrt(h)": (1.0 / _SQRT_H, "velocity random walk"),
    "g/sqrt(Hz)": (STANDARD_GRAVITY, "velocity random walk"),
    "mg/sqrt(Hz)": (_MG, "velocity random walk"),
    "ug/sqrt(Hz)": (_UG, "velocity random walk"),
    "m/s^2/sqrt(s)": (1.0, "acceleration random walk"),
    "ug/sqrt(s)": (_UG, "acceleration random walk"),
    "ug/h": (_UG / _H, "acceleration ramp"),
    "ug/sqrt(h)": (_UG / _SQRT_H, "acceleration random walk"),
    "m/s^2/sqrt(h)": (1.0 / _SQRT_H, "acceleration random walk"),
    "K": (1.0, "temperature"),
    "K/s": (1.0, "temperature rate"),
    "K/min": (1.0 / 60.0, "temperature rate"),
    "K/h": (1.0 / _H, "temperature rate"),
    "deg/h/K": (DEG / _H, "angular rate per temperature"),
    "deg/s/K": (DEG, "angular rate per temperature"),
    "m/s^2/K": (1.0, "acceleration per temperature"),
    "ug/K": (_UG, "acceleration per temperature"),
    "mg/K": (_MG, "acceleration per temperature"),
    "deg/h/g": (DEG / _H / STANDARD_GRAVITY, "angular rate per acceleration"),
    "deg/s/g": (DEG / STANDARD_GRAVITY, "angular rate per acceleration"),
    "deg/h/g^2": (DEG / _H / STANDARD_GRAVITY**2, "angular rate per acceleration squared"),
    "deg/s/g^2": (DEG / STANDARD_GRAVITY**2, "angular rate per acceleration squared"),
    "ug/g^2": (_UG / STANDARD_GRAVITY**2, "acceleration per acceleration squared"),
    "mg/g^2": (_MG / STANDARD_GRAVITY**2, "acceleration per acceleration squared"),
    "ppm": (1e-6, "ratio"),
    "%": (1e-2, "ratio"),
    "1": (1.0, "ratio"),
}

_SPELLINGS = {
    "°": "deg", "degrees": "deg", "degree": "deg", "radians": "rad", "radian": "rad",
    "dps": "deg/s", "mdps": "mdeg/s", "degps": "deg/s", "radps": "rad/s", "dph": "deg/h",
    "hr": "h", "hour": "h", "hours": "h", "minutes": "min",
    "sec": "s", "secs": "s", "second": "s", "seconds": "s",
    "msec": "ms", "millis": "ms", "millisecond": "ms", "milliseconds": "ms",
    "usec": "us", "micros": "us", "microsecond": "us", "microseconds": "us",
    "nsec": "ns", "nanos": "ns", "nanosecond": "ns", "nanoseconds": "ns",
    "rtHz": "sqrt(Hz)", "√Hz": "sqrt(Hz)", "√h": "sqrt(h)", "√s": "sqrt(s)", "rthr": "sqrt(h)",
    "µ": "u", "μ": "u", "²": "^2", "**2": "^2", "·": "*",
    "m/s2": "m/s^2", "m/s/s": "m/s^2", "mps2": "m/s^2", "mps^2": "m/s^2",
}  # fmt: skip

_LONGEST = 200
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.DOTALL)


def _number(text: str, what: str) -> re.Match[str] | None:
    # The pattern tries many ways to divide a long text.
    if len(text) > _LONGEST:
        raise InputError(f"{what}: '{text[:40]}...' is too long for a number and a unit")
    return _NUMBER.fullmatch(text)


#: "rad s^-1", "m s-2", "m·s**-2": powers of a time that divides
_POWERS = re.compile(r"(?<=[A-Za-z°])\s*[*·.\s]\s*(s|h|sec|hr)\s*(?:\^|\*\*)?\s*\(?-([12])\)?")


def _normalise(unit: str) -> str:
    text = _POWERS.sub(lambda m: f"/{m[1]}" + ("^2" if m[2] == "2" else ""), unit.strip())
    # A capital G is what sensors' makers write; gauss is no unit of this table.
    text = {"G": "g", "mG": "mg"}.get(text, text)
    text = text.replace(" ", "").replace("(deg/h)", "deg/h").replace("(m/s)", "m/s")
    if text in UNITS:
        return text
    for other, ours in _SPELLINGS.items():
        # A letter spelling must stand alone: "hr" in "deg/hr", not in "through".
        pattern = re.escape(other)
        if other.isalpha() and other.isascii():
            pattern = rf"(?<![A-Za-z]){pattern}(?![A-Za-z])"
        elif other.startswith("m/s"):
            pattern = rf"{pattern}(?![0-9])" if other == "m/s2" else rf"{pattern}(?!qrt)"
        elif other.startswith("mps"):
            pattern = rf"(?<![A-Za-z]){pattern}(?![0-9])"
        text = re.sub(pattern, ours, text)
    return text


def _lookup(unit: str, what: str, dimensions: tuple[str, ...] = ()) -> tuple[float, str]:
    entry = UNITS.get(_normalise(unit))
    if entry is None:
        fitting = [name for name, (_, kind) in UNITS.items() if kind in dimensions]
        known = ", ".join(fitting or sorted(UNITS, key=str.lower))
        near_one = near(unit, fitting or UNITS)
        raise InputError(f"{what}: unknown unit '{unit}'{near_one}; known units: {known}")
    return entry


def known_unit(text: str) -> bool:
    """Say whether a text is a unit of the table, in any of its spellings.

    Examples
    --------
    >>> known_unit("deg/h"), known_unit("furlong")
    (True, False)
    """
    return _normalise(text) in UNITS


def dimension_of(unit: str) -> str:
    """Name the dimension of a unit, as ``"angular rate"`` for ``"deg/h"``.

    Raises
    ------
    InputError
        If the unit is not in the table.

    Examples
    --------
    >>> dimension_of("deg/h")
    'angular rate'
    """
    return _lookup(unit, "unit")[1]


def parse(text: str, dimension: str, what: str = "value") -> float:
    """Turn ``"0.01 deg/h"`` into SI (rad/s), checking that it has the wanted dimension.

    Parameters
    ----------
    text : str
        A number and a unit.
    dimension : str
        The wanted dimension, as named in `UNITS`.
    what : str
        What the value is, for the error text.

    Raises
    ------
    InputError
        If there is no number, no unit, an unknown unit or a unit of another dimension.

    Examples
    --------
    >>> from schuler.units import parse
    >>> round(parse("0.01 deg/h", "angular rate") * 1e9, 3)
    48.481
    """
    if not isinstance(text, str):
        raise InputError(f"{what}: expected a text like '0.01 deg/h', got {text!r}")
    match = _number(text, what)
    if match is None:
        raise InputError(f"{what}: expected a number and a unit of {dimension}, got '{text}'")
    number, unit = match.groups()
    if not unit:
        raise InputError(f"{what}: '{text}' has no unit; say one of {_units_of(dimension)}")
    factor, found = _lookup(unit, what, (dimension,))
    if found != dimension:
        raise InputError(
            f"{what}: '{text}' is of {found}, expected {dimension} ({_units_of(dimension)})"
        )
    value = float(number) * factor
    if not math.isfinite(value):
        raise InputError(f"{what}: '{text}' is not a finite number")
    return value


def parse_factor(text: str, dimensions: tuple[str, ...], what: str) -> tuple[float, str]:
    """Turn a unit, with or without a number (``"deg/s"``, ``"0.05 deg/s"``), into a factor to SI.

    Returns
    -------
    (float, str)
        Factor and dimension.

    Raises
    ------
    InputError
        If the unit is unknown, of none of the dimensions, or the number is zero.

    Examples
    --------
    >>> parse_factor("km", ("length",), "height")
    (1000.0, 'length')
    """
    match = _number(text, what)
    number, unit = match.groups() if match and match.group(2) else ("1", text.strip())
    factor, found = _lookup(unit, what, dimensions)
    if found not in dimensions:
        options = " or ".join(f"{d} ({_units_of(d)})" for d in dimensions)
        raise InputError(f"{what}: '{text}' is of {found}, expected {options}")
    factor *= float(number)
    if not (math.isfinite(factor) and factor != 0.0):
        raise InputError(f"{what}: the scale '{text}' must be a finite number other than zero")
    return factor, found


def to_unit(value: float, unit: str) -> float:
    """Express an SI value in a unit: ``to_unit(4.85e-8, "deg/h")`` is 0.01.

    Examples
    --------
    >>> round(to_unit(4.848e-8, "deg/h"), 4)
    0.01
    """
    return value / _lookup(unit, "unit")[0]


def convert(value: float, from_unit: str, to: str) -> float:
    """Convert between two units of one dimension.

    Raises
    ------
    InputError
        If the dimensions differ.

    Examples
    --------
    >>> from schuler.units import convert
    >>> round(convert(0.01, "deg/h", "rad/s"), 12)
    4.8481e-08
    """
    a, b = _lookup(from_unit, "unit"), _lookup(to, "unit")
    if a[1] != b[1]:
        raise InputError(f"cannot convert {a[1]} ('{from_unit}') to {b[1]} ('{to}')")
    return value * a[0] / b[0]


def time_text(seconds: float) -> str:
    """Return an instant for a message: nine digits, and never less than hundredths of a second.

    A Unix time has ten digits before its point: ``1700000059.99``, not ``1.70000006e+09``.

    Examples
    --------
    >>> from schuler.units import time_text
    >>> time_text(90.0)
    '90'
    """
    if abs(seconds) < 1e6 or not math.isfinite(seconds):
        return f"{seconds:.9g}"
    text = f"{seconds:.6f}".rstrip("0")
    whole, _, decimals = text.partition(".")
    return f"{whole}.{decimals:0<2}" if abs(seconds) < 1e16 else f"{seconds:.17g}"


def percent(share: float) -> str:
    """Return a share as ``12 %``: two digits, and no power of ten for a large one.

    Examples
    --------
    >>> percent(1.0), percent(0.0316)
    ('100 %', '3.2 %')
    """
    value = 100.0 * float(share)
    return f"{value:.0f} %" if abs(value) >= 9.95 else f"{value:.2g} %"


def significant(value: float, digits: int) -> str:
    """Return a number of so many digits, and no power of ten for one below a million.

    Examples
    --------
    >>> significant(234.5, 2), significant(0.02345, 2), significant(3.0, 2)
    ('230', '0.023', '3')
    """
    text = f"{float(value):.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(float(text)) < 1e6 else text


def _units_of(dimension: str) -> str:
    return ", ".join(u for u, (_, d) in UNITS.items() if d == dimension)
