"""Numbers out of Arrow's columns, as its own conversion gives them."""

import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest

from schuler._arrow import column_of, numbers

COLUMNS = {
    "floats": pa.array([1.5, -2.0, 3.0, 4.0]),
    "integers": pa.array([1, -2, 3, 2**40], pa.int64()),
    "bytes": pa.array([1, 2, 255], pa.uint8()),
    "flags": pa.array([True, False, True, True, False, False, True, False, True, True]),
    "empty cells": pa.array([1.0, None, 3.0, None]),
    "empty flags": pa.array([True, None, False]),
    "nothing": pa.array([], pa.float64()),
}


@pytest.mark.parametrize("name", COLUMNS)
@pytest.mark.parametrize("cut", [0, 1, 9])
def test_numbers_are_those_of_arrow(name, cut):
    column = COLUMNS[name].slice(min(cut, len(COLUMNS[name])))
    wanted = np.array([np.nan if x is None else x for x in column.to_pylist()], np.float64)
    np.testing.assert_array_equal(np.asarray(numbers(column), np.float64), wanted)
    chunks = pa.chunked_array([column, COLUMNS[name]])
    whole = np.concatenate([wanted, np.asarray(numbers(COLUMNS[name]), np.float64)])
    np.testing.assert_array_equal(np.asarray(numbers(chunks), np.float64), whole)


def test_a_column_of_numbers_comes_back():
    values = np.array([1.5, np.nan, -3.0])
    column = column_of(values[::-1])
    assert column.type == pa.float64()
    np.testing.assert_array_equal(numbers(column), values[::-1])


def test_a_column_without_chunks_is_empty():
    assert len(numbers(pa.chunked_array([], pa.float64()))) == 0


@pytest.mark.parametrize("column", [pa.array(["1"]), pa.array([0], pa.timestamp("us"))])
def test_other_columns_are_refused(column):
    with pytest.raises(TypeError, match="holds no numbers"):
        numbers(column)


def test_an_alignment_loads_neither_pandas_nor_the_statistics_of_scipy(tmp_path):
    """Each costs a quarter of a second, and neither is needed."""
    code = (
        "import sys, numpy as np\n"
        "from schuler import ImuRecord, Site, align, write, read, simulate\n"
        "from schuler.motion import Static\n"
        "from schuler.sensors import GRADES\n"
        "spec = GRADES['navigation-fog']\n"
        "made = simulate(Static(), Site(40.0), 20.0, 50.0, spec, np.random.default_rng(0))\n"
        f"write(made.record, {str(tmp_path / 'a.parquet')!r})\n"
        f"print(align(read({str(tmp_path / 'a.parquet')!r}), Site(40.0), spec=spec))\n"
        "print([name for name in ('pandas', 'scipy.stats') if name in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "[]"
