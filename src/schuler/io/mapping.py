"""`Mapping`: what a user says about a file: its columns, units, axes, clock and layout."""

from __future__ import annotations

import math
from collections.abc import Mapping as Dict
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from schuler._files import check_keys, read_toml, replacing
from schuler.errors import InputError, located
from schuler.io.axes import parse_axes
from schuler.sensors.named_arrays import load_array
from schuler.units import parse_factor

__all__ = ["ROLES", "SKIP", "Mapping"]

#: the seven things that a row holds, in the order in which `columns` names them
ROLES = ("t", "gx", "gy", "gz", "ax", "ay", "az")

#: entries of `columns` that pass over a column of a file without names
SKIP = ("_", "-")

_GYRO = ("angular rate", "angle")
_ACCEL = ("acceleration", "velocity")
_BOOLS = ("mean_rates", "header", "coning_corrected", "sculling_corrected")
_TEXTS = ("gyro", "accel", "time", "axes", "array", "delimiter", "comment", "decimal", "format",
          "topic", "imu_type", "accel_file", "accel_topic", "sensor")  # fmt: skip
_LONGEST_NUMBER = 9
_WORDS = {"tab": "\t", "\\t": "\t", "comma": ",", "semicolon": ";", "space": " "}


@dataclass(frozen=True)
class Mapping:
    """What is said about a file; ``None`` is "not said".

    Parameters
    ----------
    columns : tuple of str or int
        Where time, gyro x, y, z and accelerometer x, y, z are.

        * In a file whose columns have names: the names (or numbers, counted from 1) of the
          columns to take, in the order t, gx, gy, gz, ax, ay, az; without t where `rate` is
          given.
        * In a file without names: either numbers, in that same order; or the roles ``t``,
          ``gx`` ... ``az`` in the order in which the file has them, with ``_`` (or ``-``) for a
          column to pass over. Columns after the last that is named are passed over.
    gyro, accel : str
        Units, with a scale where the file holds counts: ``"deg/s"``, ``"0.1 arcsec"``,
        ``"g"``, ``"125 ug*s"``. Angle and velocity make increments, angular rate and
        acceleration make rates; both must be of one kind.
    time : str
        Unit of the time column: ``"s"``, ``"ms"``, ``"0.001 s"``.
    mean_rates : bool
        Rates are averages over the interval that ends at the row, not instantaneous values.
    axes : str
        Where the file's x, y, z point, ``"FRD"``; or what right, forward, up are in them,
        ``"y,x,-z"`` (`schuler.io.axes`).
    rate : float
        Samples a second, Hz; replaces the time column by an even clock.
    start_time : float
        Time at which that clock starts, s (0 when not said): the time of the first row of
        instantaneous rates, else the start of the first row's interval.
    coning_corrected, sculling_corrected : bool
        What the instrument has already done to its increments.
    array : str
        Geometry of redundant gyros (`schuler.sensors.load_array`): the file then has a column for
        each, ``t, g1 ... gm, ax, ay, az``, which are fused as they are read. The directions are in
        right, forward, up, whatever `axes` says of the accelerometers.
    delimiter, comment, decimal : str
        Layout of a text file: what separates cells (``"tab"`` and ``"space"`` are understood;
        space is any run of blanks), what starts a comment line, and the decimal mark.
    skip_rows : int
        Lines of a text file to pass over before anything else is read.
    header : bool
        Whether the first line after that names the columns.
    variables : dict of str to str
        Names of a ``.mat`` or ``.npz`` file's arrays: ``{"gyro": "w", "accel": "f", "time":
        "t"}``, or ``{"matrix": "imu"}`` for one array with a column each.
    format : str
        Name of the reader to use (`schuler.io.readers`), for a format that has no marks, as
        ``"kf-gins"``; the file's content decides when it is not said.
    topic : str
        Which of several streams of a log: a ROS topic, a ULog message and its instance
        (``"vehicle_imu:1"``), or a NovAtel message (``"RAWIMUSX"``).
    imu_type : str
        Instrument whose counts a NovAtel log holds, by name or number
        (`schuler.io.novatel.IMU_TYPES`), where the log does not say.
    accel_file : str
        A second file that holds the accelerometers, where the first holds the gyros alone: each
        has time and three values. They are interpolated to the gyros' stamps.
    accel_topic : str
        The same for a topic, of the same log or of that file.
    sensor : {"gyro", "accel"}
        The file holds this sensor alone. It is set for each of two files that are joined.

    Raises
    ------
    InputError
        For a value that cannot be meant.

    Examples
    --------
    >>> mapping = sc.Mapping(gyro="deg/s", accel="g", axes="FRD")
    >>> mapping.axes
    'FRD'
    """

    columns: tuple[str | int, ...] | None = None
    gyro: str | None = None
    accel: str | None = None
    time: str | None = None
    mean_rates: bool | None = None
    axes: str | None = None
    rate: float | None = None
    start_time: float | None = None
    coning_corrected: bool | None = None
    sculling_corrected: bool | None = None
    array: str | None = None
    delimiter: str | None = None
    comment: str | None = None
    decimal: str | None = None
    skip_rows: int | None = None
    header: bool | None = None
    variables: Dict[str, str] | None = None
    format: str | None = None
    topic: str | None = None
    imu_type: str | None = None
    accel_file: str | None = None
    accel_topic: str | None = None
    sensor: str | None = None

    def __post_init__(self) -> None:
        for key in _BOOLS:
            self._want(key, bool, "true or false")
        for key in _TEXTS:
            self._want(key, str, "a text")
        if self.columns is not None:
            object.__setattr__(self, "columns", _columns(self.columns))
        if self.gyro is not None:
            parse_factor(self.gyro, _GYRO, "gyro")
        if self.accel is not None:
            parse_factor(self.accel, _ACCEL, "accel")
        if self.time is not None and parse_factor(self.time, ("time",), "time")[0] < 0:
            raise InputError(f"time: the scale '{self.time}' must be positive")
        if self.axes is not None:
            parse_axes(self.axes)
        if self.array is not None:
            load_array(self.array)
        for key in ("rate", "start_time"):
            number = getattr(self, key)
            if number is None:
                continue
            if isinstance(number, bool) or not isinstance(number, int | float):
                raise InputError(f"{key}: expected a number, got {_brief(number)}")
            try:
                value = float(number)
            except OverflowError:
                value = math.inf
            object.__setattr__(self, key, value)
            if not math.isfinite(value) or (key == "rate" and value <= 0):
                raise InputError(
                    f"{key}: expected a {'positive number of Hz' if key == 'rate' else 'number'}, "
                    f"got {value:g}"
                )
        rows = self.skip_rows
        if rows is not None and (
            isinstance(rows, bool) or not isinstance(rows, int) or not 0 <= rows < 1 << 63
        ):
            raise InputError(
                f"skip_rows: expected a number of lines, 0 or more, got {_brief(rows)}"
            )
        self._check_layout()
        if self.sensor not in (None, "gyro", "accel"):
            raise InputError(f"sensor: expected 'gyro' or 'accel', got '{self.sensor}'")
        if self.variables is not None:
            object.__setattr__(self, "variables", _variables(self.variables))

    def _want(self, key: str, kind: type, what: str) -> None:
        value = getattr(self, key)
        if value is not None and not isinstance(value, kind):
            raise InputError(f"{key}: expected {what}, got {_brief(value)}")

    def _check_layout(self) -> None:
        if self.delimiter is not None:
            mark = _WORDS.get(self.delimiter.lower(), self.delimiter)
            bad = len(mark) != 1 or not mark.isascii() or mark.isalnum() or mark in '+-."\r\n\0'
            if bad:
                raise InputError(
                    f"delimiter: expected one mark such as ',' or ';', 'tab' or 'space', "
                    f"got {self.delimiter!r}"
                )
            object.__setattr__(self, "delimiter", mark)
        if self.decimal is not None and self.decimal not in (".", ","):
            raise InputError(f"decimal: expected '.' or ',', got {self.decimal!r}")
        if self.decimal == "," and self.delimiter == ",":
            raise InputError("decimal and delimiter cannot both be ','")
        mark = self.comment or ""
        if self.comment is not None and (not mark.strip() or mark.strip()[0] in "+-.0123456789"):
            raise InputError(f"comment: expected a mark such as '#', got {self.comment!r}")

    # -- making ------------------------------------------------------------------------

    @classmethod
    def from_dict(cls, data: Dict[str, Any]) -> Mapping:
        """Make a mapping from keys and values.

        Raises
        ------
        InputError
            For an unknown key or a bad value.
        """
        known = [f.name for f in fields(cls)]
        check_keys(dict(data), known)
        return cls(**data)

    @classmethod
    def from_toml(cls, path: str | Path) -> Mapping:
        """Read a mapping from a TOML file whose keys are this class's fields.

        Raises
        ------
        InputError
            If the file cannot be read, is not TOML, or holds an unknown key or a bad value.
        """
        path = Path(path)
        data = read_toml(path)
        with located(path):
            return cls.from_dict(data)

    @classmethod
    def from_cli(cls, **options: Any) -> Mapping:
        """Make a mapping from a command line's texts.

        Takes the fields' names; `columns` is ``"t,gx,gy,gz,ax,ay,az"`` or ``"1,2,3,4,5,6,7"``,
        `variables` is ``"gyro=w,accel=f"``; numbers may be texts; ``None`` is "not said".

        Raises
        ------
        InputError
            For an unknown option or a bad value.

        Examples
        --------
        >>> sc.Mapping.from_cli(gyro="deg/s", axes="FRD").axes
        'FRD'
        """
        data: dict[str, Any] = {}
        for key, value in options.items():
            if value is None:
                continue
            if key == "variables" and isinstance(value, str):
                pairs = [item.partition("=") for item in value.split(",")]
                if not all(equals for _, equals, _ in pairs):
                    raise InputError(f"variables: expected 'gyro=NAME,accel=NAME', got '{value}'")
                value = {name.strip(): array.strip() for name, _, array in pairs}
            elif key in ("rate", "start_time", "skip_rows") and isinstance(value, str):
                try:
                    value = int(value) if key == "skip_rows" else float(value)
                except ValueError:
                    raise InputError(f"{key}: expected a number, got '{value}'") from None
            data[key] = value
        return cls.from_dict(data)

    def merged(self, other: Mapping | None) -> Mapping:
        """Return this mapping with what `other` says in its place; `other` wins.

        Examples
        --------
        >>> sc.Mapping(axes="FRD").merged(sc.Mapping(gyro="deg/s")).axes
        'FRD'
        """
        if other is None:
            return self
        said = {f.name: getattr(other, f.name) for f in fields(other)}
        return replace(self, **{key: value for key, value in said.items() if value is not None})

    # -- looking -----------------------------------------------------------------------

    @property
    def roles(self) -> tuple[str, ...]:
        """What a row holds, in the order in which `columns` names it."""
        if self.sensor is not None:
            return (ROLES[0], *(ROLES[1:4] if self.sensor == "gyro" else ROLES[4:]))
        if self.array is None:
            return ROLES
        count = len(load_array(self.array))
        return ("t", *(f"g{k}" for k in range(1, count + 1)), "ax", "ay", "az")

    def said(self) -> dict[str, Any]:
        """Return the fields that are said.

        Examples
        --------
        >>> sc.Mapping(axes="FRD").said()
        {'axes': 'FRD'}
        """
        pairs = ((f.name, getattr(self, f.name)) for f in fields(self))
        return {key: value for key, value in pairs if value is not None}

    def to_toml(self, path: str | Path) -> None:
        """Write what is said to a TOML file, for `from_toml` or as a file's sidecar.

        Raises
        ------
        InputError
            If the file cannot be written.

        Examples
        --------
        >>> sc.Mapping(axes="FRD").to_toml("mapping.toml")
        >>> sc.Mapping.from_toml("mapping.toml").axes
        'FRD'
        """
        import tomli_w

        data = self.said()
        if "columns" in data:
            data["columns"] = list(data["columns"])
        if "variables" in data:
            data["variables"] = dict(data["variables"])
        with replacing(path) as temporary:
            temporary.write_text(tomli_w.dumps(data), encoding="utf-8")


