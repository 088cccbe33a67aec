"""Attitude, vectorised: quaternion, matrix, rotation vector, Euler angles, heading.

Quaternions are Hamilton, scalar first, ``quat_nb`` maps body vectors to n. Euler angles are
(psi, theta, gamma) with C_b^n = Rz(psi) Rx(theta) Ry(gamma), rad; see the package docstring.
Every function takes leading dimensions freely.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

__all__ = [
    "euler_to_quat",
    "from_scipy",
    "heading_sigma",
    "heading_to_psi",
    "matrix_to_quat",
    "multiply",
    "nearest_quat",
    "psi_to_heading",
    "quat_to_euler",
    "quat_to_matrix",
    "quat_to_rotvec",
    "rotate",
    "rotvec_to_quat",
    "skew",
    "to_scipy",
]

Array = NDArray[np.float64]


def _rows(value: ArrayLike, width: int, name: str) -> tuple[tuple[int, ...], Array]:
    array = np.asarray(value, np.float64)
    if array.ndim < 1 or array.shape[-1] != width:
        raise InputError(f"expected `{name}` to have shape (..., {width}), got {array.shape}")
    return array.shape[:-1], np.ascontiguousarray(array).reshape(-1, width)


def _broadcast(*values: tuple[ArrayLike, int, str]) -> tuple[tuple[int, ...], list[Array]]:
    """Check each value's last dimension, then let the leading ones broadcast."""
    rows = [_rows(value, width, name) for value, width, name in values]
    lead = np.broadcast_shapes(*[shape for shape, _ in rows])
    return lead, [
        np.ascontiguousarray(
            np.broadcast_to(flat.reshape((*shape, flat.shape[1])), (*lead, flat.shape[1]))
        ).reshape(-1, flat.shape[1])
        for shape, flat in rows
    ]


def _call(kernel: str, rows: Array, *out_shape: int) -> Array:
    from schuler.kernels import quat

    out = np.empty((len(rows), *out_shape))
    getattr(quat, kernel)(rows, out)
    return out


def rotvec_to_quat(rotvec: ArrayLike) -> Array:
    """Return the quaternions (..., 4) of rotation vectors (..., 3), rad; exact for any angle.

    Examples
    --------
    >>> from schuler.attitude import quat_to_rotvec, rotvec_to_quat
    >>> np.round(quat_to_rotvec(rotvec_to_quat(np.array([0.1, 0.2, 0.3]))), 12).tolist()
    [0.1, 0.2, 0.3]
    """
    shape, rows = _rows(rotvec, 3, "rotvec")
    return _call("rotvec_to_quat_many", rows, 4).reshape((*shape, 4))


def quat_to_rotvec(quat: ArrayLike) -> Array:
    """Return the rotation vectors (..., 3), of length in [0, pi] rad, of quaternions (..., 4).

    Examples
    --------
    >>> from schuler.attitude import quat_to_rotvec
    >>> quat_to_rotvec(np.array([1.0, 0.0, 0.0, 0.0])).tolist()
    [0.0, 0.0, 0.0]
    """
    shape, rows = _rows(quat, 4, "quat")
    return _call("quat_to_rotvec_many", rows, 3).reshape((*shape, 3))


def quat_to_matrix(quat: ArrayLike) -> Array:
    """Return the direction cosine matrices (..., 3, 3) of unit quaternions (..., 4).

    Examples
    --------
    >>> from schuler.attitude import euler_to_quat, quat_to_matrix
    >>> forward = quat_to_matrix(euler_to_quat([np.pi / 2, 0.0, 0.0]))[:, 1]
    >>> np.round(forward, 12).tolist()  # psi of 90 deg points west
    [-1.0, 0.0, 0.0]
    """
    shape, rows = _rows(quat, 4, "quat")
    return _call("quat_to_matrix_many", rows, 3, 3).reshape((*shape, 3, 3))


