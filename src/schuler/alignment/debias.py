"""Sensors' biases: a history without one, and what acts like one in a specification.

The estimates are linear in the gyro bias. A bias that turns the tracked frame by more than a
fraction of a degree over the record is taken off first, so that no square of it is left.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.history import History
from schuler.attitude import multiply, quat_to_matrix, quat_to_rotvec, rotvec_to_quat
from schuler.constants import EARTH_RATE
from schuler.kernels.states import TrackerNode
from schuler.sensors import AccelerometerSpec, GyroSpec, ImuSpec

__all__ = ["bias_sigma", "with_gyro_bias", "without_gyro_bias"]

Array = NDArray[np.float64]

_BACK = np.array([1.0, -1.0, -1.0, -1.0])


def without_gyro_bias(h: History, bias: Array) -> History:
    """Return a history whose gyros had no bias.

    Between two nodes the body's turn loses ``bias * dt``; the frame in which all later increments
    stand turns with it. Exact to the square of the turn by the bias between two nodes.

    Parameters
    ----------
    h : History
    bias : (3,) float64
        rad/s, body axes.
    """
    from schuler.kernels.quat import quat_chain_many

    nodes, out = h.nodes, TrackerNode(h.rows.copy())
    dt = np.diff(h.t)
    steps = multiply(h.quat[:-1] * _BACK, h.quat[1:])
    turns = quat_to_rotvec(steps * np.where(steps[:, :1] < 0, -1.0, 1.0)) - dt[:, None] * bias
    corrected = rotvec_to_quat(turns)
    quat = np.empty_like(h.quat)
    quat[0] = h.quat[0]
    quat_chain_many(corrected, quat)
    # What the bias had turned the frame by, at the nodes and between them.
    frame = multiply(quat, h.quat * _BACK)
    after = frame[1:] * np.where(np.sum(frame[:-1] * frame[1:], axis=1) < 0, -1.0, 1.0)[:, None]

    def between(share: Array | float) -> Array:
        mixed = frame[:-1] + share * (after - frame[:-1])
        return np.asarray(mixed / np.linalg.norm(mixed, axis=1)[:, None])

    turned = quat_to_matrix(between(0.5))

    velocity = h.velocity
    new_velocity = np.zeros_like(velocity)
    new_velocity[1:] = np.cumsum(np.einsum("iab,ib->ia", turned, np.diff(velocity, axis=0)), axis=0)
    count = np.diff(h.updates)[:, None]
    sums = np.diff(nodes.sum_v, axis=0) - count * velocity[:-1]
    sums = np.einsum("iab,ib->ia", turned, sums) + count * new_velocity[:-1]
    basis = np.diff(nodes.sum_gravity, axis=0)
    mixed = np.diff(nodes.sum_gravity_v, axis=0)
    mixed = mixed - basis[:, :, None] * velocity[:-1, None, :]
    mixed = mixed @ turned.transpose(0, 2, 1) + basis[:, :, None] * new_velocity[:-1, None, :]
    # The attitudes that are summed are those at the ends of the updates.
    attitude = multiply(between(0.5 * (count + 1.0) / count), np.diff(nodes.sum_quat, axis=0))

    out.quat_ib0_b = quat
    out.v_ib0 = new_velocity
    out.sum_v[1:] = out.sum_v[0] + np.cumsum(sums, axis=0)
    out.sum_gravity_v = nodes.sum_gravity_v[0] + np.concatenate(
        [np.zeros((1, 3, 3)), np.cumsum(mixed, axis=0)]
    )
    out.sum_dtheta -= h.t[:, None] * bias
    out.sum_quat[1:] = out.sum_quat[0] + np.cumsum(attitude, axis=0)
    return replace(h, rows=out.data)


def bias_sigma(part: GyroSpec | AccelerometerSpec, force: float) -> float:
    """Return the 1-sigma of all that acts like a bias of one sensor under a force, rad/s or m/s^2.

    Parameters
    ----------
    part : GyroSpec or AccelerometerSpec
    force : float
        m/s^2; for a gyro its sensitivity to force counts, for an accelerometer its scale and axes.
    """
    geometry = np.hypot(np.hypot(part.scale_factor, part.misalignment), part.non_orthogonality)
    geometry = np.hypot(geometry, part.scale_factor_asymmetry)
    parts = [part.bias, part.g2_sensitivity * force**2, part.bias_instability, part.gauss_markov]
    if isinstance(part, GyroSpec):
        parts += [part.g_sensitivity * force, geometry * EARTH_RATE]
    else:
        parts.append(geometry * force)
    return float(np.sqrt(np.sum(np.square(parts))))


def with_gyro_bias(spec: ImuSpec, bias: float) -> ImuSpec:
    """Return a specification whose gyro bias is at least so large, rad/s."""
    return replace(spec, gyro=replace(spec.gyro, bias=max(spec.gyro.bias, bias)))
