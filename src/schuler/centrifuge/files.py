"""TOML files of a centrifuge test: plant, scheme and what is true of them.

A test's file has the tables ``[plant]``, ``[scheme]`` and, for a simulated one, ``[truth]`` with
the coefficients; any of the three may stand in a file of its own, without its heading.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._files import check_keys, number, read_toml
from schuler.centrifuge.coefficients import PUBLISHED_TRUTH, coefficient_names, coefficient_units
from schuler.centrifuge.outputs import outputs_truth_path
from schuler.centrifuge.plant import Plant
from schuler.centrifuge.scheme import CentrifugeScheme, published_test
from schuler.errors import InputError, located

__all__ = [
    "SimulatedTest",
    "is_test",
    "plant_from_toml",
    "read_test",
    "scheme_from_toml",
    "simulate_test",
    "true_coefficients",
]

Array = NDArray[np.float64]


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
    r"""Read a plant: the fields of `Plant`, in its units.

    Raises
    ------
    InputError
        If the file cannot be read, or holds an unknown key or a bad value.

    Examples
    --------
    >>> from pathlib import Path
    >>> length = Path("plant.toml").write_text("force = 5.0\n")
    >>> plant_from_toml("plant.toml").force
    5.0
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
    r"""Read a scheme: ``positions``, ``dwell`` (s) and, where they differ, ``forces`` (g).

    Raises
    ------
    InputError
        If the file cannot be read, or holds an unknown key or a bad value.

    Examples
    --------
    >>> from pathlib import Path
    >>> text = "positions = [[45, 0, 167]]\ndwell = 20.0\n"
    >>> length = Path("scheme.toml").write_text(text)
    >>> scheme_from_toml("scheme.toml").positions
    ((45.0, 0.0, 167.0),)
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
    """Return coefficients (n,), inside units, from a table in customary units.

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
    from schuler.centrifuge.simulate import simulate_platform

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
    with located(path):
        plant, scheme, truth = read_test(data)
        given = data.get("seed", 0) if seed is None else seed
        if isinstance(given, bool) or not isinstance(given, int) or given < 0:
            raise InputError(f"seed: expected a whole number of 0 or more, got {given!r}")
        outputs = simulate_platform(
            plant, scheme.positions, scheme.dwell, truth, np.random.default_rng(given),
            forces=scheme.forces or None,
        )[0]  # fmt: skip
    return SimulatedTest(str(data.get("name", path.stem)), given, plant, scheme, truth, outputs)
