"""Tracking the body from its start: attitude, velocity integral and running sums, in one pass.

Integrates C_b^ib0 with coning and sculling correction, v = integral of C_b^ib0 f dt, and the
sums over all updates that every inertial-frame estimator needs. Gravity enters through three
functions of time that do not know the latitude,

    b(t) = ( sin(wt)/w, (1 - cos(wt))/w, t ),

so that G(t) = g diag(cosL, cosL, sinL) b(t) is its integral in i0, and one pass serves any
latitude.

Coning and sculling as in `schuler.kernels.increments`.

The state begins with cumulative sums (`TrackerSums`); they and the sum of q are a node
(`TrackerNode`), a snapshot taken every so many updates. When the table of nodes is full every other
one is dropped and the spacing doubles, so that memory is constant for any length and any chunking.
"""

from __future__ import annotations

import math

from schuler.constants import EARTH_RATE
from schuler.kernels._jit import helper, kernel
from schuler.kernels.increments import coned, normalised, rotated_velocity, waiting_pair
from schuler.kernels.quat import qexp, qmul, qrotate
from schuler.kernels.states import NODE_CAPACITY, TrackerNode, TrackerState, TrackerSums
from schuler.kernels.vec import Vec, axpy

PLAIN = TrackerSums.size
ROW = TrackerNode.size
STATE_SIZE = TrackerState.size

__all__ = [
    "NODE_CAPACITY", "PLAIN", "ROW", "STATE_SIZE", "TrackerNode", "TrackerState", "attitudes",
    "gravity_basis", "track",
]  # fmt: skip


@helper
def gravity_basis(t: float) -> Vec:
    """Return b(t); 1 - cos is taken as 2 sin^2(half) to keep its digits."""
    a = EARTH_RATE * t
    s = math.sin(0.5 * a)
    return math.sin(a) / EARTH_RATE, 2.0 * s * s / EARTH_RATE, t


@helper
def _snapshot(state, node):
    """Fill a node (ROW,) from the state."""
    for c in range(PLAIN):
        node[c] = state[c]
    for c in range(4):
        node[PLAIN + c] = state[76 + c]


@kernel
def track(state, nodes, n_sub, coning, sculling, time, dt, dtheta, dvel):
    """Feed a chunk of samples.

    Parameters
    ----------
    state : (STATE_SIZE,) float64
        `TrackerState.begin` at the start.
    nodes : (NODE_CAPACITY, ROW) float64
        Snapshots (`TrackerNode`); row 0 is the start.
    n_sub : int
        Samples to an update, 1 to 4 (1 uses the sample before as well).
    coning, sculling : float
        1 to correct, 0 where the instrument has done it.
    time, dt, dtheta, dvel : (n,), (n,), (n, 3), (n, 3) float64
        The samples, as in `ImuRecord`.
    """
    if state[41] == 0.0 and time.shape[0] > 0:
        state[40] = time[0] - dt[0]
        state[73] = 1.0
        _snapshot(state, nodes[0])
    s = state
    for i in range(time.shape[0]):
        gx, gy, gz = dtheta[i, 0], dtheta[i, 1], dtheta[i, 2]
        ax, ay, az = dvel[i, 0], dvel[i, 1], dvel[i, 2]
        s[41] += 1.0
        s[30] += gx
        s[31] += gy
        s[32] += gz
        s[33] += ax
        s[34] += ay
        s[35] += az
        r = 1.0 / dt[i]
        w2 = (gx * gx + gy * gy + gz * gz) * r * r
        f2 = (ax * ax + ay * ay + az * az) * r * r
        s[36] += math.sqrt(w2)
        s[37] += w2
        s[38] += math.sqrt(f2)
        s[39] += f2

        k = int(s[48])
        j = 49 + 6 * k
        s[j], s[j + 1], s[j + 2] = gx, gy, gz
        s[j + 3], s[j + 4], s[j + 5] = ax, ay, az
        if k + 1 < n_sub:
            s[48] = k + 1.0
            continue
        s[48] = 0.0

        # The samples of this update: total angle and velocity, coning and sculling parts.
        ta, tv, con, scu = waiting_pair(s, n_sub)
        u = rotated_velocity(sculling, ta, tv, scu)
        q = (s[2], s[3], s[4], s[5])
        dv = qrotate(q, u)
        s[2], s[3], s[4], s[5] = normalised(qmul(q, qexp(axpy(coning, con, ta))))
        v0, v1, v2 = s[6] + dv[0], s[7] + dv[1], s[8] + dv[2]
        s[6], s[7], s[8] = v0, v1, v2
        s[42], s[43], s[44] = gx, gy, gz
        s[45], s[46], s[47] = ax, ay, az

        t = time[i] - s[40]
        b0, b1, b2 = gravity_basis(t)
        s[0] = t
        s[1] += 1.0
        s[9] += v0
        s[10] += v1
        s[11] += v2
        s[12] += b0
        s[13] += b1
        s[14] += b2
        s[15] += b0 * v0
        s[16] += b0 * v1
        s[17] += b0 * v2
        s[18] += b1 * v0
        s[19] += b1 * v1
        s[20] += b1 * v2
        s[21] += b2 * v0
        s[22] += b2 * v1
        s[23] += b2 * v2
        s[24] += b0 * b0
        s[25] += b0 * b1
        s[26] += b0 * b2
        s[27] += b1 * b1
        s[28] += b1 * b2
        s[29] += b2 * b2
        for c in range(4):
            s[76 + c] += s[2 + c]

        s[75] += 1.0
        if s[75] >= s[74]:
            s[75] = 0.0
            n = int(s[73])
            _snapshot(s, nodes[n])
            n += 1
            if n == nodes.shape[0]:
                for h in range(1, n // 2 + 1):
                    for c in range(ROW):
                        nodes[h, c] = nodes[2 * h, c]
                n = n // 2 + 1
                s[74] *= 2.0
            s[73] = n


@kernel
def attitudes(state, coning, dtheta, out):
    """Fill out (n, 4) with q_b^b0 at the middle of each sample, b0 the body at the start.

    Parameters
    ----------
    state : (7,) float64
        q_b^b0 at the end of the sample before and its angle increment; 1 and six zeros at the
        start. It is left ready for the next chunk.
    coning : float
        1 to correct for coning with the sample before, 0 where the instrument has done it.
    dtheta, out : (n, 3), (n, 4) float64
        Angle increments, rad, and quaternions.
    """
    q = (state[0], state[1], state[2], state[3])
    before = (state[4], state[5], state[6])
    for i in range(dtheta.shape[0]):
        a = (dtheta[i, 0], dtheta[i, 1], dtheta[i, 2])
        half = qmul(q, qexp((0.5 * a[0], 0.5 * a[1], 0.5 * a[2])))
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = half
        q = normalised(qmul(q, qexp(coned(coning, before, a))))
        before = a
    state[0], state[1], state[2], state[3] = q
    state[4], state[5], state[6] = before
