"""The classical gyrocompass: a level loop, then an azimuth loop, with fixed gains.

It navigates at a fixed place as the error-state filter does (`schuler.kernels.nominal_steps`), over
intervals, and feeds the mean velocity of each back.
"""

from __future__ import annotations

from schuler.kernels import ins_layout as layout
from schuler.kernels._jit import kernel
from schuler.kernels.entries import four, put_four, three
from schuler.kernels.nominal_steps import interval
from schuler.kernels.quat import qexp, qmul


@kernel
def gyrocompass(state, est, at, cfg, gains, change, time, dt, dtheta, dvel, inside, out):
    """Feed intervals; resumable.

    A velocity north shows a tilt about east, and its growth a wrong azimuth:

        v_N' = g phi_E - l v_N,  phi_E' = -w_N phi_U - k v_N,  phi_U' = k_U v_N

    Parameters
    ----------
    state, est, at, cfg
        As in `schuler.kernels.error_state.run`, of a filter without parameters.
    gains : (2, 5) float64
        Of each stage: velocity and tilt north, azimuth, velocity and tilt east.
    change : float
        When the second stage begins, s.
    time, dt, dtheta, dvel, inside : float64
        The intervals, as in `schuler.kernels.error_state.run`.
    out : (m, 5) float64
        Time and q_b^n after each.
    """
    none = (0.0, 0.0, 0.0)
    for i in range(time.shape[0]):
        t = dt[i]
        place = three(state, layout.DISPLACEMENT)
        interval(
            state, at, cfg, est, t, three(dtheta[i], 0), three(dvel[i], 0), none, none, inside[i],
            four(state, layout.QUAT_NB), three(state, layout.V_N),
        )  # fmt: skip
        stage = 1 if time[i] >= change else 0
        # Times the interval: what the vehicle shakes within it averages out.
        east = state[layout.DISPLACEMENT] - place[0]
        north = state[layout.DISPLACEMENT + 1] - place[1]
        turn = (
            gains[stage, 1] * north,
            -gains[stage, 4] * east,
            -gains[stage, 2] * north,
        )
        put_four(state, layout.QUAT_NB, qmul(qexp(turn), four(state, layout.QUAT_NB)))
        state[layout.V_N + 1] -= gains[stage, 0] * north
        state[layout.V_N] -= gains[stage, 3] * east
        state[layout.TIME] = time[i]
        out[i, 0] = time[i]
        for c in range(4):
            out[i, 1 + c] = state[layout.QUAT_NB + c]
