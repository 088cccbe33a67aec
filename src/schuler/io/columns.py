"""Which column is what: by name, by number, by role, and units from bracketed header names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from schuler.errors import InputError, near
from schuler.io.mapping import SKIP, Mapping
from schuler.io.names import axes_mark, read_name, second_part, split_unit, time_rank

__all__ = ["Chosen", "choose", "split_unit"]

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
        What messages call the time column.
    t_part : int or None
        A second column of time, where it is in two.
    t_part_unit : float
        Its unit, s.
    mark : (str, str) or None
        The axes that the names are a mark of, and whose names they are.
    """

    t: int | None
    values: tuple[int, ...]
    dt: int | None = None
    gyro: str | None = None
    accel: str | None = None
    time: str | None = None
    t_label: str = ""
    t_part: int | None = None
    t_part_unit: float = 1.0
    mark: tuple[str, str] | None = None

    @property
    def all(self) -> tuple[int, ...]:
        """The columns to read, each once, in the file's order."""
        extra = [c for c in (self.t, self.dt, self.t_part) if c is not None]
        return tuple(sorted({*self.values, *extra}))

    def said(self) -> Mapping:
        """Return the units as a mapping."""
        return Mapping(gyro=self.gyro, accel=self.accel, time=self.time)


def _is_array(names: Sequence[str] | None) -> bool:
    """Say whether four columns or more are named like the gyros of an array."""
    roles = tuple(f"g{k}" for k in range(1, 65))
    return sum(read_name(name, roles).role is not None for name in names or ()) >= 4


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
    part = None
    if names is None:
        picked = _without_names(count, mapping)
    elif mapping.columns is not None:
        picked = _picked(names, mapping.columns, mapping)
    else:
        part = None if mapping.rate is not None else second_part(names)
        picked = _recognised(names, mapping, () if part is None else part[:2])
        if part is not None:
            picked["t"] = part[0]
    roles = mapping.roles
    missing = [role for role in roles[1:] if role not in picked]
    if missing:
        listing = f"its columns are {_listing(names)}" if names else f"it has {count} columns"
        apart = mapping.sensor is None and {"ax", "ay", "az"} <= set(missing)
        other = (
            "; accelerometers in a file of their own are joined by --accel-file" if apart else ""
        )
        if mapping.array is None and {"gx", "gy", "gz"} <= set(missing) and _is_array(names):
            other += "; gyros of an array are fused by --array NAME, which says their geometry"
        raise InputError(
            f"no column for {', '.join(missing)} was found; {listing}; name those that hold "
            f"{', '.join(roles)}, in this order, with --columns{other}"
        )
    # A clock of its own needs no stamp: none of them is read.
    t = picked.get("t") if mapping.rate is None else None
    if t is None and mapping.rate is None:
        raise InputError(
            "there is no time column: name it with --columns, or give the rate with --rate"
        )
    values = tuple(picked[role] for role in roles[1:])
    if mapping.sensor is not None:
        # The other sensor's three are put in their place later.
        values += values
    if names is None:
        label = "" if t is None else f"column {t + 1}"
        return Chosen(t, values, t_label=label)
    # An exact interval column comes with increments that schuler wrote, or others like them.
    steps = [i for i, name in enumerate(names) if split_unit(name)[0].lower() == "dt"]
    label = "" if t is None else f"column '{split_unit(names[t])[0]}'"
    time = None
    if part is not None:
        label = f"columns '{names[part[0]]}' and '{names[part[1]]}'"
        time = "s"
    elif t is not None and not mapping.time:
        time = read_name(names[t], roles).unit
    return Chosen(
        t,
        values,
        steps[0] if len(steps) == 1 else None,
        _unit(names, values[:-3], "gyro", "rad", mapping),
        _unit(names, values[-3:], "accel", "m/s", mapping),
        time,
        label,
        None if part is None else part[1],
        1.0 if part is None else part[2],
        axes_mark([names[i] for i in values]),
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
        role = None if isinstance(entry, int) else read_name(entry, roles).role
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
                f"column '{entry}'{near(entry, names)} is not in the file; its columns are "
                f"{_listing(names)}"
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


def _recognised(
    names: Sequence[str], mapping: Mapping, passed_over: Sequence[int] = ()
) -> dict[str, int]:
    picked: dict[str, int] = {}
    for i, name in enumerate(names):
        if i in passed_over:
            continue
        role = read_name(name, mapping.roles).role
        if role is None:
            continue
        if role in picked:
            other = names[picked[role]]
            if role == "t" and mapping.rate is not None:
                continue
            if role == "t" and time_rank(other) != time_rank(name):
                # The instrument's own stamp before the logger's.
                picked[role] = i if time_rank(name) < time_rank(other) else picked[role]
                continue
            raise InputError(
                f"columns {picked[role] + 1} ('{names[picked[role]]}') and {i + 1} ('{name}') "
                f"could both be {role}; say which to take with --columns"
            )
        picked[role] = i
    return picked


def _unit(
    names: Sequence[str], columns: Sequence[int], what: str, increment: str, mapping: Mapping
) -> str | None:
    if (mapping.gyro if what == "gyro" else mapping.accel) is not None:
        return None
    units = []
    for i in columns:
        read = read_name(names[i], mapping.roles)
        units.append(increment if read.unit is None and read.increments else read.unit)
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


def _listing(names: Sequence[str]) -> str:
    shown = ", ".join(name.strip() or "(no name)" for name in names[:20])
    return shown + (f" and {len(names) - 20} more" if len(names) > 20 else "")
