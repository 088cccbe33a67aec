"""The error-state filter: strapdown, covariance and measurements in one resumable pass.

A pass takes samples one by one. Where a measurement falls between two of them, the sample is
divided in proportion, the covariance is predicted up to there, and the measurements of that instant
(an epoch) are taken one scalar after the other. Beside the covariance its parts, by the source of
the noise, go through the same gains: they add up to it.

The navigation is that of `schuler.kernels.strapdown` in its wander frame, or one at a fixed place,
for a vehicle that is stationary. There a sample may also be an interval of many samples, for which
`inside` holds the mean rotation and the displacement.

Source: Groves (2013), chapters 3 and 14.
"""

from __future__ import annotations

from schuler.kernels import ins_layout as layout
from schuler.kernels._jit import kernel
from schuler.kernels.covariance_steps import chain_transition, find_columns, move_state, predict
from schuler.kernels.entries import four, put_four
from schuler.kernels.error_rates import fill_transition
from schuler.kernels.flexure import couple_flexure, drive_flexure
from schuler.kernels.measurement_updates import take_group
from schuler.kernels.nominal_steps import feed_back, take_sample
from schuler.kernels.quat import qexp, qmul


@kernel
def predict_step(
    state, est, x, p, parts, at, cfg, options, walk, bound, fade, source, sign, transition, decay,
    columns, chain, scratch, flipped,
):  # fmt: skip
    """Predict error state, covariance and its parts over the span that was gathered."""
    size = p.shape[0]
    dynamic = 9 if at[layout.POSITION] >= 0 else 6
    work, rates = scratch[:9], scratch[9:18]
    block = flipped[size : size + 9]
    noise = scratch[18]
    line = scratch[19]
    t = state[layout.SPAN]
    fill_transition(transition, decay, rates, fade, state, at, cfg, options, dynamic)
    find_columns(transition, columns, dynamic)
    flexure = at[layout.FLEXURE]
    if flexure >= 0:
        # What is not on the transition's diagonal goes before; nothing else depends on it.
        couple_flexure(x, p, parts, chain, flexure, t, fade[flexure])
    move_state(x, transition, columns, decay, line, dynamic)
    for i in range(size):
        line[i] = walk[i] * t + bound[i] * (1.0 - decay[i] * decay[i])
        if fade[i] != 0.0 and sign[i] != 0.0:
            est[i] *= decay[i]
    if flexure >= 0:
        for i in range(flexure, flexure + 6):
            line[i] = 0.0
    if cfg[layout.VERTICAL] != 0.0:
        line[5] = 0.0
        if dynamic > 6:
            line[8] = 0.0
    predict(p, transition, columns, decay, line, work, flipped, block, dynamic)
    for m in range(parts.shape[0]):
        for i in range(size):
            noise[i] = line[i] if source[i] == m else 0.0
        predict(parts[m], transition, columns, decay, noise, work, flipped, block, dynamic)
    if flexure >= 0:
        own = int(source[flexure])
        drive_flexure(p, flexure, t, fade[flexure], bound[flexure])
        if own < parts.shape[0]:
            drive_flexure(parts[own], flexure, t, fade[flexure], bound[flexure])
    if chain.shape[0] > 0:
        chain_transition(chain, transition, columns, decay, work, dynamic)
    state[layout.SPENT] = 1.0


