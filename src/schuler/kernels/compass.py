"""The classical gyrocompass: a level loop, then an azimuth loop, with fixed gains.

State and sample as in `schuler.kernels.fine`.
"""

from __future__ import annotations

from schuler.kernels._jit import kernel
from schuler.kernels.fine import carry
from schuler.kernels.quat import qexp, qmul


@kernel
def gyrocompass(state, cfg, gains, change, time, dt, dtheta, dvel, out):
    """Feed a chunk; resumable.

    A velocity north shows a tilt about east, and its growth a wrong azimuth:

        v_N' = g phi_E - l v_N,  phi_E' = -w_N phi_U - k v_N,  phi_U' = k_U v_N

    Parameters
    ----------
    state : (STATE_SIZE,) float64
    cfg : (25,) float64
        As in `schuler.kernels.fine.fine`.
    gains : (2, 5) float64
        Of each stage: velocity and tilt north, azimuth, velocity and tilt east.
    change : float
        When the second stage begins, s.
    time, dt, dtheta, dvel : (m,), (m,), (m, 3), (m, 3) float64
    out : (m, 5) float64
        Time and q_b^n after each sample.
    """
    s = state
    for i in range(time.shape[0]):
        t = dt[i]
        carry(
            s, cfg, t, (dtheta[i, 0], dtheta[i, 1], dtheta[i, 2]),
            (dvel[i, 0], dvel[i, 1], dvel[i, 2]),
        )  # fmt: skip
        stage = 1 if time[i] >= change else 0
        east, north = s[5], s[6]
        turn = (
            gains[stage, 1] * north * t,
            -gains[stage, 4] * east * t,
            -gains[stage, 2] * north * t,
        )
        q = qmul(qexp(turn), (s[1], s[2], s[3], s[4]))
        s[1], s[2], s[3], s[4] = q
        s[6] -= gains[stage, 0] * north * t
        s[5] -= gains[stage, 3] * east * t
        # The vertical channel is no part of it.
        s[7] = 0.0
        s[0] = time[i]
        out[i, 0] = time[i]
        for c in range(4):
            out[i, 1 + c] = s[1 + c]
