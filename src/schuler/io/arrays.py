"""From a file's named arrays (.npz, .mat) to rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from schuler.errors import InputError
from schuler.io.columns import choose
from schuler.io.content import BLOCK_ROWS, Array, Block, Content
from schuler.io.mapping import Mapping
from schuler.io.own import own_mapping, own_name, parse_own

__all__ = ["OWN", "from_arrays", "from_own_arrays", "holds_samples", "own_text"]

OWN = "schuler"
"""Name of the array that holds what schuler wrote about the others."""

_TIME = ("t", "time", "timestamp", "timestamps", "times")
_GYRO = ("gyro", "gyr", "gyroscope", "omega", "w", "wb", "angular_rate", "angular_velocity")
_ACCEL = ("accel", "acc", "accelerometer", "f", "fb", "acceleration", "specific_force")


_RATE = ("freq", "fs", "rate", "samplerate", "sample_rate", "frequency")


def _usual(name: str, names: Sequence[str]) -> bool:
    """Say whether a name, that of a structure's field without the structure's, is one of some."""
    return name.rpartition(".")[2].lower() in names


def holds_samples(names: Sequence[str]) -> bool:
    """Say whether arrays of these names are enough for a record."""
    own = {"dtheta", "dvel"} <= set(names)
    return own or all(any(_usual(n, some) for n in names) for some in (_GYRO, _ACCEL))


def from_arrays(names: Sequence[str], load: Callable[[str], Any], mapping: Mapping) -> Content:
    """Find the arrays, check their shapes and offer them as rows.

    Parameters
    ----------
    names : sequence of str
        Arrays in the file.
    load : callable
        Gives one by its name.
    mapping : Mapping
        `variables`, `columns` and `rate` are looked at.

    Raises
    ------
    InputError
        If the arrays cannot be told or do not fit each other.
    """
    v = dict(mapping.variables or {})
    for key, name in v.items():
        if name not in names:
            raise InputError(
                f"there is no array '{name}' for {key}; the file has {', '.join(names) or 'none'}"
            )
    if "matrix" in v:
        return _matrix(v["matrix"], _numbers(v["matrix"], load), mapping)
    steps = None
    said = Mapping()
    if not v and {"dtheta", "dvel"} <= set(names):
        v.update(gyro="dtheta", accel="dvel")
        said = Mapping(gyro="rad", accel="m/s")
        steps = "dt" if "dt" in names else None
    for key, usual in (("gyro", _GYRO), ("accel", _ACCEL), ("time", _TIME)):
        if key not in v:
            hits = [name for name in names if _usual(name, usual)]
            if len(hits) > 1:
                raise InputError(
                    f"the arrays {', '.join(hits)} could all be the {key}; say which with "
                    f"--variables {key}=NAME"
                )
            if hits:
                v[key] = hits[0]
    if mapping.sensor is not None and mapping.sensor in v:
        # The other sensor's three are put in their place later.
        v.setdefault("accel" if mapping.sensor == "gyro" else "gyro", v[mapping.sensor])
    if "gyro" not in v and "accel" not in v:
        tables = []
        for name in names:
            array = load(name)
            if (
                np.ndim(array) == 2
                and min(np.shape(array)) >= len(mapping.roles) - 1
                and np.asarray(array).size
            ):
                tables.append(name)
        if len(tables) == 1:
            return _matrix(tables[0], _numbers(tables[0], load), mapping)
    for key in ("gyro", "accel"):
        if key not in v:
            raise InputError(
                f"no array for the {key} was found among {', '.join(names) or 'none'}; name it "
                f"with --variables {key}=NAME, or one table with matrix=NAME"
            )
    if mapping.columns is not None:
        raise InputError("columns can be named only in a table (--variables matrix=NAME)")
    # One column for each gyro of an array, which `Mapping.roles` counts.
    counts = {"gyro": 3 if mapping.array is None else len(mapping.roles) - 4, "accel": 3}
    gyro, accel = (
        _columns_of(v[key], _numbers(v[key], load), counts[key]) for key in ("gyro", "accel")
    )
    n = len(gyro)
    if len(accel) != n:
        raise InputError(f"'{v['gyro']}' has {n} rows, but '{v['accel']}' has {len(accel)}")
    time = None
    if "time" not in v and mapping.rate is None:
        said = said.merged(_rate(names, load))
    if "time" in v and (mapping.rate is None or (mapping.variables or {}).get("time")):
        time = _line(v["time"], _numbers(v["time"], load), n)
    elif mapping.rate is None and said.rate is None:
        raise InputError(
            "there is no time array: name it with --variables time=NAME, or give the rate with "
            "--rate"
        )
    dt = None if steps is None or mapping.rate else _line(steps, _numbers(steps, load), n)
    columns = [*gyro.T, *accel.T]
    return _content(time, columns, dt, said, f"array '{v.get('time', '')}'")


def from_own_arrays(
    text: str | bytes, names: Sequence[str], load: Callable[[str], Any], mapping: Mapping
) -> Content:
    """Return the rows of a file that schuler wrote, with what it says of itself.

    Parameters
    ----------
    text : str or bytes
        The array "schuler" of the file.
    names, load, mapping
        As of `from_arrays`.

    Raises
    ------
    InputError
        If the description or an array is damaged.
    """
    own = parse_own(text, "into the array 'schuler'")
    rest = [name for name in names if name != OWN]
    content = from_arrays(rest, load, Mapping(array=mapping.array))
    content.said = own_mapping(own)
    content.name = own_name(own)
    content.complete = True
    return content


def own_text(codes: Any) -> bytes:
    """Return the description that a file holds as the codes of its characters.

    Raises
    ------
    InputError
        If they are no codes.
    """
    values = np.ravel(np.asarray(codes))
    if values.dtype != np.uint8:
        raise InputError("the description that schuler wrote into the array 'schuler' is damaged")
    return values.tobytes()


def _rate(names: Sequence[str], load: Callable[[str], Any]) -> Mapping:
    """Return the rate, where one array holds it."""
    hits = [name for name in names if _usual(name, _RATE)]
    if len(hits) != 1:
        return Mapping()
    value = _numbers(hits[0], load)
    if value.size != 1 or not np.isfinite(value).all() or not value.item() > 0:
        return Mapping()
    return Mapping(rate=float(value.item()))


def _matrix(name: str, table: Array, mapping: Mapping) -> Content:
    if table.ndim != 2:
        raise InputError(f"array '{name}' has shape {table.shape}, expected a table of columns")
    if table.shape[0] < table.shape[1]:
        table = table.T
    chosen = choose(None, table.shape[1], mapping)
    time = None if chosen.t is None else table[:, chosen.t]
    columns = [table[:, i] for i in chosen.values]
    return _content(time, columns, None, Mapping(), f"{chosen.t_label} of '{name}'")


def _content(
    time: Array | None, columns: list[Array], dt: Array | None, said: Mapping, label: str
) -> Content:
    n = len(columns[0])
    if n == 0:
        raise InputError("has no data rows")
    done = [0]

    def blocks() -> Iterator[Block]:
        for i in range(0, n, BLOCK_ROWS):
            part = slice(i, i + BLOCK_ROWS)
            done[0] = min(n, i + BLOCK_ROWS)
            yield (
                None if time is None else time[part],
                [column[part] for column in columns],
                None if dt is None else dt[part],
            )

    return Content(
        blocks=blocks, said=said, time_label=label, rows=n, progress=lambda: done[0] / n,
        stamps=None if time is None else time[:4096],
    )  # fmt: skip


def _numbers(name: str, load: Callable[[str], Any]) -> Array:
    array = np.asarray(load(name))
    if array.dtype.kind not in "iuf":
        raise InputError(f"array '{name}' is of type {array.dtype}, not real numbers")
    return array.astype(np.float64, copy=False)


def _columns_of(name: str, array: Array, count: int) -> Array:
    if array.ndim == 2 and array.shape[1] == count:
        return array
    if array.ndim == 2 and array.shape[0] == count:
        return array.T
    more = (
        "; gyros of an array are fused by --array NAME, which says their geometry"
        if count == 3 and array.ndim == 2 and 3 < min(array.shape) <= 64 else ""
    )  # fmt: skip
    raise InputError(f"array '{name}' has shape {array.shape}, expected (n, {count}){more}")


def _line(name: str, array: Array, n: int) -> Array:
    if array.size != n or array.ndim > 2 or max(array.shape, default=0) != n:
        raise InputError(f"array '{name}' has shape {array.shape}, expected {n} values")
    return array.reshape(n)
