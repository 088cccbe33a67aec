"""Schemes of rotation modulation by name, and from a file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from schuler.errors import InputError
from schuler.motion.rotation import Limits, Scheme
from schuler.motion.turntable import Dwell, Spin, Turn

__all__ = ["SCHEMES", "load_scheme", "named_scheme"]


#: names of half turns: axis and sign
_TurnList = list[tuple[str, float]]

#: the classical eight (Levinson): each half turn is undone the same way
_EIGHT: _TurnList = [("psi", 180), ("gamma", 180), ("psi", -180), ("gamma", -180)]


def _positions(turns: _TurnList, dwell: float, limits: Limits) -> tuple[Dwell | Turn, ...]:
    steps: list[Dwell | Turn] = []
    for axis, angle in turns:
        steps += [Dwell(dwell), Turn(axis, float(angle), limits.rate, limits.acceleration)]
    return tuple(steps)


def _mirrored(turns: _TurnList) -> _TurnList:
    return [(axis, -angle) for axis, angle in turns]


def _swapped(turns: _TurnList) -> _TurnList:
    return [("gamma" if axis == "psi" else "psi", angle) for axis, angle in turns]


def _two_axis(count: int) -> _TurnList:
    turns = _EIGHT
    if count == 8:
        return turns + _mirrored(turns)
    sixteen = turns + _mirrored(turns) + _swapped(turns) + _mirrored(_swapped(turns))
    if count == 16:
        return sixteen
    back = [(axis, -angle) for axis, angle in reversed(sixteen)]
    return sixteen + back + _mirrored(sixteen) + _mirrored(back)


#: name -> what it is
SCHEMES = {
    "fixed": "no rotation",
    "continuous": "one way round psi, for ever",
    "reciprocating": "a turn of psi each way, from the middle of one",
    "reciprocating-from-end": "a turn of psi each way, from its end (leaves a mean heading error)",
    "four-position": "psi to 180, 270, 90 and 0 deg with dwells",
    "two-axis-8": "eight half turns about psi and gamma with dwells",
    "two-axis-16": "sixteen half turns, with the axes' order exchanged",
    "two-axis-64": "sixty-four half turns, mirrored and backwards",
}


def named_scheme(
    name: str, *, dwell: float | None = None, limits: Limits | None = None, clockwise: bool = False
) -> Scheme:
    """Return a scheme by its name in `SCHEMES`.

    Parameters
    ----------
    name : str
    dwell : float, optional
        Between turns, s, for schemes that have dwells: 60, or 20 for two axes, whose long rounds
        must stay well below the Schuler period.
    limits : Limits, optional
    clockwise : bool
        The first turn is clockwise as seen along -z, and every other one likewise the other way.

    Raises
    ------
    InputError
        For an unknown name, or limits that it breaks.

    Examples
    --------
    >>> named_scheme("four-position", dwell=60.0).period
    298.0
    """
    t = limits or Limits()
    if dwell is None:
        dwell = 20.0 if name.startswith("two-axis") else 60.0
    steps: tuple[Dwell | Turn | Spin, ...]
    if name == "fixed":
        steps = (Dwell(dwell),)
    elif name == "continuous":
        steps = (Spin("psi", t.rate, 360.0 / t.rate),)
    elif name == "reciprocating":
        steps = tuple(Turn("psi", a, t.rate, t.acceleration) for a in (180.0, -360.0, 180.0))
    elif name == "reciprocating-from-end":
        steps = tuple(Turn("psi", a, t.rate, t.acceleration) for a in (360.0, -360.0))
    elif name == "four-position":
        steps = _positions([("psi", 180), ("psi", 90), ("psi", -180), ("psi", -90)], dwell, t)
    elif name.startswith("two-axis-") and name in SCHEMES:
        steps = _positions(_two_axis(int(name.rpartition("-")[2])), dwell, t)
    else:
        raise InputError(f"'{name}' is no scheme; there are {', '.join(SCHEMES)}")
    if clockwise:
        steps = tuple(_other_way(step) for step in steps)
        name += ", clockwise first"
    return Scheme(name, steps, t)


def _other_way(step: Dwell | Turn | Spin) -> Dwell | Turn | Spin:
    if isinstance(step, Turn):
        return replace(step, angle=-step.angle)
    return replace(step, rate=-step.rate) if isinstance(step, Spin) else step


def load_scheme(scheme: str | Path | Scheme, *, limits: Limits | None = None) -> Scheme:
    """Return a scheme by name, from a TOML file, or pass one through.

    Raises
    ------
    InputError
        If it is neither.

    Examples
    --------
    >>> load_scheme("two-axis-16").name
    'two-axis-16'
    """
    if isinstance(scheme, Scheme):
        return scheme if limits is None else replace(scheme, limits=limits)
    text = str(scheme)
    if text in SCHEMES:
        return named_scheme(text, limits=limits)
    if text.endswith(".toml"):
        return Scheme.from_toml(text)
    raise InputError(f"'{text}' is neither a scheme ({', '.join(SCHEMES)}) nor a TOML file")
