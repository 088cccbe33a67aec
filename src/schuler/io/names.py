"""What a column's name says: which of a row's values it is, its unit, and whose names they are."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from schuler.units import known_unit

__all__ = ["Named", "axes_mark", "read_name", "second_part", "split_unit", "time_rank"]

_BRACKETS = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))\s*")

_STEMS = {
    "g": ("g", "gyr", "gyro", "gyros", "gyroscope", "w", "omega", "angularvelocity",
          "angularrate", "angvel", "angrate", "rotationrate", "wrss"),
    "a": ("a", "acc", "accl", "accel", "accelerometer", "acceleration", "linearacceleration",
          "linacc", "f", "force", "specificforce", "arss"),
}  # fmt: skip
_INCREMENT_STEMS = {
    "g": ("dtheta", "dang", "deltaangle", "deltatheta"),
    "a": ("dvel", "dv", "deltav", "deltavelocity"),
}
#: stems that state the unit themselves
_STEM_UNITS = {"gyrorad": ("g", "rad/s"), "accelerometerms2": ("a", "m/s^2")}

#: names of time, the instrument's or the message's own stamp before the logger's
_TIMES = (
    "sampletimefine", "headerstamp", "stamp", "timestamp", "timestamps", "gpstime", "timeofweek",
    "tow", "time", "times", "t", "sec", "secs", "seconds",
)  # fmt: skip
#: names that state a unit: Xsens counts tenths of milliseconds
_TIME_UNITS = {"sampletimefine": "0.0001 s", "gpstime": "s", "tow": "s", "timeofweek": "s"}

_ALIASES: dict[str, str] = dict.fromkeys(_TIMES, "t")
_INCREMENTS: set[str] = set()
_UNITS: dict[str, str] = dict(_TIME_UNITS)
for _sensor in "ga":
    for _axis in "xyz":
        for _stem in _STEMS[_sensor]:
            _ALIASES[_stem + _axis] = _sensor + _axis
        for _stem in _INCREMENT_STEMS[_sensor]:
            _ALIASES[_stem + _axis] = _sensor + _axis
            _INCREMENTS.add(_stem + _axis)
for _stem, (_sensor, _unit_of_stem) in _STEM_UNITS.items():
    for _axis in "xyz":
        _ALIASES[_stem + _axis] = _sensor + _axis
        _UNITS[_stem + _axis] = _unit_of_stem
_GYROS = (*_STEMS["g"], *_INCREMENT_STEMS["g"])
_NUMBERED = re.compile(r"([a-z]+)(\d{1,2})")
_INDEXED = re.compile(r"(.*)[\[(]([012])[\])]")

#: the second column of a time in two: its part of a second
_PARTS = {
    **dict.fromkeys(("nanosec", "nanosecs", "nanoseconds", "nsec", "nsecs"), 1e-9),
    **dict.fromkeys(("microsec", "microsecs", "microseconds", "usec", "usecs"), 1e-6),
    **dict.fromkeys(("millisec", "millisecs", "milliseconds", "msec", "msecs"), 1e-3),
}
_WHOLE = ("sec", "secs", "seconds", "s")

#: words before a name that say where it was logged
_PREFIX = re.compile(r"(field|imu|msg|data|sensor|sensors|mpu)\d*")
#: words of a name that are its unit, the longest first
_WORD_UNITS: tuple[tuple[tuple[str, ...], str], ...] = (
    (("m", "s", "2"), "m/s^2"), (("m", "s", "s"), "m/s^2"), (("deg", "per", "s"), "deg/s"),
    (("rad", "per", "s"), "rad/s"), (("m", "s2"), "m/s^2"), (("rad", "s"), "rad/s"),
    (("deg", "s"), "deg/s"), (("deg", "h"), "deg/h"), (("deg", "hr"), "deg/h"),
    (("rad", "sec"), "rad/s"), (("deg", "sec"), "deg/s"),
    *(((word,), unit) for word, unit in (
        ("mdps", "mdps"), ("dps", "deg/s"), ("degs", "deg/s"), ("degps", "deg/s"),
        ("rads", "rad/s"), ("radps", "rad/s"), ("mps2", "m/s^2"), ("ms2", "m/s^2"),
        ("mss", "m/s^2"), ("g", "g"), ("mg", "mg"), ("ug", "ug"), ("rad", "rad"), ("deg", "deg"),
        ("ns", "ns"), ("nsec", "ns"), ("nanosec", "ns"), ("us", "us"), ("usec", "us"),
        ("micros", "us"), ("ms", "ms"), ("msec", "ms"), ("millis", "ms"), ("s", "s"),
        ("sec", "s"), ("secs", "s"), ("seconds", "s"),
    )),
)  # fmt: skip


@dataclass(frozen=True)
class Named:
    """What a name says.

    Parameters
    ----------
    role : str or None
        An entry of `Mapping.roles`; None for what does not matter.
    unit : str or None
        As written in brackets or in the name.
    increments : bool
        The name can only be that of an increment.
    """

    role: str | None
    unit: str | None
    increments: bool = False


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


def read_name(name: str, roles: Sequence[str]) -> Named:
    """Read a column's name.

    Parameters
    ----------
    name : str
    roles : sequence of str
        What a row holds (`Mapping.roles`); an array's gyros are numbered from 1.
    """
    base, unit = split_unit(name)
    plain = _plain(base)
    # Of an array, "g[1]" is the first gyro; of a triad, "gyro_rad[1]" is the second axis.
    indexed = None if "g2" in roles else _INDEXED.fullmatch(base)
    if indexed is not None:
        plain = _plain(indexed[1]) + "xyz"[int(indexed[2])]
    numbered = _NUMBERED.fullmatch(plain)
    if numbered and numbered[1] in _GYROS and f"g{int(numbered[2])}" in roles:
        stem = numbered[1]
        return Named(f"g{int(numbered[2])}", unit, stem in _INCREMENT_STEMS["g"])
    for words in _shortened(base if indexed is None else plain):
        plain = "".join(words)
        if plain in _ALIASES:
            return _named(plain, unit, roles)
        for part, meant in _WORD_UNITS:
            for k in range(len(words) - len(part), 0, -1):
                rest = words[:k] + words[k + len(part) :]
                if words[k : k + len(part)] == part and "".join(rest) in _ALIASES:
                    found = _named("".join(rest), unit or meant, roles)
                    fits = found.role is not None and (found.role == "t") == (meant in _TIME_WORDS)
                    if fits:
                        return found
    # A sensor in a file of its own may name its axes alone.
    if plain in ("x", "y", "z") and len(roles) == 4:
        return Named(roles[1][0] + plain, unit)
    return Named(None, unit)


_TIME_WORDS = ("s", "ms", "us", "ns")


def _named(plain: str, unit: str | None, roles: Sequence[str]) -> Named:
    role = _ALIASES[plain]
    stated = _UNITS.get(plain) if unit is None or not known_unit(unit) else None
    if role not in roles:
        return Named(None, unit)
    return Named(role, stated or unit, plain in _INCREMENTS)


def _shortened(base: str) -> list[tuple[str, ...]]:
    """Return a name's words, and the same without those before it that say where it was logged."""
    words = _words(base)
    out = [words]
    while len(words) > 1 and _PREFIX.fullmatch(words[0]):
        words = words[1:]
        out.append(words)
    return out


