"""Measurements of one instant: judged by their innovation, taken one scalar after the other.

Sources: Joseph's form of Bucy and Joseph (1968); Huber (1964) and Yang's IGG-III (1994) for robust
updates; Sage and Husa (1969) for adaptive noise.
"""

from __future__ import annotations

import math

from schuler.kernels import ins_layout as layout
from schuler.kernels._jit import helper, kernel
from schuler.kernels.covariance_steps import apply_gain, joint_square, sparse_product
from schuler.kernels.measurement_rows import fill_rows

H_ROWS, Z_ROW, R_ROW = 20, 26, 27
"""Rows of the scratch array with H, predicted minus measured, and variances."""


@helper
def robust_weight(rule, ratio, low, high) -> float:
    """Return the weight of a measurement whose innovation is `ratio` of its sigma."""
    if rule == layout.HUBER and ratio > low:
        return low / ratio
    if rule == layout.IGG3 and ratio > low:
        if ratio >= high:
            return 0.0
        part = (high - ratio) / (high - low)
        return low / ratio * part * part
    return 1.0


@kernel
def take_group(
    state, est, x, p, parts, at, cfg, transition, aids, aid_state, scratch, meas, j, end, outcomes
):  # fmt: skip
    """Judge and take the measurements j to end - 1, which are of one aid at one instant."""
    rows, z, r = scratch[H_ROWS : H_ROWS + layout.MOST_ROWS], scratch[Z_ROW], scratch[R_ROW]
    # Nothing, but no literal: of a literal 0 Numba would compile all that takes it once more.
    count = min(j, 0)
    for m in range(j, end):
        k = int(meas[m, layout.M_AID])
        found = fill_rows(
            meas[m], aids[k], state, est, at, cfg, transition, rows[count : count + 3],
            z[count : count + 3], r[count : count + 3],
        )  # fmt: skip
        count += found
    k = int(meas[j, layout.M_AID])
    weight = take_rows(
        state, x, p, parts, at, aids[k], aid_state[k], scratch, count, outcomes[j : end]
    )  # fmt: skip
    for m in range(j, end):
        outcomes[m, layout.D_WEIGHT] = weight


@kernel
def take_rows(state, x, p, parts, at, aid, aid_state, scratch, count, outcomes):
    """Judge and take the first `count` rows of `scratch`; return the least weight, 0 for refused.

    Parameters
    ----------
    state, x, p, parts, at
        As in `run`.
    aid, aid_state : (A_SIZE,), (S_SIZE,) float64
    scratch : (40, size) float64
        Rows 20-25 hold H, 26 predicted minus measured, 27 variances.
    count : int
    outcomes : (n, D_SIZE) float64
        Filled with innovations and their sigma, three a row.
    """
    size = p.shape[0]
    rows, z, r = scratch[H_ROWS : H_ROWS + layout.MOST_ROWS], scratch[Z_ROW], scratch[R_ROW]
    ph, gain, spare, part_ph = scratch[28], scratch[29], scratch[30], scratch[31]
    s, e = scratch[32:38], scratch[38]
    memory = aid[layout.A_MEMORY]
    for m in range(count):
        total = sparse_product(p, rows[m], ph)
        if memory > 0.0:
            r[m] = max(r[m], aid_state[layout.S_NOISE + m])
        e[m] = z[m]
        for i in range(size):
            e[m] -= rows[m, i] * x[i]
        for n in range(m):
            total_n = 0.0
            for i in range(size):
                total_n += rows[n, i] * ph[i]
            s[m, n] = total_n
            s[n, m] = total_n
        s[m, m] = total + r[m]
        if m // 3 < outcomes.shape[0]:
            outcomes[m // 3, layout.D_INNOVATION + m % 3] = e[m]
            outcomes[m // 3, layout.D_SIGMA + m % 3] = math.sqrt(s[m, m])
    if aid[layout.A_GATED] != 0.0 and count > 0:
        square = joint_square(e, s, count)
        now = state[layout.TIME]
        if square > aid[layout.A_GATE + count - 1]:
            aid_state[layout.S_REFUSED] += 1.0
            late = now - aid_state[layout.S_LAST] > aid[layout.A_GUARD_TIME]
            if aid_state[layout.S_REFUSED] <= aid[layout.A_GUARD_COUNT] and not late:
                state[layout.REFUSED] += count
                return 0.0
            # Refused for too long: it is the navigation that is wrong. Where the measurement
            # sees position and velocity, they are as uncertain as the innovation is large.
            state[layout.RESETS] += 1.0
            _widen(x, p, parts, at, int(aid[layout.A_SOURCE]), rows, z, count)
        aid_state[layout.S_REFUSED] = 0.0
        aid_state[layout.S_LAST] = now
    aid_state[layout.S_TAKEN] += 1.0
    least = 1.0
    for m in range(count):
        h = rows[m]
        known = r[m]
        variance = known + sparse_product(p, h, ph)
        innovation = z[m]
        for i in range(size):
            innovation -= h[i] * x[i]
        ratio = abs(innovation) / math.sqrt(variance)
        if memory > 0.0:
            # The innovation's own share of noise, forgotten slowly; not from one outlier.
            own = min(innovation * innovation, 9.0 * variance) - (variance - known)
            aid_state[layout.S_NOISE + m] += memory * (
                max(own, 0.0) - aid_state[layout.S_NOISE + m]
            )
        weight = robust_weight(
            int(aid[layout.A_RULE]), ratio, aid[layout.A_LOW], aid[layout.A_HIGH]
        )
        least = min(least, weight)
        if weight == 0.0:
            state[layout.REFUSED] += 1.0
            continue
        if weight < 1.0:
            state[layout.WEIGHED] += 1.0
            variance += known / weight - known
            known /= weight
        state[layout.SQUARES] += innovation * innovation / variance
        state[layout.COUNT] += 1.0
        inverse = 1.0 / variance
        for i in range(size):
            gain[i] = inverse * ph[i]
            x[i] += gain[i] * innovation
        apply_gain(p, h, ph, gain, known, spare)
        for n in range(parts.shape[0]):
            sparse_product(parts[n], h, part_ph)
            apply_gain(
                parts[n], h, part_ph, gain, known if n == int(aid[layout.A_SOURCE]) else 0.0, spare
            )
    return least


@helper
def _widen(x, p, parts, at, source, rows, z, count):
    """Add the squared innovations to the covariance, along what the rows see."""
    last = 9 if at[layout.POSITION] >= 0 else 6
    for m in range(count):
        first = 3
        square = 0.0
        for i in range(first, last):
            square += rows[m, i] * rows[m, i]
        if square == 0.0:
            first = 0
            for i in range(3):
                square += rows[m, i] * rows[m, i]
        if square == 0.0:
            continue
        innovation = z[m]
        for i in range(x.shape[0]):
            innovation -= rows[m, i] * x[i]
        size = innovation / square
        for i in range(first, last):
            for j in range(first, last):
                more = size * rows[m, i] * size * rows[m, j]
                p[i, j] += more
                if parts.shape[0] > 0:
                    parts[source, i, j] += more
