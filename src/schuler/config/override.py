"""Values set from outside a scenario file: ``motion.heading=30``, and sweeps of several."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from schuler._files import parse_toml
from schuler.errors import InputError
from schuler.sensors import GRADES, ImuSpec
from schuler.sensors.by_axis import text_of

__all__ = ["apply", "parse_overrides", "parse_sweep", "spec_table"]


def spec_table(spec: ImuSpec) -> dict[str, Any]:
    """Return a specification as the table that `ImuSpec.from_dict` reads, with all its digits."""
    import numpy as np

    out: dict[str, Any] = {"name": spec.name, "source": spec.source}
    customary = spec.describe()
    for section, part in (("gyro", spec.gyro), ("accelerometer", spec.accelerometer)):
        units = {key: text.rsplit(" ", 1)[1] for key, text in customary[section].items()}
        values = {key: np.atleast_1d(part.by_axis(key)).tolist() for key in units}
        out[section] = {key: text_of(values[key], unit, None) for key, unit in units.items()}
    if spec.dropout:
        out["dropout"] = f"{spec.dropout!r} 1"
    return out


def _value(text: str) -> Any:
    """Return a value as TOML would, or the text itself where it is no TOML: ``60 s``."""
    text = text.strip()
    try:
        return parse_toml(f"x = {text}")["x"] if "\n" not in text else text
    except ValueError:
        return text


def _split(text: str) -> list[str]:
    """Split at commas that stand in no bracket and no quotes."""
    parts, depth, quote = [""], 0, ""
    for c in text:
        if quote:
            quote = "" if c == quote else quote
        elif c in "\"'":
            quote = c
        elif c in "[{":
            depth += 1
        elif c in "]}":
            depth -= 1
        elif c == "," and depth == 0:
            parts.append("")
            continue
        parts[-1] += c
    return parts


def _pairs(texts: Iterable[str], option: str) -> list[tuple[str, str]]:
    out: list[tuple[str, str]] = []
    for text in texts:
        key, mark, value = text.partition("=")
        key = key.strip()
        if not mark or not key or not value.strip():
            raise InputError(f"{option} {text}: expected key=value, such as motion.heading=30")
        if key in (k for k, _ in out):
            raise InputError(f"{option} {key}: is said twice")
        out.append((key, value))
    return out


def parse_overrides(texts: Iterable[str], option: str = "--set") -> dict[str, Any]:
    """Turn ``["motion.heading=30"]`` into ``{"motion.heading": 30}``.

    Raises
    ------
    InputError
        For a text that is no ``key=value``, or a key that comes twice.

    Examples
    --------
    >>> parse_overrides(["motion.heading=30"])
    {'motion.heading': 30}
    """
    return {key: _value(value) for key, value in _pairs(texts, option)}


def parse_sweep(texts: Iterable[str], option: str = "--sweep") -> dict[str, tuple[Any, ...]]:
    """Turn ``["motion.heading=0,90"]`` into ``{"motion.heading": (0, 90)}``.

    Commas inside brackets and quotes do not separate.

    Raises
    ------
    InputError
        As `parse_overrides`, and for an empty or repeated value.

    Examples
    --------
    >>> parse_sweep(["motion.heading=0,90"])
    {'motion.heading': (0, 90)}
    """
    out: dict[str, tuple[Any, ...]] = {}
    for key, text in _pairs(texts, option):
        parts = _split(text)
        if not all(part.strip() for part in parts):
            raise InputError(f"{option} {key}={text}: a value between the commas is missing")
        values = tuple(_value(part) for part in parts)
        if len({json.dumps(v, default=str) for v in values}) != len(values):
            raise InputError(f"{option} {key}={text}: a value comes twice")
        out[key] = values
    return out


def apply(data: dict[str, Any], overrides: Mapping[str, Any]) -> None:
    """Set values in a file's tables, in place; ``with.0`` is an array's first element.

    Raises
    ------
    InputError
        For a path that leads into something that is no table.
    """
    for path, value in overrides.items():
        keys = path.split(".")
        where: Any = data
        for k, key in enumerate(keys):
            last = k == len(keys) - 1
            if isinstance(where, list):
                if not key.isdigit() or int(key) >= len(where):
                    raise InputError(
                        f"{path}: expected a number from 0 to {len(where) - 1} in the place of "
                        f"'{key}', because {'.'.join(keys[:k])} is an array"
                    )
                place: Any = int(key)
            elif isinstance(where, dict):
                place = key
                if not last and isinstance(where.get(key), str) and where[key] in GRADES:
                    # A figure of a named instrument is changed: write the instrument out.
                    where[key] = spec_table(GRADES[where[key]])
                    where[key]["name"] += ", changed"
                if not last:
                    where.setdefault(key, {})
            else:
                raise InputError(
                    f"{path}: cannot be set, because {'.'.join(keys[:k])} is {where!r} and no table"
                )
            if last:
                where[place] = value
            else:
                where = where[place]