@kernel
def close_epoch(state, est, x, p, at, cfg, sign, out, row, keep_x, keep_p, chain):
    """Write a row of output for the epoch, feed the error estimates back; return rows written.

    Parameters
    ----------
    state, est, x, p, at, cfg, sign, out, keep_x, keep_p, chain
        As in `run`.
    row : int
        Where to write.
    """
    size = p.shape[0]
    phi = (x[0], x[1], x[2])
    q = qmul(qexp(phi), four(state, layout.QUAT_NB))
    written = 0
    if out.shape[0] > row:
        written = 1
        line = out[row]
        line[layout.O_TIME] = state[layout.TIME]
        put_four(line, layout.O_QUAT, q)
        for c in range(3):
            line[layout.O_V + c] = state[layout.V_N + c] - x[3 + c]
            line[layout.O_DISPLACEMENT + c] = state[layout.DISPLACEMENT + c]
            if at[layout.POSITION] >= 0 and cfg[layout.FIXED_PLACE] != 0.0:
                line[layout.O_DISPLACEMENT + c] -= x[6 + c]
        put_four(line, layout.O_FRAME, four(state, layout.QUAT_NE))
        line[layout.O_HEIGHT] = state[layout.HEIGHT]
        line[layout.O_SQUARES], line[layout.O_COUNT] = state[layout.SQUARES], state[layout.COUNT]
        for i in range(size):
            line[layout.O_SIZE + i] = est[i] + (-x[i] if sign[i] < 0.0 else x[i])
            line[layout.O_SIZE + size + i] = p[i, i]
    state[layout.SQUARES] = state[layout.COUNT] = 0.0
    kept = keep_x.shape[0] > row
    if kept:
        for i in range(size):
            keep_x[row, 1, i] = x[i]
            keep_x[row, 2, i] = 0.0
            for j in range(size):
                keep_p[row, 1, i, j] = p[i, j]
    if cfg[layout.FEEDBACK] != 0.0:
        feed_back(state, est, x, at, cfg, sign)
        if kept:
            for i in range(size):
                keep_x[row, 2, i] = keep_x[row, 1, i] - x[i]
                keep_x[row, 1, i] = x[i]
        if written and cfg[layout.FIXED_PLACE] == 0.0:
            put_four(out[row], layout.O_FRAME, four(state, layout.QUAT_NE))
            out[row, layout.O_HEIGHT] = state[layout.HEIGHT]
    if chain.shape[0] > 0:
        for i in range(size):
            for j in range(size):
                chain[i, j] = 1.0 if i == j else 0.0
    return written


