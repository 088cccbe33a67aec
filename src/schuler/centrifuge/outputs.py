"""Outputs of a centrifuge test: forces by position, and the truth of a simulated one.

They are a table (CSV, Parquet or npz) of ``position, t, ax, ay, az``; ``FILE.truth.toml`` beside it
holds the three tables of `schuler.centrifuge.files` for a simulated one.
"""

from __future__ import annotations

from dataclasses import fields
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schuler._files import replacing
from schuler.centrifuge.coefficients import coefficient_names, coefficient_units
from schuler.centrifuge.plant import Plant
from schuler.centrifuge.scheme import CentrifugeScheme
from schuler.constants import STANDARD_GRAVITY
from schuler.errors import InputError

__all__ = ["outputs_truth_path", "read_outputs", "write_outputs"]

Array = NDArray[np.float64]


_COLUMNS = ("position", "t", "ax", "ay", "az")
_SUFFIXES = (".csv", ".parquet", ".npz")


def outputs_truth_path(path: str | Path) -> Path:
    """Return where the truth of simulated outputs is: ``FILE.truth.toml``."""
    return Path(f"{path}.truth.toml")


def write_outputs(
    path: str | Path,
    plant: Plant,
    scheme: CentrifugeScheme,
    outputs: Array,
    truth: Array | None = None,
) -> None:
    """Write outputs (p, m, 3), g, and, where it is given, the truth beside them.

    Raises
    ------
    InputError
        If a file cannot be written, or its name does not end on .csv, .parquet or .npz.

    Examples
    --------
    >>> plant, scheme = Plant(), CentrifugeScheme(dwell=2.0)
    >>> truth = sc.centrifuge.published_truth()
    >>> write_outputs("test.csv", plant, scheme, np.zeros((6, 100, 3)), truth)
    """
    path = Path(path)
    if path.suffix not in _SUFFIXES:
        raise InputError(f"{path}: outputs are written as {', '.join(_SUFFIXES)}")
    count, samples = outputs.shape[:2]
    time = np.tile(np.arange(1, samples + 1) / plant.sampling, count)
    position = np.repeat(np.arange(1, count + 1), samples)
    flat = outputs.reshape(-1, 3)
    with replacing(path) as part:
        if path.suffix == ".csv":
            with part.open("w", encoding="utf-8") as out:
                out.write("position,t,ax,ay,az\n")
                np.savetxt(
                    out, np.column_stack([position, time, flat]), "%d,%.6f,%.10g,%.10g,%.10g"
                )
        elif path.suffix == ".npz":
            with part.open("wb") as stream:
                np.savez(stream, position=position, t=time, ax=flat[:, 0], ay=flat[:, 1],
                         az=flat[:, 2])  # fmt: skip
        else:
            import pyarrow as pa
            import pyarrow.parquet as pq

            table = pa.table(dict(zip(_COLUMNS, (position, time, *flat.T), strict=True)))
            with part.open("wb") as sink:
                pq.write_table(table, sink)
    if truth is not None:
        _write_truth(outputs_truth_path(path), plant, scheme, truth)


def _write_truth(path: Path, plant: Plant, scheme: CentrifugeScheme, truth: Array) -> None:
    import tomli_w

    customary = truth / coefficient_units(plant.d_oo)[1]
    names = coefficient_names(plant.d_oo)
    table: dict[str, list[float]] = {}
    for name, value in zip(names, customary, strict=True):
        # Fifteen digits: a unit's factor leaves 0.060000000000000005 else.
        table.setdefault("th" if name.startswith("th") else name[:-1], []).append(
            float(f"{value:.15g}")
        )
    own = {
        f.name: list(v) if isinstance(v := getattr(plant, f.name), tuple) else v
        for f in fields(Plant)
    }
    data = {"plant": own, "scheme": scheme.to_dict(), "truth": table}
    with replacing(path) as part:
        part.write_text(tomli_w.dumps(data), encoding="utf-8", errors="replace")


