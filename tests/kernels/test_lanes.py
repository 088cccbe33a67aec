"""Values of four numbers, compiled and as Python."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.kernels._jit import _UNCOMPILED, kernel
from schuler.kernels.lanes import (
    LANES,
    first_lanes,
    load4,
    load_row4,
    splat4,
    store4,
    store_row4,
)


@kernel
def everything(a, v, out, count):
    """Use each operation once, with a value or a number at each side."""
    x, y = load_row4(a, 1, 2), load4(v, 1)
    store_row4(out, 0, 0, x + y)
    store_row4(out, 1, 1, x - 2.0 * y)
    store_row4(out, 2, 0, (3.0 - x) * (y + 1.0) / 4.0)
    store_row4(out, 3, 0, first_lanes(count, x, splat4(v[0])) / y)
    store4(v, 0, x * 0.5)


def arrays():
    rng = np.random.default_rng(1)
    return rng.normal(size=(3, 7)), 1.0 + rng.random(5), np.zeros((4, 6))


@pytest.mark.parametrize("count", [0, 1, 3, LANES])
def test_operations_are_those_of_each_number(count):
    a, v, out = arrays()
    x, y, first = a[1, 2:6].copy(), v[1:5].copy(), v[0]
    everything(a, v, out, count)
    expected = np.zeros_like(out)
    expected[0, :4], expected[1, 1:5] = x + y, x - 2.0 * y
    expected[2, :4] = (3.0 - x) * (y + 1.0) / 4.0
    expected[3, :4] = np.where(np.arange(4) < count, x, first) / y
    np.testing.assert_allclose(out, expected, rtol=1e-14)
    np.testing.assert_array_equal(v[:4], 0.5 * x)


@pytest.mark.skipif(_UNCOMPILED, reason="compiled code is compared with Python")
def test_python_gives_what_compiled_code_gives():
    compiled, python = arrays(), arrays()
    everything(*compiled, 2)
    everything.py_func(*python, 2)
    for one, other in zip(compiled, python, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-14)


@pytest.mark.skipif(_UNCOMPILED, reason="Python takes any array")
def test_an_array_whose_numbers_do_not_follow_each_other_is_refused():
    from numba import TypingError

    a, v, out = arrays()
    with pytest.raises(TypingError, match="load_row4"):
        everything(a[:, ::-1], v, out, 1)
