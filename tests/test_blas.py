"""Small matrices are solved with one thread, and the caller's number of threads is put back."""

from __future__ import annotations

import subprocess
import sys
import threading

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController

from schuler._blas import one_blas_thread, with_one_blas_thread


@pytest.fixture
def threads(monkeypatch: pytest.MonkeyPatch):
    """Return what counts the threads of the linear algebra, after setting them to two."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    np.linalg.solve(np.eye(3), np.ones(3))
    found = ThreadpoolController().select(user_api="blas")
    if not found.lib_controllers:
        pytest.skip("the linear algebra has no threads")
    with found.limit(limits=2):
        if any(each.num_threads != 2 for each in found.lib_controllers):
            pytest.skip("the linear algebra has one thread here")
        yield lambda: {each.get_num_threads() for each in found.lib_controllers}


def test_threads_are_put_back_after_the_last_that_needed_one(threads) -> None:
    assert threads() == {2}
    with one_blas_thread():
        assert threads() == {1}
        assert with_one_blas_thread(threads)() == {1}
        assert threads() == {1}
    assert threads() == {2}
    with pytest.raises(ValueError, match="inside"), one_blas_thread():
        raise ValueError("inside")
    assert threads() == {2}


def test_two_callers_side_by_side_do_not_disturb_each_other(threads) -> None:
    inside, leave = threading.Event(), threading.Event()

    def other() -> None:
        with one_blas_thread():
            inside.set()
            leave.wait(10.0)

    one = threading.Thread(target=other)
    one.start()
    assert inside.wait(10.0)
    # Not every linear algebra takes a number of threads from a second thread: what counts is that
    # the last to leave puts back what the first found.
    with one_blas_thread():
        pass
    leave.set()
    one.join()
    assert threads() == {2}


def test_a_worker_that_has_loaded_numpy_already_has_one_thread() -> None:
    """A driver's script that imports NumPy is run again in its worker, before `start` is."""
    program = (
        "import numpy, os\n"
        "from threadpoolctl import threadpool_info, threadpool_limits\n"
        "threadpool_limits(2, user_api='blas')\n"
        "from schuler._processes import start\n"
        "start()\n"
        "print({each['num_threads'] for each in threadpool_info() if each['user_api'] == 'blas'})\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    # Without a BLAS that has threads there is none to count.
    assert done.stdout.strip() in ("{1}", "set()")
