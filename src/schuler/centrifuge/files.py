"""Files of a centrifuge test: plant and scheme in TOML, outputs and what is true of them.

A test's file has the tables ``[plant]``, ``[scheme]`` and, for a simulated one, ``[truth]`` with
the coefficients; any of the three may stand in a file of its own, without its heading. Outputs are
a table (CSV, Parquet or npz) of ``position, t, ax, ay, az``; ``FILE.truth.toml`` beside it holds
all three tables of a simulated one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._files import check_keys, number, read_toml, replacing
from schuler.centrifuge.plant import (
    PUBLISHED_POSITIONS,
    PUBLISHED_TRUTH,
    Plant,
    coefficient_names,
    coefficient_units,
)
from schuler.constants import STANDARD_GRAVITY
from schuler.errors import InputError

__all__ = [
    "CentrifugeScheme",
    "SimulatedTest",
    "is_test",
    "outputs_truth_path",
    "plant_from_toml",
    "published_test",
    "read_outputs",
    "read_test",
    "scheme_from_toml",
    "simulate_test",
    "true_coefficients",
    "write_outputs",
]  # fmt: skip

Array = NDArray[np.float64]

_COLUMNS = ("position", "t", "ax", "ay", "az")
_SUFFIXES = (".csv", ".parquet", ".npz")


@dataclass(frozen=True)
class CentrifugeScheme:
    """Positions of a test, the time at each, and the force there.

    Parameters
    ----------
    positions : tuple of (float, float, float)
        alpha, beta, gamma, deg.
    dwell : float
        s at each.
    forces : tuple of float, optional
        Centripetal force at each position, g; the plant's own where empty.
    """

    positions: tuple[tuple[float, float, float], ...] = PUBLISHED_POSITIONS
    dwell: float = 100.0
    forces: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        rows = np.asarray(self.positions, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != 3 or not np.isfinite(rows).all():
            raise InputError("a scheme's positions must be rows of alpha, beta, gamma in deg")
        if not (np.isfinite(self.dwell) and self.dwell > 0):
            raise InputError(f"a scheme's dwell must be positive, got {self.dwell}")
        if self.forces and (
            len(self.forces) != len(rows) or not all(np.isfinite(f) and f > 0 for f in self.forces)
        ):
            raise InputError(
                f"a scheme's forces must be {len(rows)} positive numbers of g, one to a position, "
                f"got {list(self.forces)}"
            )
        object.__setattr__(self, "positions", tuple(map(tuple, rows.tolist())))
        object.__setattr__(self, "forces", tuple(map(float, self.forces)))

    def to_dict(self) -> dict[str, Any]:
        """Return the scheme as its TOML table."""
        return {
            "dwell": self.dwell,
            "positions": [list(row) for row in self.positions],
            **({"forces": list(self.forces)} if self.forces else {}),
        }


def published_test(plant: Plant, dwell: float = 100.0) -> CentrifugeScheme:
    """Return the published six positions; with D_OO at the plant's force and at half of it."""
    if not plant.d_oo:
        return CentrifugeScheme(dwell=dwell)
    return CentrifugeScheme(
        PUBLISHED_POSITIONS * 2, dwell, (plant.force,) * 6 + (0.5 * plant.force,) * 6
    )


def _table(path: str | Path, name: str) -> Any:
    """Return one table of a file, or the file itself where it holds that table alone."""
    data = read_toml(path)
    if name in data or any(key in data for key in ("plant", "scheme", "truth")):
        if name not in data:
            raise InputError(f"{path}: has no table [{name}]")
        return data[name]
    return data


def _read(path: str | Path, name: str, make: Any) -> Any:
    try:
        return make(_table(path, name))
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(str(path)) else f"{path}: {text}") from None


def plant_from_toml(path: str | Path) -> Plant:
    """Read a plant: the fields of `Plant`, in its units.

    Raises
    ------
    InputError
        If the file cannot be read, or holds an unknown key or a bad value.
    """
    plant: Plant = _read(path, "plant", _plant)
    return plant


def _plant(table: Any) -> Plant:
    known = {f.name: f.default for f in fields(Plant)}
    check_keys(table, known, prefix="plant.")
    values: dict[str, Any] = {}
    for key, value in table.items():
        default, what = known[key], f"plant.{key}"
        if isinstance(default, bool):
            if not isinstance(value, bool):
                raise InputError(f"{what}: expected true or false, got {value!r}")
            values[key] = value
        elif isinstance(default, str):
            values[key] = str(value)
        elif isinstance(default, tuple):
            if not isinstance(value, list) or len(value) != len(default):
                raise InputError(f"{what}: expected {len(default)} numbers, got {value!r}")
            values[key] = tuple(number(v, what) for v in value)
        else:
            values[key] = number(value, what)
    return Plant(**values)


def scheme_from_toml(path: str | Path) -> CentrifugeScheme:
    """Read a scheme: ``positions``, ``dwell`` (s) and, where they differ, ``forces`` (g).

    Raises
    ------
    InputError
        If the file cannot be read, or holds an unknown key or a bad value.
    """
    scheme: CentrifugeScheme = _read(path, "scheme", _scheme)
    return scheme


