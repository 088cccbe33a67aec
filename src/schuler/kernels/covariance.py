"""The strapdown's error state: covariance of attitude, velocity, position and biases.

States: phi (3), velocity (3) and position (3, m) errors in the navigation frame, gyro bias (3) and
accelerometer bias (3) in the body; C_est = (I - [phi x]) C_true, the others estimate minus truth.
With w_ie, w_en the rates of Earth and frame, K the curvature tensor, U(v) = up x K v,

    phi'  = -(w_ie + w_en) x phi + w_ie x U(dr) + U(dv) - C eps
    dv'   = f x phi - (2 w_ie + w_en) x dv + v x (2 w_ie x U(dr) + U(dv)) + 2 g/R dr_up + C nabla
    dr'   = dv - w_en x dr  (its up component: dv_up)

and U(dv) with - w_en dr_up / R beside it.

(Titterton and Weston, 2004, chapter 12, in a frame without singular points). C and f are means over
the step; the transition is taken to second order.
"""

from __future__ import annotations

from schuler.constants import EARTH_RATE
from schuler.kernels._jit import kernel
from schuler.kernels.states import ErrorStates
from schuler.kernels.vec import cross

STATES = ErrorStates.size


@kernel
def propagate(work, noise, s, options, z, a, k, turn):
    """Propagate the covariance over the step that `s` has gathered.

    Parameters
    ----------
    work : (45, 15) float64
        Rows 0-14 the covariance, the rest scratch.
    noise : (5,) float64
        `ErrorNoise`.
    s : (80,) float64
        `StrapdownState` of the navigation, with its integrals over the step.
    options : (7,) float64
        `StrapdownOptions`; the vertical channel is looked at.
    z, a, k, turn
        The Earth's axis in n, curvature, and the rate of n against the Earth.
    """
    t = s[32]
    w = (EARTH_RATE * z[0], EARTH_RATE * z[1], EARTH_RATE * z[2])
    v = (s[4], s[5], s[6])
    f = (s[29] / t, s[30] / t, s[31] / t)
    wn = (w[0] + turn[0], w[1] + turn[1], w[2] + turn[2])
    wc = (wn[0] + w[0], wn[1] + w[1], wn[2] + w[2])
    for i in range(15, 30):
        for j in range(15):
            work[i, j] = 0.0
    vertical = int(options[2])
    for j in range(3):
        e = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
        along = k * (z[0] * e[0] + z[1] * e[1])
        u = (-(a * e[1] + along * z[1]), a * e[0] + along * z[0], 0.0)
        earth = cross(w, u)
        columns = (cross(e, wn), cross(f, e), cross(e, wc), cross(e, turn))
        coriolis_v = cross(v, u)
        coriolis_r = cross(v, (2.0 * earth[0], 2.0 * earth[1], 2.0 * earth[2]))
        for i in range(3):
            work[15 + i, j] = columns[0][i]
            work[15 + i, 3 + j] = u[i]
            work[15 + i, 6 + j] = earth[i]
            work[18 + i, j] = columns[1][i]
            work[18 + i, 3 + j] = columns[2][i] + coriolis_v[i]
            work[18 + i, 6 + j] = coriolis_r[i]
            work[21 + i, 6 + j] = columns[3][i]
            work[15 + i, 9 + j] = -s[20 + 3 * i + j] / t
            work[18 + i, 12 + j] = s[20 + 3 * i + j] / t
        work[21 + j, 3 + j] = 1.0
    # Height is a coordinate: a step along the ground does not change it.
    work[23, 6] = 0.0
    work[23, 7] = 0.0
    # A height too great makes the frame turn too slowly.
    slower = (-a * turn[0], -a * turn[1], -a * turn[2])
    coriolis = cross(v, slower)
    for i in range(3):
        work[15 + i, 8] += slower[i]
        work[18 + i, 8] += coriolis[i]
    work[20, 8] += 2.0 * 9.81 * a
    if vertical == 1:
        work[20, 8] -= options[4]
        work[23, 8] -= options[3]
    elif vertical == 2:
        for j in range(15):
            work[20, j] = 0.0
            work[23, j] = 0.0
    # Transition: I + A + A^2 / 2, in rows 30-44.
    for i in range(15):
        for j in range(15):
            square = 0.0
            for m in range(15):
                square += work[15 + i, m] * work[15 + m, j]
            work[30 + i, j] = t * work[15 + i, j] + 0.5 * t * t * square
        work[30 + i, i] += 1.0
    for i in range(15):
        for j in range(15):
            x = 0.0
            for m in range(15):
                x += work[30 + i, m] * work[m, j]
            work[15 + i, j] = x
    for i in range(15):
        for j in range(i + 1):
            x = 0.0
            for m in range(15):
                x += work[15 + i, m] * work[30 + j, m]
            work[i, j] = x
            work[j, i] = x
    for i in range(3):
        work[i, i] += noise[0] * t
        if i < 2 or vertical != 2:
            work[3 + i, 3 + i] += noise[1] * t
        work[9 + i, 9 + i] += noise[2] * t
        work[12 + i, 12 + i] += noise[3] * t
