"""Rates of the error states and their transition over a step (Titterton and Weston, 2004).

phi is the attitude error in n, C_est = (I - [phi x]) C_true; dv and dr are estimate minus truth;
what belongs to the sensors is what is left of it, truth minus estimate. With w_ie and w_en the
rates of the Earth and of the frame, K the curvature tensor and U(v) = up x K v,

    phi'  = -(w_ie + w_en) x phi + w_ie x U(dr) + U(dv) - C d_omega
    dv'   = f x phi - (2 w_ie + w_en) x dv + v x (2 w_ie x U(dr) + U(dv)) + 2 g/R dr_up + C d_f
    dr'   = dv - w_en x dr  (its up component: dv_up)

and U(dv) with - w_en dr_up / R beside it; d_omega and d_f are bias, scale and matrix times what
was measured. At a fixed place neither K nor w_en take part. C and f are means over the step, and
the transition is taken to second order.
"""

from __future__ import annotations

import math

from schuler.constants import EARTH_RATE
from schuler.kernels import ins_layout as layout
from schuler.kernels._jit import kernel
from schuler.kernels.entries import three
from schuler.kernels.strapdown import ellipsoid, spin_axis, transport
from schuler.kernels.vec import cross


@kernel
def navigation_rates(rates, state, cfg, options, with_position):
    """Write the columns of phi, dv and dr of the rates (>= 6 or 9, size), which are zero before.

    Parameters
    ----------
    rates : (>= 9, size) float64
    state, cfg : float64
        See `schuler.kernels.ins_layout`.
    options : (7,) float64
        Of `schuler.kernels.strapdown`.
    with_position : bool
    """
    t = state[layout.SPAN]
    force = (state[layout.MEAN_F] / t, state[layout.MEAN_F + 1] / t, state[layout.MEAN_F + 2] / t)
    velocity = (state[layout.V_N], state[layout.V_N + 1], state[layout.V_N + 2])
    fixed = cfg[layout.FIXED_PLACE] != 0.0
    a, k, gravity = 0.0, 0.0, cfg[layout.GRAVITY]
    z = (0.0, 0.0, 0.0)
    if fixed:
        earth = (cfg[layout.EARTH], cfg[layout.EARTH + 1], cfg[layout.EARTH + 2])
        turn = (0.0, 0.0, 0.0)
    else:
        z = spin_axis(
            (
                state[layout.QUAT_NE],
                state[layout.QUAT_NE + 1],
                state[layout.QUAT_NE + 2],
                state[layout.QUAT_NE + 3],
            )
        )
        earth = (EARTH_RATE * z[0], EARTH_RATE * z[1], EARTH_RATE * z[2])
        a, k, gravity, _, _ = ellipsoid(
            z[2] * z[2], state[layout.HEIGHT], int(options[0]), options[1]
        )
        turn = transport(a, k, z[0], z[1], velocity)
    if cfg[layout.FORCE_AT_REST] != 0.0:
        # The vehicle's own accelerations are noise: taken for a regressor they would show a
        # heading that nobody measured, as the displacement that is known to be zero is theirs.
        force = (0.0, 0.0, gravity)
    whole = (earth[0] + turn[0], earth[1] + turn[1], earth[2] + turn[2])
    coriolis = (whole[0] + earth[0], whole[1] + earth[1], whole[2] + earth[2])
    for j in range(3):
        e = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
        of_phi, of_force, of_v = cross(e, whole), cross(force, e), cross(e, coriolis)
        for i in range(3):
            rates[i, j] = of_phi[i]
            rates[3 + i, j] = of_force[i]
            rates[3 + i, 3 + j] = of_v[i]
        if with_position:
            rates[6 + j, 3 + j] = 1.0
        if fixed:
            continue
        along = k * (z[0] * e[0] + z[1] * e[1])
        u = (-(a * e[1] + along * z[1]), a * e[0] + along * z[0], 0.0)
        of_turn = cross(velocity, u)
        of_earth = cross(earth, u)
        of_earth_v = cross(velocity, (2.0 * of_earth[0], 2.0 * of_earth[1], 2.0 * of_earth[2]))
        of_r = cross(e, turn)
        for i in range(3):
            rates[i, 3 + j] = u[i]
            rates[3 + i, 3 + j] += of_turn[i]
            if with_position:
                rates[i, 6 + j] = of_earth[i]
                rates[3 + i, 6 + j] = of_earth_v[i]
                rates[6 + i, 6 + j] = of_r[i]
    if with_position and not fixed:
        # Height is a coordinate: a step along the ground does not change it.
        rates[8, 6] = 0.0
        rates[8, 7] = 0.0
        # A height too great makes the frame turn too slowly.
        slower = (-a * turn[0], -a * turn[1], -a * turn[2])
        change = cross(velocity, slower)
        for i in range(3):
            rates[i, 8] += slower[i]
            rates[3 + i, 8] += change[i]
        rates[5, 8] += 2.0 * gravity * a


