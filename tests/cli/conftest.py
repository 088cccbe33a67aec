"""A small record on disk, and a function that runs a command in this process."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from schuler.cli import main
from schuler.earth import Site
from schuler.motion import Static
from schuler.sensors import GRADES
from schuler.simulation import simulate

Array = NDArray[np.float64]

NAMES = ("t", "gx", "gy", "gz", "ax", "ay", "az")
HEADING, LATITUDE = 30.0, 40.0
SITE = Site(LATITUDE, 116.0, 50.0)
PLACE = ("--lat", "40", "--height", "50")


@dataclass
class Ran:
    """What a command left behind."""

    code: int
    out: str
    err: str

    @property
    def warnings(self) -> list[str]:
        return [line for line in self.err.splitlines() if line.startswith("warning: ")]


def found(text: str) -> dict[str, object]:
    """Return what a JSON document found, without how it was made."""
    data: dict[str, object] = json.loads(text)
    del data["provenance"]
    return data


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., Ran]:
    """Return a function that runs ``schuler ARGUMENTS`` here and gives code, output and errors."""

    def call(*arguments: object) -> Ran:
        capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            main([str(a) for a in arguments])
        out, err = capsys.readouterr()
        return Ran(int(stop.value.code or 0), out, err)

    return call


@pytest.fixture(scope="session")
def original() -> Array:
    """Return 60 s at 20 Hz of a base at rest, heading 30 deg, navigation grade: t and rates."""
    rng = np.random.default_rng(4)
    made = simulate(Static(HEADING, 1.0, -2.0), SITE, 60.0, 20.0, GRADES["navigation-fog"], rng)
    r = made.record
    return np.column_stack([r.time, r.dtheta / r.dt[:, None], r.dvel / r.dt[:, None]])


@pytest.fixture
def table(original: Array) -> Array:
    """Return a copy of the record to spoil."""
    return original.copy()


def as_text(
    table: Array,
    names: Iterable[str] | None = NAMES,
    mark: str = ",",
    cell: Callable[[float], str] = repr,
) -> str:
    """Write a table as text, exactly."""
    lines = [] if names is None else [mark.join(names)]
    lines += [mark.join(cell(float(v)) for v in row) for row in table]
    return "\n".join(lines) + "\n"


@pytest.fixture
def csv(tmp_path: Path, original: Array) -> Path:
    """Return the record as a CSV file."""
    path = tmp_path / "truck.csv"
    path.write_text(as_text(original))
    return path