@kernel
def run(
    state, survey, est, x, p, parts, at, cfg, options, walk, bound, fade, source, sign, aids,
    aid_state, transition, decay, columns, chain, scratch, flipped, time, dt, dtheta, dvel,
    inside, meas, first_sample, first_meas, out, keep_x, keep_p, outcomes,
):  # fmt: skip
    """Feed a chunk of samples and the measurements up to its end; resumable.

    Parameters
    ----------
    state : (STATE_SIZE,) float64
        The nominal navigation.
    survey : (schuler.kernels.strapdown.STATE_SIZE,) float64
        Its slow part, zero at the start.
    est, x : (size,) float64
        Nominal parameters, in the places of their error states; error states.
    p, parts : (size, size), (s, size, size) float64
        Covariance; its parts by source, or none.
    at : (GROUPS,) int64
        Where each group begins.
    cfg, options : (CFG_SIZE,), (7,) float64
        Settings; those of the strapdown.
    walk, bound, fade : (size,) float64
        Variance that grows by a second, steady variance of a Markov process, 1 / its time.
    source : (size,) int64
        Part to which the noise of each state belongs.
    sign : (size,) float64
        As in `feed_back`.
    aids, aid_state : (k, A_SIZE), (k, S_SIZE) float64
    transition, decay, columns : (9, size), (size,) float64, (3, size + 1) int64
        Of the last step.
    chain : (size, size) or (0, 0) float64
        Transition since the last epoch, where a smoother needs it.
    scratch, flipped : (40, size), (size + 9, 12) float64
        Scratch arrays.
    time, dt, dtheta, dvel : (n,), (n,), (n, 3), (n, 3) float64
        The samples, as in `ImuRecord`.
    inside : (n, 7) or (0, 7) float64
        For samples that are intervals at a fixed place: mean rotation from the body to the axes
        of the interval's start (quaternion), displacement there by the force alone.
    meas : (m, M_SIZE) float64
        Measurements in the order of time.
    first_sample, first_meas : int
        Where to begin.
    out : (k, O_SIZE + 2 size) float64
        A row for each epoch.
    keep_x, keep_p : (k, 3, size), (k, 3, size, size) float64, or (0, ...)
        For the smoother: x before, after and fed back; P before and after, and the transition.
    outcomes : (m, D_SIZE) float64
        Innovation, its sigma and the weight of each measurement.

    Returns
    -------
    int, int, int, int
        Samples and measurements taken so far, rows written, and why it came back.
    """
    # No rows, but no literal: of a literal 0 Numba would compile all that takes it once more.
    i, j, rows = first_sample, first_meas, min(first_sample, 0)
    size = p.shape[0]
    n, m = time.shape[0], meas.shape[0]
    none = inside[0] if inside.shape[0] > 0 else scratch[0, :0]
    while True:
        if state[layout.EPOCH_OPEN] != 0.0:
            # One epoch: all measurements of one instant.
            while j < m and meas[j, layout.M_TIME] <= state[layout.EPOCH_TIME] + 1e-9:
                if meas[j, layout.M_KIND] == layout.CUSTOM:
                    return i, j, rows, layout.AT_CUSTOM
                end = j
                while (
                    end < m and end - j < layout.MOST_ROWS // 3
                    and meas[end, layout.M_TIME] <= state[layout.EPOCH_TIME] + 1e-9
                    and meas[end, layout.M_AID] == meas[j, layout.M_AID]
                    and meas[end, layout.M_KIND] != layout.CUSTOM
                ):  # fmt: skip
                    end += 1
                take_group(
                    state, est, x, p, parts, at, cfg, transition, aids, aid_state, scratch,
                    meas, j, end, outcomes,
                )  # fmt: skip
                j = end
            rows += close_epoch(state, est, x, p, at, cfg, sign, out, rows, keep_x, keep_p, chain)
            state[layout.EPOCH_OPEN] = 0.0
        if i >= n:
            return i, j, rows, layout.ALL_SAMPLES
        start = time[i] - dt[i]
        done, target, hit = state[layout.CONSUMED], 1.0, False
        if j < m and meas[j, layout.M_TIME] <= time[i]:
            hit = True
            target = (meas[j, layout.M_TIME] - start) / dt[i]
            # An instant a rounding beside a sample is that of the sample.
            if target > 1.0 - 1e-9:
                target = 1.0
            elif target < 1e-9:
                target = 0.0
            target = max(target, done)
        if hit and 0 < out.shape[0] == rows:
            return i, j, rows, layout.TABLE_FULL
        if target > done:
            if inside.shape[0] > 0:
                none = inside[i]
            take_sample(
                state, survey, est, at, cfg, options, dt[i], target - done,
                (dtheta[i, 0], dtheta[i, 1], dtheta[i, 2]), (dvel[i, 0], dvel[i, 1], dvel[i, 2]),
                none,
            )  # fmt: skip
            state[layout.CONSUMED] = target
            state[layout.TIME] = time[i] if target == 1.0 else start + target * dt[i]
        due = state[layout.SPAN] >= cfg[layout.STEP] - 0.5 * dt[i]
        if target == 1.0:
            state[layout.CONSUMED] = 0.0
            state[layout.SAMPLES] += 1.0
            i += 1
        if state[layout.SPENT] == 0.0 and state[layout.SPAN] > 0.0 and (hit or due):
            predict_step(
                state, est, x, p, parts, at, cfg, options, walk, bound, fade, source, sign,
                transition, decay, columns, chain, scratch, flipped,
            )  # fmt: skip
        if hit:
            state[layout.EPOCH_OPEN] = 1.0
            state[layout.EPOCH_TIME] = meas[j, layout.M_TIME]
            if keep_x.shape[0] > rows:
                for a in range(size):
                    keep_x[rows, 0, a] = x[a]
                    for b in range(size):
                        keep_p[rows, 0, a, b] = p[a, b]
                        keep_p[rows, 2, a, b] = chain[a, b]
