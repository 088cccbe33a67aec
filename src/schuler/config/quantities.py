"""The values of a scenario file: numbers with units, triples and bands.

A quantity with one customary unit may be a bare number in it: degrees for attitudes,
metres for places. All others need their unit.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field

from schuler.constants import DEG
from schuler.errors import InputError
from schuler.units import parse

__all__ = [
    "Acceleration",
    "AngularRate",
    "Band2",
    "Count",
    "Degrees",
    "DegreesTriple",
    "Metres",
    "MetresTriple",
    "Number",
    "Positive",
    "PositiveTime",
    "RateHz",
    "Share",
    "Speed",
    "TemperatureRate",
    "Time",
    "Triple",
    "as_table",
    "deg_per_second",
]


def _shown(value: Any) -> str:
    text = repr(value) if not isinstance(value, dict) else "a table"
    return text if len(text) <= 60 else f"{text[:57]}..."


def _bare(value: Any, expected: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"expected {expected}, got {_shown(value)}")
    if not math.isfinite(value):
        raise ValueError(f"expected a finite number, got {value}")
    return float(value)


def _number(value: Any) -> float:
    return _bare(value, "a number")


def _whole(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError(f"expected a whole number, got {_shown(value)}")
    return value


def _quantity(dimension: str, example: str, bare: float | None = None) -> Any:
    """Return a validator to SI, or to the unit `bare`, in which a number needs no unit."""

    def check(value: Any) -> float:
        """Return a value in SI units."""
        if bare is not None and not isinstance(value, str):
            return _bare(value, f"a number or a text such as '{example}'")
        if not isinstance(value, str):
            raise ValueError(
                f"expected {dimension} with its unit, such as '{example}', got {_shown(value)}"
            )
        try:
            return parse(value, dimension, "\0") / (bare or 1.0)
        except InputError as error:
            raise ValueError(str(error).removeprefix("\0: ")) from None

    return BeforeValidator(check)


def _triple(spread: bool) -> Any:
    """Return a validator of three numbers; one number stands for all three where it may."""

    def check(value: Any) -> Any:
        if spread and isinstance(value, int | float | str) and not isinstance(value, bool):
            return (value, value, value)
        if not isinstance(value, list | tuple) or len(value) != 3:
            more = " (or one for all three)" if spread else ""
            raise ValueError(f"expected three numbers{more}, got {_shown(value)}")
        return tuple(value)

    return BeforeValidator(check)


def _pair(value: Any) -> Any:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise ValueError(f"expected two numbers, low and high, in Hz, got {_shown(value)}")
    return tuple(value)


def _ascending(value: tuple[float, float]) -> tuple[float, float]:
    if not 0 < value[0] <= value[1]:
        raise ValueError(f"expected 0 < low <= high in Hz, got {value[0]:g} to {value[1]:g}")
    return value


def as_table(value: Any) -> Any:
    """Refuse what is no table, in words."""
    if not isinstance(value, dict) and not hasattr(value, "model_fields_set"):
        raise ValueError(f"expected a table, got {_shown(value)}")
    return value


Number = Annotated[float, BeforeValidator(_number)]
Share = Annotated[float, Field(ge=0), BeforeValidator(_number)]
Positive = Annotated[float, Field(gt=0), BeforeValidator(_number)]
Count = Annotated[int, Field(ge=0), BeforeValidator(_whole)]
Time = Annotated[float, Field(ge=0), _quantity("time", "60 s")]
PositiveTime = Annotated[float, Field(gt=0), _quantity("time", "300 s")]
RateHz = Annotated[float, Field(gt=0), _quantity("frequency", "100 Hz")]
TemperatureRate = Annotated[float, _quantity("temperature rate", "1 K/min")]
AngularRate = Annotated[float, _quantity("angular rate", "10 deg/s")]
Acceleration = Annotated[float, _quantity("acceleration", "50 ug")]
Speed = Annotated[float, _quantity("velocity", "10 m/s", 1.0)]
Metres = Annotated[float, _quantity("length", "380 m", 1.0)]
Degrees = Annotated[float, _quantity("angle", "30 deg", DEG)]
Triple = Annotated[tuple[Share, Share, Share], _triple(True)]
MetresTriple = Annotated[tuple[Metres, Metres, Metres], _triple(False)]
DegreesTriple = Annotated[tuple[Degrees, Degrees, Degrees], _triple(False)]
Band2 = Annotated[tuple[Number, Number], AfterValidator(_ascending), BeforeValidator(_pair)]


def deg_per_second(value: float) -> float:
    """Return a rate in deg/s, as the motions take it."""
    return value / DEG
