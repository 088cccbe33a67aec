"""Kernels without Numba: the same bits, the same refusals, and no import of it."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import numpy as np
import pytest

from schuler.kernels import _machine_code as machine_code
from schuler.kernels import blocks, earth, intake, quat, residuals, tracking
from schuler.kernels.states import SummaryState

pytestmark = [
    pytest.mark.compiled,
    pytest.mark.skipif(not machine_code.available(), reason="kernels are called through Numba"),
]


def quaternions(n=50, seed=1):
    q = np.random.default_rng(seed).normal(size=(n, 4))
    return q / np.linalg.norm(q, axis=1)[:, None]


def samples(n=400):
    rng = np.random.default_rng(4)
    time, dt = np.arange(1, n + 1) * 0.01, np.full(n, 0.01)
    return time, dt, rng.normal(size=(n, 3)) * 1e-4, rng.normal(size=(n, 3)) * 1e-3 + 0.098


def tracked(call, dtheta, dvel, time, dt):
    state = tracking.TrackerState.begin().data
    nodes = np.zeros((tracking.NODE_CAPACITY, tracking.ROW))
    call(state, nodes, 1, 1.0, 1.0, time, dt, dtheta, dvel)
    return np.concatenate([state, nodes.ravel()])


@pytest.mark.parametrize("strided", [False, True])
def test_the_bits_are_those_of_numba(strided):
    time, dt, dtheta, dvel = samples()
    if strided:
        wide = np.hstack([dtheta, dvel])
        dtheta, dvel = wide[:, :3], wide[:, 3:]
    with_numba = tracked(tracking.track.wrapped, dtheta, dvel, time, dt)
    assert np.array_equal(tracked(tracking.track, dtheta, dvel, time, dt), with_numba)


def test_what_a_kernel_returns():
    assert residuals.median_of(np.array([3.0, 1.0, 2.0]), 3) == 2.0
    assert residuals.median_of(np.array([3.0, 1.0, 2.0, 9.0]), 4) == 2.5
    rows = np.zeros((30, intake.ROW))
    assert residuals.is_uneven(rows, 10, 30) is False
    rows[11, 10] = -1.0
    assert residuals.is_uneven(rows, 10, 30) is True
    assert residuals.reach_of(1) == 3
    time = np.arange(1, 31) * 0.01
    found = intake.check(np.zeros(intake.STATE_SIZE), 0.01, 1.0, time, np.ones((30, 6)), rows)
    assert found[:2] == (30, intake.OK)
    assert all(type(part) is int for part in found)


def test_scalars_of_numpy_are_taken_as_those_of_python():
    values = np.array([5.0, 4.0, 3.0, 2.0, 1.0])
    assert residuals.median_of(values.copy(), np.int64(5)) == 3.0
    assert residuals.median_of(values.copy(), 5) == 3.0


def test_arguments_by_name_and_defaults():
    time, dt, dtheta, dvel = samples()
    table = np.zeros((blocks.STRETCH_CAPACITY, blocks.StretchSums.size))
    one, other = SummaryState.zeros().data, SummaryState.zeros().data
    blocks.summarise(one, table.copy(), time, dt, dtheta, dvel)
    blocks.summarise(other, table, time=time, dt=dt, dtheta=dtheta, dvel=dvel, values=None)
    assert np.array_equal(one, other)
    with pytest.raises(TypeError):
        blocks.summarise(one, table)


def test_an_array_that_must_not_be_changed():
    """It is read; where a kernel would write to it, Numba refuses as it always did."""
    q, out = quaternions(), np.zeros((50, 3, 3))
    q.flags.writeable = False
    quat.quat_to_matrix_many(q, out)
    expected = np.zeros((50, 3, 3))
    quat.quat_to_matrix_many(q.copy(), expected)
    assert np.array_equal(out, expected)
    out.flags.writeable = False
    with pytest.raises(Exception, match=r"[Rr]eadonly|[Cc]annot modify"):
        quat.quat_to_matrix_many(q, out)


def test_other_arrays_of_the_same_python_type_are_not_mistaken():
    """Two dimensions are not taken for three, nor whole numbers for others."""
    q = quaternions(3)
    out = np.zeros((3, 3, 3))
    quat.quat_to_matrix_many(q, out)
    with pytest.raises(Exception, match="Failed in nopython mode"):
        quat.quat_to_matrix_many(q, np.zeros((3, 9)))
    assert residuals.median_of(np.array([3, 1, 2]), 3) == 2
    foreign = np.frombuffer(q.astype(">f8").tobytes(), ">f8").reshape(3, 4)
    assert machine_code.describe((foreign,)) is None
    single = np.zeros((3, 4), np.float32)
    assert machine_code.describe((single, out)) is None
    assert machine_code.describe((2**63,)) is None


def test_threads_call_it_at_once():
    lat = np.linspace(-1.5, 1.5, 20_000)
    height = np.zeros_like(lat)
    expected = np.zeros_like(lat)
    earth.gravity_many(lat, height, expected)
    found = [np.zeros_like(lat) for _ in range(8)]
    threads = [threading.Thread(target=earth.gravity_many, args=(lat, height, f)) for f in found]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(f, expected) for f in found)


def test_numba_is_not_imported_where_the_kernels_are_in_the_folder(tmp_path):
    code = (
        "import sys, numpy as np, schuler as sc\n"
        "from schuler.record import ImuRecord\n"
        "n = 3000; rng = np.random.default_rng(1)\n"
        "r = ImuRecord(np.arange(1, n + 1) / 100, np.full(n, 0.01), rng.normal(size=(n, 3)) * 1e-6,"
        " rng.normal(size=(n, 3)) * 1e-5 + [0, 0, 0.098])\n"
        "print(sc.align(r, sc.Site(45.0)).heading_deg, 'numba' in sys.modules)"
    )
    said = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True,
            timeout=120, env={**os.environ, "SCHULER_CACHE_DIR": str(tmp_path)},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        said.append(done.stdout.split())
    assert [word for _, word in said] == ["True", "False"]
    assert said[0][0] == said[1][0]
