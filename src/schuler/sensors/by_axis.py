"""Figures of a specification that differ from axis to axis: one number and its ratios.

A specification has one value of each figure, the rms over the axes, which everything can use that
takes the axes for equal. Where axes differ, their ratios to it stand beside it, so that a value
that is scaled or replaced keeps what is known of the axes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from schuler.errors import InputError
from schuler.units import parse, to_unit

__all__ = ["Ratios", "parse_figure", "ratios_of", "rms", "text_of"]

Ratios = tuple[float, float, float]

_AXES = 3


def rms(values: Sequence[float]) -> float:
    """Return the root mean square.

    Examples
    --------
    >>> rms([3.0, 0.0, 4.0]) == (25.0 / 3.0) ** 0.5
    True
    """
    if min(values) == max(values):
        return float(values[0])
    return math.sqrt(math.fsum(v * v for v in values) / len(values))


def ratios_of(values: Sequence[float]) -> Ratios | None:
    """Return the ratios of x, y and z to their rms; None where they are equal.

    Examples
    --------
    >>> ratios_of([2.0, 2.0, 2.0]) is None
    True
    """
    x, y, z = map(float, values)
    whole = rms((x, y, z))
    if x == y == z or not math.isfinite(whole):
        return None
    return x / whole, y / whole, z / whole


def parse_figure(given: Any, dimension: str, what: str) -> tuple[float, Ratios | None]:
    """Return a figure in SI and its ratios, of one text or of three values.

    Parameters
    ----------
    given : str or list of str
        ``"0.3 deg/h"``; ``"0.3, 0.2, 0.4 deg/h"``, x, y and z; or a list of three such texts.
    dimension, what : str
        As of `schuler.units.parse`.

    Raises
    ------
    InputError
        If there are not one or three values, or one is negative or not understood.

    Examples
    --------
    >>> value, ratios = parse_figure("3, 0, 4 deg/h", "angular rate", "gyro.bias")
    >>> [round(r, 3) for r in ratios]
    [1.039, 0.0, 1.386]
    """
    texts = given
    if isinstance(given, str) and given.count(",") == _AXES - 1:
        texts = [part.strip() for part in given.split(",")]
        unit = texts[-1].partition(" ")[2].strip()
        # The unit that stands last is that of all numbers without one.
        texts = [t if " " in t else f"{t} {unit}" for t in texts]
    if not isinstance(texts, list):
        texts = [texts]
    if len(texts) not in (1, _AXES):
        raise InputError(f"{what}: expected one value, or three (x, y, z), got {len(texts)}")
    values = [parse(text, dimension, what) for text in texts]
    if min(values) < 0.0:
        raise InputError(
            f"instrument specification: {what} = '{given}' is negative; give a 1-sigma magnitude"
        )
    if len(values) == 1:
        return values[0], None
    return rms(values), ratios_of(values)


def text_of(values: Sequence[float], unit: str, digits: int | None = 4) -> str:
    """Return figures with their unit as `parse_figure` takes them; `digits` None is all of them.

    Examples
    --------
    >>> text_of([1.0, 2.0, 3.0], "m/s^2")
    '1, 2, 3 m/s^2'
    """
    numbers = [to_unit(v, unit) for v in values]
    shown = [repr(float(n)) if digits is None else f"{n:.{digits}g}" for n in numbers]
    return f"{', '.join(shown)} {unit}"