@kernel
def sensor_rates(rates, state, at):
    """Write the columns of the sensors' errors; parameters as in `navigation_rates`."""
    r = 1.0 / state[layout.SPAN]
    for i in range(3):
        for j in range(3):
            c = r * state[layout.MEAN_C + 3 * i + j]
            for group in (layout.GYRO_BIAS, layout.GYRO_MARKOV):
                if at[group] >= 0:
                    rates[i, at[group] + j] = -c
            for group in (layout.ACCELEROMETER_BIAS, layout.ACCELEROMETER_MARKOV):
                if at[group] >= 0:
                    rates[3 + i, at[group] + j] = c
            scale = 9 * i + 4 * j
            if at[layout.GYRO_SCALE] >= 0:
                rates[i, at[layout.GYRO_SCALE] + j] = -r * state[layout.GYRO_PRODUCT + scale]
            if at[layout.ACCELEROMETER_SCALE] >= 0:
                rates[3 + i, at[layout.ACCELEROMETER_SCALE] + j] = (
                    r * state[layout.FORCE_PRODUCT + scale]
                )
        if at[layout.FRAME_RATE] >= 0:
            # The Earth rate of the nominal is too small by it, and so is its Coriolis term.
            unit = (1.0 if i == 0 else 0.0, 1.0 if i == 1 else 0.0, 1.0 if i == 2 else 0.0)
            of_v = cross(unit, three(state, layout.V_N))
            rates[i, at[layout.FRAME_RATE] + i] = -1.0
            for j in range(3):
                rates[3 + j, at[layout.FRAME_RATE] + i] = 2.0 * of_v[j]
        for j in range(9):
            if at[layout.GYRO_MATRIX] >= 0:
                rates[i, at[layout.GYRO_MATRIX] + j] = -r * state[layout.GYRO_PRODUCT + 9 * i + j]
            if at[layout.ACCELEROMETER_MATRIX] >= 0:
                rates[3 + i, at[layout.ACCELEROMETER_MATRIX] + j] = (
                    r * state[layout.FORCE_PRODUCT + 9 * i + j]
                )


@kernel
def fill_transition(phi, decay, rates, fade, state, at, cfg, options, dynamic):
    """Write the transition over the span that `state` has gathered.

    Parameters
    ----------
    phi, rates : (>= 9, size) float64
        Filled; rates as scratch.
    decay : (size,) float64
        Filled with exp(-t fade).
    fade : (size,) float64
        1 / correlation time, 0 for a constant.
    state, at, cfg, options
        See `schuler.kernels.ins_layout` and `schuler.kernels.strapdown`.
    dynamic : int
        6, or 9 with a position.
    """
    size = phi.shape[1]
    t = state[layout.SPAN]
    for i in range(dynamic):
        for j in range(size):
            rates[i, j] = 0.0
    navigation_rates(rates, state, cfg, options, at[layout.POSITION] >= 0)
    sensor_rates(rates, state, at)
    vertical = cfg[layout.VERTICAL] != 0.0
    for i in range(dynamic):
        if vertical and (i == 5 or i == 8):
            # Without a vertical channel nothing comes of it, and nothing goes into it.
            for j in range(size):
                rates[i, j] = 0.0
    if vertical:
        for i in range(dynamic):
            rates[i, 5] = 0.0
            if dynamic > 6:
                rates[i, 8] = 0.0
    half = 0.5 * t * t
    for i in range(dynamic):
        for j in range(size):
            # Columns of Markov processes fade within the step.
            phi[i, j] = rates[i, j] * (t - half * fade[j])
        for k in range(dynamic):
            a = half * rates[i, k]
            if a != 0.0:
                for j in range(size):
                    phi[i, j] += a * rates[k, j]
        phi[i, i] += 1.0
    for j in range(size):
        decay[j] = math.exp(-t * fade[j]) if fade[j] != 0.0 else 1.0
