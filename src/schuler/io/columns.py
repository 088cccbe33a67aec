"""Which column is what: by name, by number, by role, and units from bracketed header names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from schuler.errors import InputError
from schuler.io.mapping import SKIP, Mapping

__all__ = ["Chosen", "choose", "split_unit"]

_BRACKETS = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))\s*")

_STEMS = {
    "g": ("g", "gyr", "gyro", "gyroscope", "w", "omega", "angularvelocity", "angularrate"),
    "a": ("a", "acc", "accel", "accelerometer", "acceleration", "linearacceleration", "f",
          "force", "specificforce"),
}  # fmt: skip
_INCREMENT_STEMS = {
    "g": ("dtheta", "dang", "deltaangle", "deltatheta"),
    "a": ("dvel", "dv", "deltav", "deltavelocity"),
}
_TIMES = ("t", "time", "times", "timestamp", "sec", "seconds", "tow")
_ALIASES: dict[str, str] = dict.fromkeys(_TIMES, "t")
_INCREMENTS: set[str] = set()
for _sensor in "ga":
    for _axis in "xyz":
        for _stem in _STEMS[_sensor]:
            _ALIASES[_stem + _axis] = _sensor + _axis
        for _stem in _INCREMENT_STEMS[_sensor]:
            _ALIASES[_stem + _axis] = _sensor + _axis
            _INCREMENTS.add(_stem + _axis)
_GYROS = (*_STEMS["g"], *_INCREMENT_STEMS["g"])
_NUMBERED = re.compile(r"([a-z]+)(\d{1,2})")
_WORDS = {6: "six", 7: "seven"}


@dataclass(frozen=True)
class Chosen:
    """The columns to take from a file, counted from 0, and the units that their names carry.

    Parameters
    ----------
    t : int or None
        Column of time; None where the clock is made from the rate.
    values : tuple of six int
        Columns of gyro x, y, z and accelerometer x, y, z.
    dt : int or None
        Column of interval lengths, in files that have one.
    gyro, accel, time : str or None
        Units from bracketed names, or from names that can only be increments.
    t_label : str
        How to speak of the time column.
    """

    t: int | None
    values: tuple[int, ...]
    dt: int | None = None
    gyro: str | None = None
    accel: str | None = None
    time: str | None = None
    t_label: str = ""

    @property
    def all(self) -> tuple[int, ...]:
        """The columns to read, each once, in the file's order."""
        extra = [c for c in (self.t, self.dt) if c is not None]
        return tuple(sorted({*self.values, *extra}))

    def said(self) -> Mapping:
        """Return the units as a mapping."""
        return Mapping(gyro=self.gyro, accel=self.accel, time=self.time)


def split_unit(name: str) -> tuple[str, str | None]:
    """Split ``"gx [deg/s]"`` into ``("gx", "deg/s")``; None where nothing is in brackets.

    A single axis letter or number in brackets, ``"acc(x)"``, belongs to the name.
    """
    # One blank at a time: the pattern would try every place in a long run of them.
    name = " ".join(name.split())
    match = _BRACKETS.fullmatch(name)
    if match is None:
        return name, None
    base, unit = match.group(1), match.group(2) or match.group(3) or ""
    if re.fullmatch(r"\s*([xyzXYZ]|\d*)\s*", unit):
        return name, None
    return base.strip(), unit.strip()


def choose(names: Sequence[str] | None, count: int, mapping: Mapping) -> Chosen:
    """Work out the columns to take; the rules are those of `Mapping.columns`.

    Parameters
    ----------
    names : sequence of str or None
        The columns' names, where the file has them.
    count : int
        How many columns there are.
    mapping : Mapping
        `columns`, `rate`, `gyro`, `accel` and `time` are looked at.

    Raises
    ------
    InputError
        If a column is not there, is there twice, or cannot be told.
    """
    if names is None:
        picked = _without_names(count, mapping)
    elif mapping.columns is not None:
        picked = _picked(names, mapping.columns, mapping)
    else:
        picked = _recognised(names, mapping)
    roles = mapping.roles
    missing = [role for role in roles[1:] if role not in picked]
    if missing:
        listing = f"its columns are {_listing(names)}" if names else f"it has {count} columns"
        raise InputError(
            f"no column for {', '.join(missing)} was found; {listing}; "
            f"say which to take with --columns {','.join(roles)}"
        )
    t = picked.get("t")
    if t is None and mapping.rate is None:
        raise InputError(
            "there is no time column: name it with --columns, or give the rate with --rate"
        )
    values = tuple(picked[role] for role in roles[1:])
    if names is None:
        label = "" if t is None else f"column {t + 1}"
        return Chosen(t, values, t_label=label)
    # An exact interval column comes with increments that schuler wrote, or others like them.
    steps = [i for i, name in enumerate(names) if split_unit(name)[0].lower() == "dt"]
    return Chosen(
        t,
        values,
        steps[0] if len(steps) == 1 else None,
        _unit(names, values[:-3], "gyro", "rad", mapping.gyro),
        _unit(names, values[-3:], "accel", "m/s", mapping.accel),
        None if t is None or mapping.time else split_unit(names[t])[1],
        "" if t is None else f"column '{split_unit(names[t])[0]}'",
    )


