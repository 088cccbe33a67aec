"""Tracking with centred sums, beside the same in NumPy and SciPy.

One job: from 100 Hz increments to the attitude C_b^ib0 and the velocity integral v after every
update, and to the centred sums of gravity's integral and v that the alignment solves. The peers
do each step for all updates at once; only the product of rotations is a chain. One peer takes it
as people write it, a loop over `scipy.spatial.transform.Rotation`; the other by doubling
(log2(n) vectorised products), several times faster than the loop. All three must agree
before any is timed.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from schuler.constants import EARTH_RATE
from schuler.kernels import tracking

Array = NDArray[np.float64]

SAMPLES = 60_000  # ten minutes at 100 Hz
RATE = 100.0
REPEATS = 7

#: weights of the earlier samples of an update in the coning and sculling sums
WEIGHTS = {
    1: (1 / 12,),
    2: (2 / 3,),
    3: (9 / 20, 27 / 20),
    4: (54 / 105, 92 / 105, 214 / 105),
}


def record() -> tuple[Array, Array, Array, Array]:
    """Return time, dt, dtheta and dvel of a rocking instrument."""
    rng = np.random.default_rng(1)
    t = np.arange(1, SAMPLES + 1) / RATE
    sway = np.column_stack([np.sin(3.1 * t), np.cos(2.3 * t), np.sin(1.7 * t)])
    dtheta = 0.02 / RATE * sway + rng.normal(scale=1e-6, size=sway.shape)
    dvel = np.array([0.0, 0.0, 9.8]) / RATE + rng.normal(scale=1e-4, size=sway.shape)
    return t, np.full(SAMPLES, 1.0 / RATE), dtheta, dvel


def centred(n: float, sb: Array, sv: Array, sbv: Array, sbb: Array) -> Array:
    """Return the centred sums of b v^T and b b^T, side by side."""
    return np.hstack([sbv - np.outer(sb, sv) / n, sbb - np.outer(sb, sb) / n])


def ours(n_sub: int, t: Array, dt: Array, dtheta: Array, dvel: Array) -> tuple[Array, ...]:
    """Return end attitude (w, x, y, z), end velocity and centred sums by the kernel."""
    state = np.zeros(tracking.STATE_SIZE)
    state[2] = state[74] = 1.0
    nodes = np.empty((tracking.NODE_CAPACITY, tracking.ROW))
    tracking.track(state, nodes, n_sub, 1.0, 1.0, t, dt, dtheta, dvel)
    xx, xy, xz, yy, yz, zz = state[24:30]
    sbb = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    sums = centred(state[1], state[12:15], state[9:12], state[15:24].reshape(3, 3), sbb)
    return state[2:6], state[6:9], sums


def chain_by_loop(turns: Rotation) -> Array:
    """Return the attitudes after each turn (n, 4), scalar last, one product at a time."""
    now, out = Rotation.identity(), np.empty((len(turns), 4))
    for i, turn in enumerate(turns):
        now = now * turn
        out[i] = now.as_quat()
    return out


def chain_by_doubling(turns: Rotation) -> Array:
    """Return the same by a parallel prefix of vectorised products."""
    q = turns.as_quat()
    step = 1
    while step < len(q):
        q[step:] = (Rotation.from_quat(q[:-step]) * Rotation.from_quat(q[step:])).as_quat()
        step *= 2
    return q


def peer(
    chain: Callable[[Rotation], Array],
    n_sub: int,
    t: Array,
    dt: Array,
    dtheta: Array,
    dvel: Array,
) -> tuple[Array, ...]:
    """Return the same as `ours`, each step for all updates at once."""
    a, v = dtheta.reshape(-1, n_sub, 3), dvel.reshape(-1, n_sub, 3)
    last_a, last_v = a[:, -1], v[:, -1]
    if n_sub == 1:
        before_a = np.vstack([np.zeros(3), last_a[:-1]]) / 12.0
        before_v = np.vstack([np.zeros(3), last_v[:-1]]) / 12.0
    else:
        before_a = np.einsum("k,nki->ni", WEIGHTS[n_sub], a[:, :-1])
        before_v = np.einsum("k,nki->ni", WEIGHTS[n_sub], v[:, :-1])
    ta, tv = a.sum(1), v.sum(1)
    phi = ta + np.cross(before_a, last_a)
    sculling = np.cross(before_a, last_v) + np.cross(before_v, last_a)
    angle2 = np.maximum((ta**2).sum(1), 1e-20)[:, None]
    angle = np.sqrt(angle2)
    c1 = 2.0 * np.sin(0.5 * angle) ** 2 / angle2
    # At these angles the series to third order is exact to rounding.
    c2 = (1.0 - angle2 / 20.0 + angle2**2 / 840.0) / 6.0
    cross = np.cross(ta, tv)
    dv = tv + c1 * cross + c2 * np.cross(ta, cross) + sculling

    after = chain(Rotation.from_rotvec(phi))
    start = np.vstack([[0.0, 0.0, 0.0, 1.0], after[:-1]])
    velocity = np.cumsum(Rotation.from_quat(start).apply(dv), axis=0)
    wt = EARTH_RATE * t[n_sub - 1 :: n_sub]
    b = np.column_stack([np.sin(wt), 2.0 * np.sin(0.5 * wt) ** 2, wt]) / EARTH_RATE
    sums = centred(len(b), b.sum(0), velocity.sum(0), b.T @ velocity, b.T @ b)
    end = after[-1] if after[-1, 3] >= 0 else -after[-1]
    return end[[3, 0, 1, 2]], velocity[-1], sums


def best(job: Callable[[], object], repeats: int) -> float:
    """Return the shortest of several runs, s, after one that is not counted."""
    job()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        job()
        times.append(time.perf_counter() - start)
    return min(times)


def run() -> list[dict[str, Any]]:
    """Time the kernel and its peers for one to four samples an update."""
    data = record()
    rows = []
    for n_sub in WEIGHTS:
        mine = ours(n_sub, *data)
        us = best(lambda n=n_sub: ours(n, *data), REPEATS) / SAMPLES * 1e6
        for label, chain, repeats in (
            ("SciPy loop", chain_by_loop, 1),
            ("SciPy doubling", chain_by_doubling, REPEATS),
        ):
            for a, b in zip(mine, peer(chain, n_sub, *data), strict=True):
                np.testing.assert_allclose(a, b, rtol=1e-8, atol=1e-10 * np.abs(a).max())
            job = lambda n=n_sub, c=chain: peer(c, n, *data)  # noqa: E731
            theirs = best(job, repeats) / SAMPLES * 1e6
            rows.append(
                {
                    "what": f"track and sum, {n_sub} sample(s) an update, beside {label}",
                    "ours": us,
                    "peer": theirs,
                    "ratio": theirs / us,
                    "unit": "us/sample",
                }
            )
    return rows
