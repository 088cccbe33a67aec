"""Coning and sculling of increments, and the length of a quaternion: once, for every loop.

One sample with the one before it, or two, three or four samples to an update, with the compressed
coefficients of Miller (1983), Ignagni (1996) and Savage (1998). The velocity's rotation correction
is exact for a constant rate, not cut after its first term.
"""

from __future__ import annotations

from schuler.kernels._jit import helper, inlined
from schuler.kernels.quat import Quat, rotation_averages
from schuler.kernels.states import StrapdownState, TrackerState
from schuler.kernels.vec import Vec, add, axpy, cross, scale

__all__ = ["coned", "normalised", "previous_pair", "rotated_velocity", "waiting_pair"]

TWELFTH = 1.0 / 12.0

_LAST_A, _LAST_V = TrackerState.last_dtheta.start, TrackerState.last_dvel.start
_WAITING = TrackerState.waiting_samples.start

# Both loops keep the samples of an update in the same place.
if (
    StrapdownState.last_dtheta.start,
    StrapdownState.last_dvel.start,
    StrapdownState.waiting_samples.start,
) != (_LAST_A, _LAST_V, _WAITING):
    raise AssertionError("the states of tracker and strapdown keep their samples apart")


@inlined
def normalised(q: Quat) -> Quat:
    """Return q scaled to unit length by one Newton step, which keeps it at 1 to rounding."""
    m = 1.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return m * q[0], m * q[1], m * q[2], m * q[3]


@helper
def previous_pair(before_a: Vec, before_v: Vec, a: Vec, v: Vec) -> tuple[Vec, Vec]:
    """Return coning and sculling of one sample by the one before it."""
    ca, cv = scale(TWELFTH, before_a), scale(TWELFTH, before_v)
    return cross(ca, a), add(cross(ca, v), cross(cv, a))


@helper
def coned(coning: float, before: Vec, a: Vec) -> Vec:
    """Return the rotation vector of one sample; `coning` is 1 to correct it, 0 not to."""
    return axpy(coning / 12.0, cross(before, a), a)


@helper
def rotated_velocity(sculling: float, a: Vec, v: Vec, scu: Vec) -> Vec:
    """Return the velocity increment in the axes of the update's start.

    `scu` is the sculling; where `sculling` is 0 the instrument has done both.
    """
    if sculling == 0.0:
        return v
    c1, c2 = rotation_averages(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    x1 = cross(a, v)
    return add(axpy(c1, x1, axpy(c2, cross(a, x1), v)), scu)


@helper
def _waiting(state, k) -> tuple[Vec, Vec]:
    i = _WAITING + 6 * k
    return (state[i], state[i + 1], state[i + 2]), (state[i + 3], state[i + 4], state[i + 5])


@helper
def waiting_pair(state, n_sub: int) -> tuple[Vec, Vec, Vec, Vec]:
    """Return angle, velocity, coning and sculling of the samples that wait in a state."""
    last_a, last_v = _waiting(state, n_sub - 1)
    if n_sub == 1:
        i, j = _LAST_A, _LAST_V
        con, scu = previous_pair(
            (state[i], state[i + 1], state[i + 2]), (state[j], state[j + 1], state[j + 2]),
            last_a, last_v,
        )  # fmt: skip
        return last_a, last_v, con, scu
    a0, v0 = _waiting(state, 0)
    ta, tv = add(a0, last_a), add(v0, last_v)
    zero = (0.0, 0.0, 0.0)
    if n_sub == 2:
        ca, cv = axpy(2.0 / 3.0, a0, zero), axpy(2.0 / 3.0, v0, zero)
    else:
        a1, v1 = _waiting(state, 1)
        ta, tv = add(ta, a1), add(tv, v1)
        if n_sub == 3:
            ca = axpy(9.0 / 20.0, a0, axpy(27.0 / 20.0, a1, zero))
            cv = axpy(9.0 / 20.0, v0, axpy(27.0 / 20.0, v1, zero))
        else:
            a2, v2 = _waiting(state, 2)
            ta, tv = add(ta, a2), add(tv, v2)
            k0, k1, k2 = 54.0 / 105.0, 92.0 / 105.0, 214.0 / 105.0
            ca = axpy(k0, a0, axpy(k1, a1, axpy(k2, a2, zero)))
            cv = axpy(k0, v0, axpy(k1, v1, axpy(k2, v2, zero)))
    return ta, tv, cross(ca, last_a), add(cross(ca, last_v), cross(cv, last_a))
