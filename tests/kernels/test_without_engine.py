"""Kernels are compiled without Numba's engine, and nobody else is."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.kernels import _machine_code as machine_code
from schuler.kernels import quat
from schuler.kernels._entry_points import compile_entry, numba_types
from schuler.kernels._jit import _names

pytestmark = [
    pytest.mark.compiled,
    pytest.mark.skipif(not machine_code.available(), reason="kernels are called through Numba"),
]


def dispatcher_of(kernel):
    """Return a dispatcher that has compiled nothing, and what it is compiled for."""
    import numba

    from schuler.kernels._jit import _with_dispatchers

    return numba.njit(
        error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, **kernel._options
    )(_with_dispatchers(kernel.py_func))


def test_a_kernel_is_not_loaded_into_the_engine_of_numba():
    words = ("f8:2", "f8:2")
    dispatcher = dispatcher_of(quat.quat_to_rotvec_many)
    assert compile_entry(dispatcher, words, "schuler_test_not_loaded", _names) is not None
    made = dispatcher.overloads[numba_types(words)]
    engine = made.library.codegen._engine
    name = made.fndesc.llvm_func_name
    assert not engine.is_symbol_defined(name)
    # Numba alone loads it.
    other = dispatcher_of(quat.quat_to_rotvec_many)
    other.compile(numba_types(words))
    made = other.overloads[numba_types(words)]
    assert engine.is_symbol_defined(made.fndesc.llvm_func_name)


def test_what_others_compile_with_numba_is_loaded_and_called():
    """Numba keeps functions of its own that a kernel made it compile."""
    import numba

    words = ("f8:2", "f8:3")
    found = compile_entry(
        dispatcher_of(quat.quat_to_matrix_many), words, "schuler_test_before_others", _names
    )
    assert found is not None

    @numba.njit
    def theirs(a, b):
        return max(a, b) + int(a) ** 2 + np.zeros(3).shape[0]

    assert theirs(2.5, 1.0) == 2.5 + 4 + 3
