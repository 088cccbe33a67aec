"""What all tests share: data folders, seeded noise, the tracking kernel's state."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings
from numpy.typing import NDArray
from scipy.stats import chi2

ROOT = Path(__file__).resolve().parent.parent

# Kernels that run uncompiled (for their coverage) are a hundred times slower.
_EXAMPLES = 5 if os.environ.get("NUMBA_DISABLE_JIT") == "1" else 100

settings.register_profile("schuler", derandomize=True, deadline=None, max_examples=_EXAMPLES)
settings.load_profile("schuler")


LONG = os.environ.get("SCHULER_LONG") == "1"
"""Whether `make validate` runs: more cases and more runs of what quick tests hold too."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what is marked long, where it was not asked for."""
    if LONG:
        return
    config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("long")])
    items[:] = [item for item in items if not item.get_closest_marker("long")]


NORMAL_GRAVITY = {"gravity_sigma": 0.0, "deflection_sigma": 0.0}
"""Of a `Site` in the simulator, whose gravity is exactly that of the formula."""


@pytest.fixture(scope="session")
def root() -> Path:
    """Return the project's root."""
    return ROOT


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Return the folder of shared real records; skip where it is absent."""
    folder = Path(os.environ.get("SCHULER_DATA") or ROOT.parent / "shared" / "data")
    if not folder.is_dir():
        pytest.skip(f"no real records at {folder}: set SCHULER_DATA to their folder")
    return folder


@pytest.fixture(scope="session")
def reference_dir() -> Path:
    """Return the folder of other programs' outputs; skip where it is absent."""
    folder = Path(os.environ.get("SCHULER_REFERENCE") or ROOT.parent / "shared" / "reference")
    if not folder.is_dir():
        pytest.skip(f"no reference outputs at {folder}: set SCHULER_REFERENCE to their folder")
    return folder


@pytest.fixture
def rng() -> np.random.Generator:
    """Return a generator with a fixed seed."""
    return np.random.default_rng(20261123)


@pytest.fixture(scope="session")
def run_python() -> Callable[..., str]:
    """Return a function that runs Python code in a process of its own and gives its output."""

    def run(code: str, **environment: str) -> str:
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", code],
            capture_output=True,
            text=True,
            timeout=120,
            cwd=ROOT,
            env={**os.environ, **environment},
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    return run


def pieces(n: int, cuts: Iterable[int]) -> list[slice]:
    """Return slices that cover range(n), cut at the given places (repeated cuts: empty slices)."""
    edges = [0, *sorted(min(max(c, 0), n) for c in cuts), n]
    return [slice(a, b) for a, b in pairwise(edges)]


def chi_square_band(dof: int, false_alarm: float) -> tuple[float, float]:
    """Return the two-sided band that a chi-square sum leaves with probability `false_alarm`."""
    return float(chi2.ppf(false_alarm / 2, dof)), float(chi2.isf(false_alarm / 2, dof))


def run_track(
    time: NDArray[np.float64],
    dt: NDArray[np.float64],
    dtheta: NDArray[np.float64],
    dvel: NDArray[np.float64],
    *,
    n_sub: int = 1,
    coning: float = 1.0,
    sculling: float = 1.0,
    cuts: Iterable[int] = (),
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return state and used nodes of the tracking kernel, fed in pieces."""
    from schuler.kernels import tracking

    state = tracking.TrackerState.begin().data
    nodes = np.zeros((tracking.NODE_CAPACITY, tracking.ROW))
    for s in pieces(len(time), cuts):
        tracking.track(state, nodes, n_sub, coning, sculling, time[s], dt[s], dtheta[s], dvel[s])
    return state, nodes[: int(tracking.TrackerState(state).nodes)]