def _scheme(table: Any) -> CentrifugeScheme:
    check_keys(table, ("positions", "dwell", "forces"), prefix="scheme.")
    if "positions" not in table:
        raise InputError("scheme.positions is missing: rows of alpha, beta, gamma in deg")
    rows = table["positions"]
    if not isinstance(rows, list) or not all(isinstance(r, list) and len(r) == 3 for r in rows):
        raise InputError("scheme.positions: expected rows of alpha, beta, gamma in deg")
    positions = tuple(
        (number(a, "scheme.positions"), number(b, "scheme.positions"),
         number(c, "scheme.positions")) for a, b, c in rows
    )  # fmt: skip
    forces = table.get("forces", [])
    if not isinstance(forces, list):
        raise InputError("scheme.forces: expected a list of forces in g, one to a position")
    return CentrifugeScheme(
        positions, number(table.get("dwell", 100.0), "scheme.dwell", " of s"),
        tuple(number(f, "scheme.forces") for f in forces),
    )  # fmt: skip


def true_coefficients(table: Mapping[str, Any], plant: Plant) -> Array:
    """Return coefficients (n,), inside units, from a table in spoken units.

    Each term (``D_F`` ... ``k_IP``) has three numbers for x, y, z, and ``th`` the mounting angles
    th_py, th_pz, th_oz. What is left out is as published; D_OO like D_II.

    Raises
    ------
    InputError
        For an unknown term, or one that is not three numbers.
    """
    given: dict[str, Any] = {**PUBLISHED_TRUTH, "D_OO": table.get("D_II", PUBLISHED_TRUTH["D_II"])}
    check_keys(table, given, prefix="truth.")
    given |= table
    names, values = coefficient_names(plant.d_oo), []
    for k, name in enumerate(names):
        term = "th" if name.startswith("th") else name[:-1]
        three = given[term]
        if not isinstance(three, list | tuple) or len(three) != 3:
            raise InputError(f"truth.{term}: expected three numbers, got {three!r}")
        values.append(number(three[k % 3], f"truth.{term}"))
    return np.asarray(np.array(values) * coefficient_units(plant.d_oo)[1])


def is_test(path: str | Path) -> bool:
    """Say whether a TOML file describes a centrifuge test, and not the motion of a vehicle."""
    data = read_toml(path)
    return "scheme" in data and "motion" not in data and "site" not in data


def read_test(data: Mapping[str, Any]) -> tuple[Plant, CentrifugeScheme, Array]:
    """Return plant, scheme and true coefficients of a test's tables.

    Raises
    ------
    InputError
        For an unknown key or a bad value.
    """
    check_keys(data, ("name", "seed", "plant", "scheme", "truth"))
    plant = _plant(data.get("plant", {}))
    scheme = _scheme(data["scheme"]) if "scheme" in data else published_test(plant)
    truth = data.get("truth", {})
    if not isinstance(truth, Mapping):
        raise InputError("[truth]: expected a table of coefficients")
    return plant, scheme, true_coefficients(truth, plant)


@dataclass(frozen=True, eq=False)
class SimulatedTest:
    """A simulated centrifuge test.

    Parameters
    ----------
    name : str
    seed : int
    plant : Plant
    scheme : CentrifugeScheme
    truth : (n,) float64
        Coefficients, inside units.
    outputs : (p, m, 3) float64
        g.
    """

    name: str
    seed: int
    plant: Plant
    scheme: CentrifugeScheme
    truth: Array
    outputs: Array

    def to_dict(self, path: str) -> dict[str, Any]:
        """Return what was made, written to a path, as JSON takes it."""
        return {
            "schema": "schuler.centrifuge-simulation/1", "outputs": path,
            "truth": str(outputs_truth_path(path)), "name": self.name, "seed": self.seed,
            "positions": len(self.scheme.positions), "dwell_s": self.scheme.dwell,
            "rate_hz": self.plant.sampling, "samples": int(np.prod(self.outputs.shape[:2])),
        }  # fmt: skip


def simulate_test(
    path: str | Path, overrides: Mapping[str, Any] | None = None, seed: int | None = None
) -> SimulatedTest:
    """Simulate the test of a TOML file with ``[scheme]`` and, if wanted, ``[plant]``, ``[truth]``.

    Parameters
    ----------
    path : str or Path
    overrides : mapping, optional
        Values that win over the file's, by dotted key: ``{"plant.noise": 5}``.
    seed : int, optional
        In place of the file's own (0 where it has none).

    Raises
    ------
    InputError
        For an unknown key or a bad value, with the file.
    """
    from schuler.centrifuge.filter import simulate_platform

    path = Path(path)
    data = read_toml(path)
    for key, value in (overrides or {}).items():
        *tables, last = key.split(".")
        at = data
        for name in tables:
            at = at.setdefault(name, {})
            if not isinstance(at, dict):
                raise InputError(f"{path}: {key}: '{name}' is not a table")
        at[last] = value
    try:
        plant, scheme, truth = read_test(data)
        given = data.get("seed", 0) if seed is None else seed
        if isinstance(given, bool) or not isinstance(given, int) or given < 0:
            raise InputError(f"seed: expected a whole number of 0 or more, got {given!r}")
        outputs = simulate_platform(
            plant, scheme.positions, scheme.dwell, truth, np.random.default_rng(given),
            forces=scheme.forces or None,
        )[0]  # fmt: skip
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return SimulatedTest(str(data.get("name", path.stem)), given, plant, scheme, truth, outputs)


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

    spoken = truth / coefficient_units(plant.d_oo)[1]
    names = coefficient_names(plant.d_oo)
    table: dict[str, list[float]] = {}
    for name, value in zip(names, spoken, strict=True):
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
