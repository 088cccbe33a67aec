"""Kernels that are met first by several threads: one cache, in its own folder."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.compiled

CODE = """
import threading
from schuler.kernels import _numba_cache as cache
import numba

class Slow(cache._CheckedCache):
    def __init__(self, function):
        import time
        from numba.core import config
        time.sleep(0.02)
        assert config.CACHE_DIR == cache.CACHE_FOLDER, "the folder is another thread's"
        super().__init__(function)

cache._CheckedCache = Slow
from schuler.kernels import quat
found = []

def attach():
    made = numba.njit()(quat.quat_chain_many.py_func)
    cache.attach_cache(made, quat.quat_chain_many.py_func)
    found.append(type(made._cache).__name__)

threads = [threading.Thread(target=attach) for _ in range(6)]
[t.start() for t in threads]
[t.join() for t in threads]
print(set(found), len(found))
"""


def test_threads_do_not_take_each_other_s_folder(tmp_path):
    """A cache in the working folder is not named by the sources: old code would come back."""
    work = tmp_path / "work"
    work.mkdir()
    done = subprocess.run(
        [sys.executable, "-c", CODE], cwd=work, capture_output=True, text=True, timeout=120,
        env={**os.environ, "SCHULER_CACHE_DIR": str(tmp_path / "cache"), "NUMBA_DISABLE_JIT": "0"},
    )  # fmt: skip
    assert done.stdout.split() == ["{'Slow'}", "6"], done.stderr
    assert not list(work.iterdir())


LINKER = """
import threading, time
from schuler.kernels import _machine_code
import llvmlite.binding as llvm

made = []
create = llvm.create_mcjit_compiler

def slow(*arguments):
    engine = create(*arguments)
    made.append(engine)
    time.sleep(0.05)
    return engine

llvm.create_mcjit_compiler = slow
found = []
threads = [threading.Thread(target=lambda: found.append(_machine_code._linker())) for _ in range(6)]
[t.start() for t in threads]
[t.join() for t in threads]
print(len(made), len({id(each) for each in found}))
"""


def test_threads_share_one_linker(tmp_path):
    """A linker that another replaced would free the machine code that a thread is in."""
    done = subprocess.run(
        [sys.executable, "-c", LINKER], cwd=tmp_path, capture_output=True, text=True, timeout=120,
        env={**os.environ, "SCHULER_CACHE_DIR": str(tmp_path / "cache"), "NUMBA_DISABLE_JIT": "0"},
    )  # fmt: skip
    assert done.stdout.split() == ["1", "1"], done.stderr
