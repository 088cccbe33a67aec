"""Levels of a disturbance on a grid: the likelihood of each, and their mean."""

from __future__ import annotations

import math

from schuler.kernels._jit import kernel
from schuler.kernels.lanes import load4, load_row4, splat4, store_row4

AXES = 4
"""Axes of the grid; one that is not wanted has a single level of zero."""

PAD = 8
"""Modes are padded to a multiple of so many, with no share, no shape and one of what is known."""

_NOTHING = -45.0
"""Logarithm of a weight that changes no digit of the sum."""


@kernel
def weigh_levels(share, shapes, known, axes, counts, base, log, out):
    """Fill `out` with the likelihoods' greatest logarithm, their sum over the greatest, and means.

    A level of each shape makes variances `known + level @ shapes`, of which `share` are mean
    squares; the logarithm is -0.5 sum(share / variance + log(variance)) times the degrees of
    freedom, which are `out[0]`.

    Parameters
    ----------
    share, known : (k,) float64
        About one, so that products of a few are numbers; k is a multiple of `PAD`.
    shapes : (AXES, k) float64
    axes : (AXES, n) float64
        Levels to try, rising.
    counts : (AXES,) int64
        How many there are of each shape.
    base : (AXES, k) float64
        Scratch.
    log : (m,) float64
        Scratch, one number to each point of the grid.
    out : (2 + AXES,) float64
        Degrees of freedom; filled.
    """
    modes = share.shape[0]
    half = -0.5 * out[0]
    point = 0
    best = -math.inf
    for i in range(counts[0]):
        for k in range(modes):
            base[0, k] = known[k] + axes[0, i] * shapes[0, k]
        for j in range(counts[1]):
            for k in range(modes):
                base[1, k] = base[0, k] + axes[1, j] * shapes[1, k]
            for m in range(counts[2]):
                for k in range(modes):
                    base[2, k] = base[1, k] + axes[2, m] * shapes[2, k]
                for n in range(counts[3]):
                    level = axes[3, n]
                    total = splat4(0.0)
                    product = splat4(1.0)
                    logs = 0.0
                    for k in range(0, modes, 8):
                        a = load_row4(base, 2, k) + level * load_row4(shapes, 3, k)
                        b = load_row4(base, 2, k + 4) + level * load_row4(shapes, 3, k + 4)
                        both = a * b
                        # Two quotients by one division.
                        total = total + (load4(share, k) * b + load4(share, k + 4) * a) / both
                        product = product * both
                        if k % 24 == 16 or k + 8 == modes:
                            store_row4(base, 3, 0, product)
                            logs += math.log(base[3, 0] * base[3, 1])
                            logs += math.log(base[3, 2] * base[3, 3])
                            product = splat4(1.0)
                    store_row4(base, 3, 0, total)
                    total_4 = base[3, 0] + base[3, 1] + base[3, 2] + base[3, 3]
                    log[point] = half * (total_4 + logs)
                    best = max(best, log[point])
                    point += 1
    for c in range(AXES):
        out[2 + c] = 0.0
    point = 0
    whole = 0.0
    for i in range(counts[0]):
        for j in range(counts[1]):
            for m in range(counts[2]):
                for n in range(counts[3]):
                    below = log[point] - best
                    point += 1
                    if below < _NOTHING:
                        continue
                    weight = math.exp(below)
                    whole += weight
                    out[2] += weight * axes[0, i]
                    out[3] += weight * axes[1, j]
                    out[4] += weight * axes[2, m]
                    out[5] += weight * axes[3, n]
    out[0], out[1] = best, whole
    for c in range(AXES):
        out[2 + c] /= whole
