"""A path at every sample, from estimates at epochs: inertial navigation from one to the next.

A smoothed estimate joins the next one: what the navigation misses it by is spread over the
interval in proportion to time, so that no step remains.
"""

from __future__ import annotations

import math

from schuler.kernels import ins_layout as layout
from schuler.kernels._jit import helper, kernel
from schuler.kernels.entries import four, put_four, put_three, three
from schuler.kernels.measurement_rows import offset_from
from schuler.kernels.nominal_steps import move_position, take_sample
from schuler.kernels.quat import qconj, qexp, qlog, qmul, quat_to_matrix
from schuler.kernels.vec import scale

# A row of epochs.
E_TIME = 0
E_QUAT = 1  # 4
E_V = 5  # 3
E_FRAME = 8  # 4
E_HEIGHT = 12
E_SIZE = 13

# A row of the path.
P_QUAT = 0  # 4
P_V = 4  # 3
P_FRAME = 7  # 4
P_HEIGHT = 11
P_SIZE = 12


@helper
def _put(state, row):
    put_four(state, layout.QUAT_NB, four(row, E_QUAT))
    put_three(state, layout.V_N, three(row, E_V))
    put_four(state, layout.QUAT_NE, four(row, E_FRAME))
    state[layout.HEIGHT] = row[E_HEIGHT]


@helper
def _spread(state, epoch, time, begin, first, last, out):
    """Spread what the navigation misses an epoch by over the rows of the interval before it."""
    turn = qlog(qmul(four(epoch, E_QUAT), qconj(four(state, layout.QUAT_NB))))
    r0, r1, r2 = quat_to_matrix(four(epoch, E_FRAME))
    off = offset_from(
        four(state, layout.QUAT_NE), state[layout.HEIGHT],
        math.atan2(r2[2], math.hypot(r0[2], r1[2])), math.atan2(r1[2], r0[2]), epoch[E_HEIGHT],
    )  # fmt: skip
    dv = (
        epoch[E_V] - state[layout.V_N], epoch[E_V + 1] - state[layout.V_N + 1],
        epoch[E_V + 2] - state[layout.V_N + 2],
    )  # fmt: skip
    span = epoch[E_TIME] - begin
    for i in range(first, last):
        part = (time[i] - begin) / span
        row = out[i]
        put_four(row, P_QUAT, qmul(qexp(scale(part, turn)), four(row, P_QUAT)))
        for c in range(3):
            row[P_V + c] += part * dv[c]
        put_four(state, layout.QUAT_NE, four(row, P_FRAME))
        state[layout.HEIGHT] = row[P_HEIGHT]
        move_position(state, scale(-part, off))
        put_four(row, P_FRAME, four(state, layout.QUAT_NE))
        row[P_HEIGHT] = state[layout.HEIGHT]


@kernel
def fill_path(
    epochs, estimates, join, state, survey, at, cfg, options, time, dt, dtheta, dvel, out
):  # fmt: skip
    """Fill a row for each sample from the first epoch on.

    Parameters
    ----------
    epochs : (k, E_SIZE) float64
        Navigation after each epoch, in the order of time.
    estimates : (k, size) float64
        Parameters after each, in the places of their error states.
    join : bool
        Spread what is missed over each interval.
    state, survey, at, cfg, options
        As in `schuler.kernels.error_state.run`; state and survey are scratch arrays.
    time, dt, dtheta, dvel : (n,), (n,), (n, 3), (n, 3) float64
        Samples after the first epoch.
    out : (n, P_SIZE) float64
    """
    none = estimates[0, :0]
    k, begun = 0, 0
    _put(state, epochs[0])
    state[layout.SAMPLES] = 1.0
    for i in range(time.shape[0]):
        start, done = time[i] - dt[i], 0.0
        while True:
            target, hit = 1.0, False
            if k + 1 < epochs.shape[0] and epochs[k + 1, E_TIME] <= time[i]:
                hit = True
                target = (epochs[k + 1, E_TIME] - start) / dt[i]
                target = 1.0 if target > 1.0 - 1e-9 else max(target, done)
            if target > done:
                state[layout.CONSUMED] = done
                take_sample(
                    state, survey, estimates[k], at, cfg, options, dt[i], target - done,
                    (dtheta[i, 0], dtheta[i, 1], dtheta[i, 2]),
                    (dvel[i, 0], dvel[i, 1], dvel[i, 2]), none,
                )  # fmt: skip
                state[layout.SPENT] = 1.0
                done = target
            if not hit:
                break
            if join and epochs[k + 1, E_TIME] > epochs[k, E_TIME]:
                _spread(state, epochs[k + 1], time, epochs[k, E_TIME], begun, i, out)
            k += 1
            begun = i
            _put(state, epochs[k])
        row = out[i]
        put_four(row, P_QUAT, four(state, layout.QUAT_NB))
        put_three(row, P_V, three(state, layout.V_N))
        put_four(row, P_FRAME, four(state, layout.QUAT_NE))
        row[P_HEIGHT] = state[layout.HEIGHT]