def _brief(value: object) -> str:
    """Return a value as a message can show it: nested or endless ones by their kind."""
    if isinstance(value, int) and not -(1 << 63) <= value < 1 << 63:
        return "a number of more than 64 bits"
    if isinstance(value, list | tuple | dict):
        return f"a {'table' if isinstance(value, dict) else 'list'} of {len(value)}"
    return repr(value)[:200]


def _columns(given: object) -> tuple[str | int, ...]:
    if isinstance(given, str):
        given = given.split(",")
    if not isinstance(given, list | tuple) or not given:
        raise InputError(
            f"columns: expected names or numbers, as t,gx,gy,gz,ax,ay,az; got {_brief(given)}"
        )
    out: list[str | int] = []
    for entry in given:
        if isinstance(entry, bool) or not isinstance(entry, str | int):
            raise InputError(f"columns: expected a name or a number, got {_brief(entry)}")
        if isinstance(entry, str):
            entry = entry.strip()
            if not entry:
                raise InputError("columns: an entry is empty; write _ to pass over a column")
            if entry.isascii() and entry.isdigit():
                if len(entry) > _LONGEST_NUMBER:
                    raise InputError(f"columns: there is no column {entry[:20]}...")
                entry = int(entry)
        if isinstance(entry, int) and not 1 <= entry < 10**_LONGEST_NUMBER:
            raise InputError(f"columns: numbers count from 1, got {_brief(entry)}")
        out.append(entry)
    named = [entry for entry in out if entry not in SKIP]
    for entry in named:
        if named.count(entry) > 1:
            raise InputError(f"columns: '{entry}' is named twice")
    return tuple(out)


def _variables(given: object) -> dict[str, str]:
    known = ("time", "gyro", "accel", "matrix")
    if not isinstance(given, Dict):
        raise InputError(f"variables: expected names by key, as gyro = 'w'; got {_brief(given)}")
    for key, value in given.items():
        if key not in known:
            raise InputError(f"variables: unknown key '{key}'; known: {', '.join(known)}")
        if not isinstance(value, str) or not value:
            raise InputError(
                f"variables: expected the name of an array for {key}, got {_brief(value)}"
            )
    if "matrix" in given and len(given) > 1:
        raise InputError("variables: say either matrix or gyro, accel and time, not both")
    return {str(key): str(value) for key, value in given.items()}
