"""Forces in the frame that gyros hold, for many ways of naming the gyros' axes."""

from __future__ import annotations

from schuler.kernels._jit import kernel
from schuler.kernels.quat import qexp, qmul, qnormalise, qrotate


@kernel
def held_forces(phi, f_b, mean_f_b, namings, out):
    """Rotate forces by the gyros, their axes named anew.

    Parameters
    ----------
    phi : (n, 3) float64
        Rotation vector of each interval, rad.
    f_b : (n, 3) float64
        Mean force of each interval, m/s^2.
    mean_f_b : (3,) float64
        A vector that is fixed in the body.
    namings : (k, 3, 3) float64
        Gyro axes as they are named.
    out : (k, n, 6) float64
        The force in the middle of each interval, and the fixed vector, in the frame of the start.
    """
    for k in range(len(namings)):
        m = namings[k]
        q = (1.0, 0.0, 0.0, 0.0)
        for i in range(len(phi)):
            x, y, z = phi[i, 0], phi[i, 1], phi[i, 2]
            half = qexp((
                0.5 * (m[0, 0] * x + m[0, 1] * y + m[0, 2] * z),
                0.5 * (m[1, 0] * x + m[1, 1] * y + m[1, 2] * z),
                0.5 * (m[2, 0] * x + m[2, 1] * y + m[2, 2] * z),
            ))  # fmt: skip
            middle = qmul(q, half)
            a = qrotate(middle, (f_b[i, 0], f_b[i, 1], f_b[i, 2]))
            b = qrotate(middle, (mean_f_b[0], mean_f_b[1], mean_f_b[2]))
            for j in range(3):
                out[k, i, j] = a[j]
                out[k, i, 3 + j] = b[j]
            q = qnormalise(qmul(middle, half))
