"""Small records in memory and as files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from schuler.record import ImuRecord

Array = NDArray[np.float64]
HEADER = "t,gx,gy,gz,ax,ay,az"


def make_rows(n: int = 40, seed: int = 1) -> Array:
    """Return n rows of time and six values of plausible size."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((n, 6)) * [1e-3] * 6 + [0, 4e-5, 5e-5, 0.1, 0.2, 9.8]
    return np.column_stack([0.01 * np.arange(1, n + 1), x])


def make_text(rows: Array, sep: str = ",", header: str | None = HEADER, end: str = "\n") -> str:
    """Write rows exactly."""
    lines = [] if header is None else [header.replace(",", sep)]
    lines += [sep.join(repr(float(v)) for v in row) for row in rows]
    return end.join(lines) + end


def same(a: ImuRecord, b: ImuRecord) -> bool:
    """Whether two records hold the same bits."""
    flags = (a.coning_corrected, a.sculling_corrected) == (b.coning_corrected, b.sculling_corrected)
    return flags and all(
        getattr(a, key).tobytes() == getattr(b, key).tobytes()
        for key in ("time", "dt", "dtheta", "dvel")
    )


@pytest.fixture
def rows() -> Array:
    return make_rows()


@pytest.fixture
def csv(tmp_path: Path, rows: Array) -> Path:
    path = tmp_path / "truck.csv"
    path.write_text(make_text(rows))
    return path


@pytest.fixture
def put(tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes a file and gives its path."""

    def write(content: str | bytes, name: str = "file.csv") -> Path:
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write