def _without_names(count: int, mapping: Mapping) -> dict[str, int]:
    columns, roles = mapping.columns, mapping.roles
    if columns is None:
        if count == len(roles):
            return {role: i for i, role in enumerate(roles)}
        if count == len(roles) - 1 and mapping.rate is not None:
            return {role: i for i, role in enumerate(roles[1:])}
        many, less = _WORDS.get(len(roles), len(roles)), _WORDS.get(len(roles) - 1, len(roles) - 1)
        raise InputError(
            f"it has {count} column{'s' if count != 1 else ''} without names, where {many} are "
            f"needed ({','.join(roles)}; {less} with --rate): name them in order with --columns, "
            "_ passes over one"
        )
    if all(isinstance(entry, int) for entry in columns):
        return _by_order(columns, [_numbered(int(entry), count) for entry in columns], mapping)
    if len(columns) > count:
        raise InputError(f"--columns names {len(columns)} columns, but there are only {count}")
    picked: dict[str, int] = {}
    for i, entry in enumerate(columns):
        if entry in SKIP:
            continue
        role = None if isinstance(entry, int) else _role(entry, roles)
        if role is None:
            raise InputError(
                f"column '{entry}' means nothing here: the file's columns have no names, so name "
                f"them in the file's order with {', '.join(roles)} and _ (or all by number)"
            )
        if role in picked:
            raise InputError(f"--columns names {role} twice")
        picked[role] = i
    return picked


def _picked(names: Sequence[str], columns: Sequence[str | int], mapping: Mapping) -> dict[str, int]:
    found = []
    for entry in columns:
        if isinstance(entry, int):
            found.append(_numbered(entry, len(names)))
            continue
        hits = [i for i, name in enumerate(names) if name.strip() == entry]
        hits = hits or [i for i, name in enumerate(names) if split_unit(name)[0] == entry]
        if not hits and entry in SKIP:
            raise InputError(
                f"columns: '{entry}' passes over a column only in files without column names; "
                f"name the columns to take; they are {_listing(names)}"
            )
        if not hits:
            raise InputError(
                f"column '{entry}' is not in the file; its columns are {_listing(names)}"
            )
        if len(hits) > 1:
            raise InputError(
                f"{len(hits)} columns are named '{entry}'; say which one by its number "
                f"({', '.join(str(i + 1) for i in hits)})"
            )
        found.append(hits[0])
    return _by_order(columns, found, mapping)


def _by_order(columns: Sequence[str | int], found: list[int], mapping: Mapping) -> dict[str, int]:
    roles = mapping.roles
    count = len(roles)
    if len(found) == count:
        pass
    elif len(found) == count - 1 and mapping.rate is not None:
        roles = roles[1:]
    else:
        hint = f"{_WORDS.get(count, count)} ({','.join(roles)})"
        if len(found) == count - 1:
            raise InputError(
                f"--columns names {count - 1} columns: name {hint}, or give --rate without t"
            )
        raise InputError(
            f"--columns names {len(found)} columns, expected {hint}, "
            f"{_WORDS.get(count - 1, count - 1)} with --rate"
        )
    for entry, column in zip(columns, found, strict=True):
        if found.count(column) > 1:
            raise InputError(f"--columns takes column {column + 1} ('{entry}') twice")
    return dict(zip(roles, found, strict=True))


def _role(name: str, roles: tuple[str, ...]) -> str | None:
    """Return what a column's name stands for; an array's gyros are numbered from 1."""
    plain = _plain(name)
    numbered = _NUMBERED.fullmatch(plain)
    role = f"g{int(numbered[2])}" if numbered and numbered[1] in _GYROS else _ALIASES.get(plain)
    return role if role in roles else None


def _recognised(names: Sequence[str], mapping: Mapping) -> dict[str, int]:
    picked: dict[str, int] = {}
    for i, name in enumerate(names):
        role = _role(split_unit(name)[0], mapping.roles)
        if role is None:
            continue
        if role in picked:
            raise InputError(
                f"columns {picked[role] + 1} ('{names[picked[role]]}') and {i + 1} ('{name}') "
                f"could both be {role}; say which to take with --columns"
            )
        picked[role] = i
    return picked


def _unit(
    names: Sequence[str], columns: Sequence[int], what: str, increment: str, given: str | None
) -> str | None:
    if given is not None:
        return None
    units = []
    for i in columns:
        base, unit = split_unit(names[i])
        stem = _plain(base)
        known = stem in _INCREMENTS or stem.rstrip("0123456789") in _INCREMENT_STEMS["g"]
        units.append(increment if unit is None and known else unit)
    if len(set(units)) > 1:
        raise InputError(
            f"the {what} columns have different units ({', '.join(str(u) for u in units)}); "
            f"make them one, or say the unit with --{what}"
        )
    return units[0]


def _numbered(number: int, count: int) -> int:
    if not 1 <= number <= count:
        raise InputError(f"column {number} is not in the file, which has {count} columns")
    return number - 1


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _listing(names: Sequence[str]) -> str:
    shown = ", ".join(name.strip() or "(no name)" for name in names[:20])
    return shown + (f" and {len(names) - 20} more" if len(names) > 20 else "")
