"""Loops of the noise generators."""

from __future__ import annotations

import math

from schuler.kernels._jit import kernel


@kernel
def gauss_markov(dt, tau, sigma, state, normal, out):
    """Add increments of a first-order Gauss-Markov rate to `out`.

    Parameters
    ----------
    dt : (n,) float64
        s.
    tau, sigma : float
        Correlation time (s) and standard deviation of the rate.
    state : (m,) float64
        The rate of each axis; left ready for the next chunk.
    normal, out : (n, m) float64
        Unit normal numbers, and the increments.
    """
    for i in range(dt.shape[0]):
        rho = math.exp(-dt[i] / tau)
        kick = sigma * math.sqrt(-math.expm1(-2.0 * dt[i] / tau))
        for j in range(state.shape[0]):
            old = state[j]
            state[j] = rho * old + kick * normal[i, j]
            out[i, j] += 0.5 * (old + state[j]) * dt[i]