def matrix_to_quat(matrix: ArrayLike) -> Array:
    """Return the quaternions (..., 4), w >= 0, of rotation matrices (..., 3, 3).

    Raises
    ------
    InputError
        If the shape is wrong or a matrix is not a rotation to 1e-6.

    Examples
    --------
    >>> from schuler.attitude import matrix_to_quat
    >>> matrix_to_quat(np.eye(3)).tolist()
    [1.0, 0.0, 0.0, 0.0]
    """
    m = np.asarray(matrix, np.float64)
    if m.ndim < 2 or m.shape[-2:] != (3, 3):
        raise InputError(f"expected `matrix` to have shape (..., 3, 3), got {m.shape}")
    rows = np.ascontiguousarray(m).reshape(-1, 3, 3)
    off = np.abs(np.einsum("nij,nkj->nik", rows, rows) - np.eye(3)).max(initial=0.0)
    if not off < 1e-6 or np.any(np.linalg.det(rows) < 0):
        raise InputError(
            f"expected `matrix` to hold rotations, got one that is off by {off:.3g}; "
            "orthonormalise it first"
        )
    return _call("quat_from_matrix_many", rows, 4).reshape((*m.shape[:-2], 4))


def nearest_quat(matrix: ArrayLike) -> Array:
    """Return the quaternions (..., 4), w >= 0, of the rotations nearest to matrices (..., 3, 3).

    For matrices that were computed, as a mean of rotations is, and are rotations but for that.
    Nearest in the sense of the Frobenius norm (Wahba's problem by singular value decomposition).

    Raises
    ------
    InputError
        If the shape is wrong.

    Examples
    --------
    >>> import numpy as np
    >>> nearest_quat(1.1 * np.eye(3)).tolist()
    [1.0, 0.0, 0.0, 0.0]
    """
    m = np.asarray(matrix, np.float64)
    if m.ndim < 2 or m.shape[-2:] != (3, 3):
        raise InputError(f"expected `matrix` to have shape (..., 3, 3), got {m.shape}")
    u, _, vt = np.linalg.svd(m)
    u = np.array(u)
    u[..., 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    rows = np.ascontiguousarray(u @ vt).reshape(-1, 3, 3)
    return _call("quat_from_matrix_many", rows, 4).reshape((*m.shape[:-2], 4))


def euler_to_quat(euler: ArrayLike) -> Array:
    """Return the quaternions (..., 4) of (psi, theta, gamma) (..., 3), rad.

    Examples
    --------
    >>> from schuler.attitude import euler_to_quat
    >>> euler_to_quat([0.0, 0.0, 0.0]).tolist()
    [1.0, 0.0, 0.0, 0.0]
    """
    shape, rows = _rows(euler, 3, "euler")
    return _call("quat_from_euler_many", rows, 4).reshape((*shape, 4))


def quat_to_euler(quat: ArrayLike) -> Array:
    """Return (psi, theta, gamma) (..., 3), rad, of quaternions (..., 4).

    At gimbal lock (theta within 1e-8 rad of +-90 deg) gamma is 0 and psi takes the whole turn,
    so that the attitude itself is still exact.

    Examples
    --------
    >>> from schuler.attitude import euler_to_quat, quat_to_euler
    >>> np.round(quat_to_euler(euler_to_quat([0.3, 0.1, -0.2])), 12).tolist()
    [0.3, 0.1, -0.2]
    """
    shape, rows = _rows(quat, 4, "quat")
    return _call("euler_from_quat_many", rows, 3).reshape((*shape, 3))


def multiply(p: ArrayLike, q: ArrayLike) -> Array:
    """Return the Hamilton products p q, (..., 4): the rotation q followed by p.

    Examples
    --------
    >>> from schuler.attitude import multiply, rotvec_to_quat
    >>> half = rotvec_to_quat(np.array([0.0, 0.0, 0.5]))
    >>> bool(np.allclose(multiply(half, half), rotvec_to_quat(np.array([0.0, 0.0, 1.0]))))
    True
    """
    from schuler.kernels.quat import quat_multiply_many

    shape, (pr, qr) = _broadcast((p, 4, "p"), (q, 4, "q"))
    out = np.empty_like(pr)
    quat_multiply_many(pr, qr, out)
    return out.reshape((*shape, 4))


def rotate(quat: ArrayLike, vector: ArrayLike) -> Array:
    """Return vectors (..., 3) turned by quaternions (..., 4).

    Examples
    --------
    >>> from schuler.attitude import rotate, rotvec_to_quat
    >>> turn = rotvec_to_quat(np.array([0.0, 0.0, np.pi / 2]))
    >>> np.round(rotate(turn, np.array([1.0, 0.0, 0.0])), 12).tolist()
    [0.0, 1.0, 0.0]
    """
    from schuler.kernels.quat import quat_rotate_many

    shape, (qr, vr) = _broadcast((quat, 4, "quat"), (vector, 3, "vector"))
    out = np.empty_like(vr)
    quat_rotate_many(qr, vr, out)
    return out.reshape((*shape, 3))


def skew(vector: ArrayLike) -> Array:
    """Return the matrices [v x] (..., 3, 3) of vectors (..., 3): [v x] u = v x u.

    Examples
    --------
    >>> from schuler.attitude import skew
    >>> (skew(np.array([1.0, 0.0, 0.0])) @ [0.0, 1.0, 0.0]).tolist()
    [0.0, 0.0, 1.0]
    """
    v = np.asarray(vector, np.float64)
    if v.ndim < 1 or v.shape[-1] != 3:
        raise InputError(f"expected `vector` to have shape (..., 3), got {v.shape}")
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    o = np.zeros_like(x)
    return np.stack([o, -z, y, z, o, -x, -y, x, o], axis=-1).reshape((*v.shape, 3))


def heading_sigma(quat: ArrayLike, covariance: ArrayLike) -> float:
    """Return the 1-sigma of the heading, rad, from that of phi (east, north, up).

    It is that of phi about up for a level body; with a pitch theta the tilts enter by tan(theta).
    Not above pi / sqrt(3), that of an unknown angle.

    Parameters
    ----------
    quat : (4,) array_like
        quat_nb.
    covariance : (3, 3) array_like
        Of phi, rad^2, with C_est = (I - [phi x]) C_true.

    Examples
    --------
    >>> round(heading_sigma([1.0, 0.0, 0.0, 0.0], np.diag([0.0, 0.0, 1e-6])), 6)
    0.001
    """
    psi, theta, _ = quat_to_euler(quat)
    steep = np.tan(np.clip(theta, -1.5706, 1.5706))
    # The forward axis (-sin psi cos theta, cos psi cos theta, sin theta) moves by -phi x it.
    a = np.array([-np.sin(psi) * steep, np.cos(psi) * steep, -1.0])
    return float(min(np.sqrt(a @ np.asarray(covariance) @ a), np.pi / np.sqrt(3.0)))


def psi_to_heading(psi: ArrayLike) -> Any:
    """Return the heading, clockwise from north in [0, 2 pi), of psi (counter-clockwise), rad.

    Examples
    --------
    >>> from schuler.attitude import psi_to_heading
    >>> round(float(np.rad2deg(psi_to_heading(np.deg2rad(30.0)))), 9)
    330.0
    """
    heading = np.mod(-np.asarray(psi, np.float64), 2.0 * math.pi)
    # mod of a tiny negative number rounds up to the modulus itself.
    return np.where(heading >= 2.0 * math.pi, 0.0, heading)[()]


def heading_to_psi(heading: ArrayLike) -> Any:
    """Return psi in (-pi, pi] of a heading, rad.

    Examples
    --------
    >>> from schuler.attitude import heading_to_psi
    >>> round(float(np.rad2deg(heading_to_psi(np.deg2rad(30.0)))), 9)
    -30.0
    """
    psi = -np.asarray(heading, np.float64)
    return (math.pi - np.mod(math.pi - psi, 2.0 * math.pi))[()]


def to_scipy(quat: ArrayLike) -> Rotation:
    """Return a `scipy.spatial.transform.Rotation` of quaternions (..., 4), scalar first here.

    Raises
    ------
    InputError
        If the shape is wrong, or has more dimensions than this version of SciPy holds.

    Examples
    --------
    >>> to_scipy([1.0, 0.0, 0.0, 0.0]).as_euler("xyz").tolist()
    [0.0, 0.0, 0.0]
    """
    from scipy.spatial.transform import Rotation

    shape, rows = _rows(quat, 4, "quat")
    try:
        return Rotation.from_quat(rows[:, [1, 2, 3, 0]].reshape((*shape, 4)))
    except ValueError:
        if len(shape) < 2:
            raise
        raise InputError(
            f"this version of SciPy holds rotations in one dimension, and `quat` has {len(shape)}; "
            "reshape it to (n, 4), or install SciPy 1.17"
        ) from None


def from_scipy(rotation: Rotation) -> Array:
    """Return the quaternions (..., 4), scalar first and w >= 0, of a SciPy `Rotation`.

    Examples
    --------
    >>> from scipy.spatial.transform import Rotation
    >>> from_scipy(Rotation.from_euler("z", 90.0, degrees=True)).round(3).tolist()
    [0.707, 0.0, 0.0, 0.707]
    """
    return np.asarray(rotation.as_quat(canonical=True), np.float64)[..., [3, 0, 1, 2]]
