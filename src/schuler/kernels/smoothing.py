"""Fixed-interval smoothing of a filter's epochs (Rauch, Tung and Striebel, 1965), with feedback.

After epoch k the filter had the error estimate x_k and the covariance P_k; before the measurements
of the next epoch it predicted x'_{k+1} and P'_{k+1} with the transition Phi, and then fed c_{k+1}
back, which the nominal lost. With s_K = x_K and S_K = P_K at the last epoch,

    G_k = P_k Phi^T P'_{k+1}^-1
    s_k = x_k + G_k (s_{k+1} + c_{k+1} - x'_{k+1})
    S_k = P_k + G_k (S_{k+1} - P'_{k+1}) G_k^T

so that s_k is the smoothed error of the nominal as it stood after epoch k.
"""

from __future__ import annotations

import math

from schuler.kernels._jit import kernel

FLOOR = 1e-13
"""Part of a variance below which what is left of it after the others counts for nothing."""


@kernel
def smooth(x_before, x_after, fed_back, p_before, p_after, transition, xs, ps, work, gain, scale):
    """Smooth backwards.

    Parameters
    ----------
    x_before, x_after, fed_back : (k, n) float64
        Error estimates before and after the measurements of each epoch (after the feedback), and
        what was fed back.
    p_before, p_after, transition : (k, n, n) float64
        Covariances, and the transition from the epoch before.
    xs, ps : (k, n), (k, n, n) float64
        Filled.
    work, gain, scale : (n, n), (n, n), (n,) float64
        Scratch arrays.
    """
    count, n = x_after.shape
    last = count - 1
    for j in range(n):
        xs[last, j] = x_after[last, j]
        for m in range(n):
            ps[last, j, m] = p_after[last, j, m]
    for i in range(last - 1, -1, -1):
        p, phi = p_before[i + 1], transition[i + 1]
        # Cholesky factor of the prediction, scaled to a unit diagonal. A state without variance,
        # or one that others determine, takes no part.
        for j in range(n):
            scale[j] = 1.0 / math.sqrt(p[j, j]) if p[j, j] > 0.0 else 0.0
        for j in range(n):
            for m in range(j + 1):
                total = scale[j] * p[j, m] * scale[m]
                for c in range(m):
                    total -= work[j, c] * work[m, c]
                if j == m:
                    work[j, j] = math.sqrt(total) if total > FLOOR else 0.0
                else:
                    work[j, m] = total / work[m, m] if work[m, m] > 0.0 else 0.0
        for j in range(n):
            for m in range(n):
                total = 0.0
                for c in range(n):
                    total += p_after[i, j, c] * phi[m, c]
                gain[j, m] = total * scale[m]
            for m in range(n):
                total = gain[j, m]
                for c in range(m):
                    total -= work[m, c] * gain[j, c]
                gain[j, m] = total / work[m, m] if work[m, m] > 0.0 else 0.0
            for m in range(n - 1, -1, -1):
                total = gain[j, m]
                for c in range(m + 1, n):
                    total -= work[c, m] * gain[j, c]
                gain[j, m] = total / work[m, m] if work[m, m] > 0.0 else 0.0
            for m in range(n):
                gain[j, m] *= scale[m]
        for j in range(n):
            total = x_after[i, j]
            for c in range(n):
                total += gain[j, c] * (xs[i + 1, c] + fed_back[i + 1, c] - x_before[i + 1, c])
            xs[i, j] = total
        for j in range(n):
            for m in range(n):
                total = 0.0
                for c in range(n):
                    total += gain[j, c] * (ps[i + 1, c, m] - p[c, m])
                work[j, m] = total
        for j in range(n):
            for m in range(j, n):
                total = p_after[i, j, m]
                for c in range(n):
                    total += work[j, c] * gain[m, c]
                ps[i, j, m] = total
                ps[i, m, j] = total