def _words(name: str) -> tuple[str, ...]:
    # "TimeUS" and "GyrX": a capital begins a word, and a run of capitals is one.
    cut = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", name)
    return tuple(re.findall(r"[a-z0-9]+", cut.lower()))


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def time_rank(name: str) -> int:
    """Return how good a name of time is: the least is the best."""
    for words in _shortened(split_unit(name)[0]):
        for k in range(len(words), 0, -1):
            if "".join(words[:k]) in _TIMES:
                return _TIMES.index("".join(words[:k]))
    return len(_TIMES)


def second_part(names: Sequence[str]) -> tuple[int, int, float] | None:
    """Return the columns of a time in two, seconds and a part of them, and that part's unit in s.

    ``header.stamp.sec`` and ``header.stamp.nanosec`` are one time: they share what is before.
    """
    found: list[tuple[int, int, float]] = []
    words = [_words(split_unit(name)[0]) for name in names]
    for k, end in enumerate(words):
        if not end or end[-1] not in _PARTS:
            continue
        for i, begin in enumerate(words):
            if begin and begin[-1] in _WHOLE and begin[:-1] == end[:-1]:
                found.append((i, k, _PARTS[end[-1]]))
    return found[0] if len(found) == 1 else None


def axes_mark(names: Sequence[str]) -> tuple[str, str] | None:
    """Return the axes that names are a mark of, and whose names they are; None where of none."""
    joined = " ".join(names).lower()
    if "angular_velocity" in joined or "linear_acceleration" in joined:
        return "FLU", "ROS's, where x is forward, y left, z up"
    if "w_rs_s" in joined or "a_rs_s" in joined:
        return "FLU", "EuRoC's, a data set of ROS, where x is forward, y left, z up"
    px4 = ("gyro_rad[", "accelerometer_m_s2[", "delta_angle[", "delta_velocity[")
    if any(mark in joined for mark in px4):
        return "FRD", "PX4's, where x is forward, y right, z down"
    if {"GyrX", "GyrY", "AccX"} <= set(names):
        return "FRD", "ArduPilot's, where x is forward, y right, z down"
    return None
