"""Conditions of the experiments: data of their own, what of it can be set, and to which values."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from dataclasses import replace
from importlib.resources import files
from typing import Any

import numpy as np

from schuler.errors import InputError
from schuler.sensors import ImuSpec, load_spec

__all__ = ["changeable", "conditions", "instrument"]


def _read(name: str) -> dict[str, Any]:
    text = files("schuler.published").joinpath("data", f"{name}.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


_FIXED = ("title", "citation", "errata", "printed", "case", "runs", "optional", "fixed", "range")
"""What a document says, and what has an option of its own."""


def changeable(name: str) -> dict[str, Any]:
    """Return the conditions of an experiment that can be changed, with their values.

    A condition that nothing is said of (what the instrument's grade has) is None.

    Examples
    --------
    >>> sorted(changeable("xu2017"))[:2]
    ['plant.attitude_prior', 'plant.force']
    """
    out: dict[str, Any] = {}

    def walk(table: dict[str, Any], prefix: str) -> None:
        for key, value in table.items():
            if isinstance(value, dict):
                walk(value, f"{prefix}{key}.")
            elif not (isinstance(value, list) and value and isinstance(value[0], dict)):
                out[f"{prefix}{key}"] = value

    data = _read(name)
    walk({key: value for key, value in data.items() if key not in _FIXED}, "")
    for key in data.get("optional", {}):
        out.setdefault(key, None)
    for key in data.get("fixed", ()):
        del out[key]
    return out


def _fits(value: Any, own: Any) -> bool:
    """Whether a value is of the kind that a condition has."""
    if isinstance(own, bool) or isinstance(value, bool):
        return isinstance(own, bool) and isinstance(value, bool)
    if isinstance(own, int | float):
        return isinstance(value, int | float) and np.isfinite(value)
    if isinstance(own, list):
        if not (isinstance(value, list) and value and all(_fits(v, own[0]) for v in value)):
            return False
        # A pair stays a pair.
        return not isinstance(own[0], list) or all(len(v) == len(own[0]) for v in value)
    return isinstance(value, type(own))


def _between(value: Any, low: float, high: float) -> bool:
    """Whether a number, or each of a list, lies within a range; texts are looked at elsewhere."""
    if isinstance(value, list):
        return all(_between(each, low, high) for each in value)
    return isinstance(value, str) or low <= value <= high


def conditions(name: str, changes: Iterable[tuple[str, Any]] = ()) -> dict[str, Any]:
    """Return the conditions of an experiment, and what its document prints, from its TOML.

    Parameters
    ----------
    name : str
    changes : iterable of (str, value)
        Conditions to set, as ``("site.lat", 50.0)``.

    Raises
    ------
    InputError
        For a condition that the experiment does not have, or a value of another kind.

    Examples
    --------
    >>> conditions("niu2025", [("site.lat", 50.0)])["site"]["lat"]
    50.0
    """
    data = _read(name)
    known = changeable(name)
    for key, value in changes:
        if key not in known:
            raise InputError(
                f"{name} has no condition '{key}' that can be set; it has {', '.join(known)}"
            )
        own = known[key] if known[key] is not None else data["optional"][key]
        if not _fits(value, own):
            raise InputError(f"{name}: {key} must be like {own!r}, got {value!r}")
        low, high = data.get("range", {}).get(key, (-np.inf, np.inf))
        if not isinstance(value, str | bool) and not _between(value, low, high):
            raise InputError(f"{name}: {key} must be from {low:g} to {high:g}, got {value!r}")
        table = data
        *path, last = key.split(".")
        for part in path:
            table = table.setdefault(part, {})
        table[last] = value
    return data


def instrument(case: dict[str, Any], name: str) -> ImuSpec:
    """Return the instrument of an experiment: its grade, and what [gyro] and [accelerometer] say.

    Raises
    ------
    InputError
        For a value without a unit or of another dimension, or a key that no instrument has.
    """
    given = {part: case.get(part, {}) for part in ("gyro", "accelerometer")}
    told = ImuSpec.from_dict(given, name)
    grade = load_spec(case.get("simulation", {}).get("grade"))
    if grade is None:
        return told

    def over(own: Any, new: Any, keys: Iterable[str]) -> Any:
        return replace(own, **{key: getattr(new, key) for key in keys})

    return replace(
        grade, gyro=over(grade.gyro, told.gyro, given["gyro"]),
        accelerometer=over(grade.accelerometer, told.accelerometer, given["accelerometer"]),
    )  # fmt: skip