def read_outputs(
    path: str | Path, plant: Plant, positions: int, unit: str = "g"
) -> tuple[list[Array], list[float]]:
    """Read outputs: an array (m, 3), g, and the time of its first sample, s, to each position.

    Positions are told apart by a column ``position``, or else by a hole or a step back in the time
    ``t``, which counts from an instant at which the arm stood along the base's x axis.

    Parameters
    ----------
    path : str or Path
    plant : Plant
        Its sampling has to be the file's.
    positions : int
        How many there have to be.
    unit : str
        Of the outputs: g, ug, m/s^2 ...

    Raises
    ------
    InputError
        For a file that cannot be read or does not fit, with the row.

    Examples
    --------
    >>> plant, scheme = Plant(), CentrifugeScheme(dwell=2.0)
    >>> write_outputs("read.csv", plant, scheme, np.zeros((6, 100, 3)))
    >>> outputs, first = read_outputs("read.csv", plant, 6)
    >>> outputs[0].shape
    (100, 3)
    """
    from schuler.units import parse_factor

    path = Path(path)
    factor = parse_factor(unit, ("acceleration",), "--accel")[0] / STANDARD_GRAVITY
    table = _columns(path)
    time, outputs = table["t"], factor * np.column_stack([table[k] for k in ("ax", "ay", "az")])
    bad = np.flatnonzero(~(np.isfinite(outputs).all(axis=1) & np.isfinite(time)))
    if bad.size:
        raise InputError(f"{path}: row {bad[0] + 1} holds a value that is not a finite number")
    step = 1.0 / plant.sampling
    if "position" in table:
        new = np.diff(table["position"]) != 0
    else:
        new = (np.diff(time) > 10 * step) | (np.diff(time) < 0)
    edges = [0, *(np.flatnonzero(new) + 1), len(time)]
    if len(edges) - 1 != positions:
        raise InputError(
            f"{path}: has {len(edges) - 1} position(s), but the scheme has {positions}: say the "
            "scheme that was run (--scheme)"
        )
    rows, first = [], []
    for a, b in pairwise(edges):
        off = np.flatnonzero(np.abs(np.diff(time[a:b]) - step) > 0.1 * step)
        if off.size:
            k = a + int(off[0])
            raise InputError(
                f"{path}: rows {k + 1} and {k + 2} are {time[k + 1] - time[k]:.6g} s apart, but "
                f"the plant has {plant.sampling:g} samples a second: each position needs all its "
                "rows, and `sampling` in the plant is their rate"
            )
        rows.append(outputs[a:b])
        # Only where the arm stood counts of the time.
        first.append(step + float(np.remainder(time[a] - step + 1e-9, plant.period)) - 1e-9)
    return rows, first


def _columns(path: Path) -> dict[str, Array]:
    try:
        if path.suffix == ".parquet":
            import pyarrow as pa
            import pyarrow.parquet as pq

            try:
                with path.open("rb") as stored:
                    found = pq.read_table(stored)
            except pa.ArrowInvalid:
                raise InputError(f"{path}: is not a Parquet file") from None
            table = {k: np.asarray(found[k], np.float64) for k in found.column_names}
        elif path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as stored:
                table = {k: np.asarray(stored[k], np.float64) for k in stored.files}
        else:
            table = _text(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:
        raise InputError(f"{path}: is not a table of numbers ({error})") from None
    missing = [name for name in _COLUMNS[1:] if name not in table]
    if missing:
        raise InputError(
            f"{path}: has no column {', '.join(missing)}; outputs of a centrifuge test have "
            f"{', '.join(_COLUMNS[1:])} and, if they are numbered, position"
        )
    if len(table["t"]) < 2:
        raise InputError(f"{path}: holds {len(table['t'])} row(s)")
    return table


def _text(path: Path) -> dict[str, Array]:
    import warnings

    with path.open(encoding="utf-8-sig") as lines:
        head = [name.strip() for name in lines.readline().lstrip("#").split(",")]
        if "t" not in head:
            return dict.fromkeys(head, np.zeros(0))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an empty table is said by the caller
            data = np.loadtxt(lines, delimiter=",", ndmin=2)
    if data.size and data.shape[1] != len(head):
        raise InputError(
            f"{path}: the first row names {len(head)} columns, but rows have {data.shape[1]}"
        )
    return {name: data[:, k] if data.size else np.zeros(0) for k, name in enumerate(head)}
