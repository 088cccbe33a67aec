"""Memory does not grow with the record: two million samples as text and as Parquet.

`benchmarks/bench_memory.py` does the same with ten million and prints the peaks.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="no resource usage of processes there"),
]

ROWS = 2_000_000
LIMIT_MB = 450.0


@pytest.fixture(scope="module")
def bench(root: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "bench_memory", root / "benchmarks" / "bench_memory.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", ["long.csv", "long.parquet"])
def test_peak_of_an_alignment(name: str, bench: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / name
    text = name.endswith(".csv")
    bench.write(path if text else None, None if text else path, ROWS)
    peak = bench.peak_mb(bench.ALIGN, path, ROWS)
    path.unlink()
    assert 30.0 < peak < LIMIT_MB


def test_peak_of_a_navigation_that_writes_every_row(bench: ModuleType, tmp_path: Path) -> None:
    """Held whole, its eleven columns and their copies would take more than the limit."""
    path = tmp_path / "long.parquet"
    bench.write(None, path, ROWS)
    assert 30.0 < bench.peak_mb(bench.NAVIGATE, path, tmp_path / "path.parquet") < LIMIT_MB


def test_one_row_group_for_all_is_read_in_pieces(bench: ModuleType, tmp_path: Path) -> None:
    """Held whole, its 112 MB and their decoded columns would pass the limit."""
    from pyarrow import parquet

    made, path = tmp_path / "made.parquet", tmp_path / "one.parquet"
    bench.write(None, made, ROWS)
    parquet.write_table(parquet.read_table(made), path, row_group_size=10 * ROWS)
    assert bench.peak_mb(bench.ALIGN, path, ROWS) < LIMIT_MB


def test_the_meter_sees_what_is_held(bench: ModuleType) -> None:
    """The tests above can fail: 500 MB in a process are seen, and its parent's are not."""
    held = b"1" * 700_000_000
    assert 477 < bench.peak_mb("x = b'1' * 500_000_000") < 650
    del held
