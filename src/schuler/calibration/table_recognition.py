"""Positions of a table recognised from the record itself: dwells, directions of up, and turns.

In each dwell the force says which of the 18 known directions (each axis up or down, two axes at 45
deg) is up. Between dwells the gyros turn the instrument; what is left of a turn when up is in its
known direction at both ends is a heading, and a table turns by whole steps of 15 deg. So every
attitude follows but for the table's heading, one number, which the Earth's rate shows together with
the gyros' bias.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import euler_to_quat, quat_to_matrix
from schuler.calibration.rests import find_rests
from schuler.calibration.table_dwells import TOO_FAR
from schuler.calibration.turntable import scheme
from schuler.constants import DEG, EARTH_RATE
from schuler.earth import Site
from schuler.errors import InputError
from schuler.record import ImuRecord

__all__ = ["BiasFit", "Recognition", "fit_gyro_bias", "mean_outputs", "recognise"]

Array = NDArray[np.float64]

STEP = 15.0 * DEG
"""Tables turn by whole multiples of this."""

_OFF = 5.0 * DEG
"""A heading so far from a multiple is none: scale errors of gyros stay below it."""

_TILTS = [(theta, gamma) for theta in range(-90, 91, 45) for gamma in range(-180, 180, 45)]


@dataclass(frozen=True, eq=False)
class Recognition:
    """What a record says of the table's positions.

    Parameters
    ----------
    dwells : list of ImuRecord
    up : (m, 3) float64
        Known direction of up in body axes, in each dwell.
    attitude_deg : (m, 3) float64 or None
        psi, theta, gamma of each, psi from that of the first dwell; None where turns do not say it.
    text : str
        What was recognised, in a sentence.
    """

    dwells: list[ImuRecord]
    up: Array
    attitude_deg: Array | None
    text: str


@dataclass(frozen=True, eq=False)
class BiasFit:
    """The gyros' bias, and the table's heading that comes with it.

    Parameters
    ----------
    bias, bias_sigma : (3,) float64
        rad/s.
    psi, psi_sigma : float
        Of the first dwell, rad, counter-clockwise from north.
    """

    bias: Array
    bias_sigma: Array
    psi: float
    psi_sigma: float


def mean_outputs(dwells: Sequence[ImuRecord]) -> tuple[Array, Array]:
    """Return the mean rate and force (m, 3) of dwells, rad/s and m/s^2."""
    span = np.array([np.sum(r.dt) for r in dwells])[:, None]
    rate = np.array([np.sum(r.dtheta, axis=0) for r in dwells]) / span
    return rate, np.array([np.sum(r.dvel, axis=0) for r in dwells]) / span


def recognise(records: Sequence[ImuRecord], initial: float = 1.0) -> Recognition:
    """Recognise the positions of a table.

    Parameters
    ----------
    records : sequence of ImuRecord
        One with all dwells and the turns between them, or one for each dwell, of which the
        directions of up are told and no turns.
    initial : float
        Rest at the start of a record in which the dwells are found, s.

    Raises
    ------
    InputError
        If a force is along no known direction, or the gyros turn it elsewhere.
    """
    rests = None
    dwells = list(records)
    if len(dwells) == 1:
        rests = find_rests(dwells[0].time, dwells[0].accel, dwells[0].gyro, initial=initial)
        dwells = [records[0].rows(int(a), int(b)) for a, b in rests]
    rate, force = mean_outputs(dwells)
    known = scheme(18)
    cosine = (force / np.linalg.norm(force, axis=1)[:, None]) @ known.T
    nearest = cosine.argmax(axis=1)
    far = np.arccos(np.clip(cosine.max(axis=1), -1.0, 1.0))
    if far.max() > TOO_FAR:
        k = int(far.argmax())
        raise InputError(
            f"dwell {k + 1} ({dwells[k].start:.6g} to {dwells[k].end:.6g} s): its force is "
            f"{far[k] / DEG:.0f} deg from any known position (an axis up or down, or two at 45 "
            "deg): say where the table was with a sequence"
        )
    text = _name_of(np.bincount(nearest, minlength=18))
    attitudes = None
    if rests is None:
        text += "; files of one dwell each show no turns"
    else:
        middle = rests.sum(axis=1) // 2
        attitudes, why = _attitudes(records[0], middle, rate, known[nearest])
        text += f"; {why}"
    return Recognition(dwells, known[nearest], attitudes, text)


def _name_of(seen: NDArray[np.int64]) -> str:
    """Say which of the known schemes the dwells in each direction are."""
    total, faces, edges = int(seen.sum()), seen[:6], seen[6:]
    for count, wanted in (
        (6, np.r_[np.ones(6), np.zeros(12)]), (12, np.r_[np.zeros(6), np.ones(12)]),
        (18, np.ones(18)), (24, np.r_[np.full(6, 4), np.zeros(12)]),
    ):  # fmt: skip
        if np.array_equal(seen, wanted):
            return f"{count} positions"
    name = ""
    if faces.all() and not edges.any():
        name = "24 positions" if faces.min() >= 4 else "6 positions"
    elif edges.all() and not faces.any():
        name = "12 positions"
    elif faces.all() and edges.all():
        name = "18 positions"
    directions = int(np.count_nonzero(seen))
    if name:
        return f"{name}, some of them again ({total} dwells)"
    return f"{total} dwells in {directions} of the 18 known directions"


def _tilts(up: Array) -> tuple[float, float]:
    """Return theta and gamma, deg, that put a known direction up."""
    for theta, gamma in _TILTS:
        row = quat_to_matrix(euler_to_quat(np.array([0.0, theta, gamma]) * DEG))[2]
        if np.abs(row - up).max() < 1e-9:
            return float(theta), float(gamma)
    raise AssertionError("each of the 18 directions has its tilts")


def _attitudes(
    record: ImuRecord, middle: NDArray[np.int64], rate: Array, up: Array
) -> tuple[Array | None, str]:
    """Return psi (from the first), theta, gamma of each dwell, deg, and what is said of them."""
    from schuler.kernels.tracking import attitudes

    out = np.zeros((len(up), 3))
    out[0, 1:] = _tilts(up[0])
    mat = quat_to_matrix(euler_to_quat(out[0] * DEG))
    for k in range(1, len(up)):
        part = record.rows(int(middle[k - 1]), int(middle[k]))
        still = 0.5 * (rate[k - 1] + rate[k])
        turned = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        coning = float(not record.coning_corrected)
        attitudes(turned, coning, part.dtheta - still * part.dt[:, None], np.empty((len(part), 4)))
        out[k, 1:] = _tilts(up[k])
        tilted = quat_to_matrix(euler_to_quat(out[k] * DEG))
        left = mat @ quat_to_matrix(turned[:4]) @ tilted.T
        off = float(np.arccos(np.clip(left[2, 2], -1.0, 1.0)))
        if off > TOO_FAR:
            raise InputError(
                f"between dwells {k} and {k + 1} the gyros turn up to {off / DEG:.0f} deg from "
                "where the force has it: check the columns of the gyros, their unit and signs"
            )
        psi = float(np.arctan2(left[1, 0] - left[0, 1], left[0, 0] + left[1, 1]))
        whole = round(psi / STEP) * STEP
        if abs(psi - whole) > _OFF:
            return None, (
                f"between dwells {k} and {k + 1} the heading turns to {psi / DEG:.1f} deg, no "
                f"multiple of {STEP / DEG:g} deg, so that the gyros' bias needs a sequence"
            )
        out[k, 0] = np.rint(whole / DEG)
        mat = quat_to_matrix(euler_to_quat(out[k] * DEG))
    return out, "turns recognised"


def fit_gyro_bias(rate: Array, attitude_deg: Array, site: Site, gyro_matrix: Array) -> BiasFit:
    """Fit the gyros' bias, and the heading of the first dwell, to what they read at rest.

    Parameters
    ----------
    rate : (m, 3) float64
        Mean outputs, rad/s.
    attitude_deg : (m, 3) float64
        As of `Recognition`.
    site : Site
    gyro_matrix : (3, 3) float64
        Of an earlier calibration, or the identity.
    """
    mats = quat_to_matrix(euler_to_quat(attitude_deg * DEG))
    model = np.linalg.inv(gyro_matrix)
    level, up = EARTH_RATE * np.cos(site.latitude), EARTH_RATE * np.sin(site.latitude)

    def seen(psi: float) -> Array:
        """Return the Earth's rate in the outputs when the first dwell has a heading psi more."""
        earth = np.array([level * np.sin(psi), level * np.cos(psi), up])
        return np.asarray(np.swapaxes(mats, -1, -2) @ earth @ model.T)

    def left(psi: float) -> Array:
        rest = rate - seen(psi)
        return np.asarray(rest - rest.mean(axis=0))

    grid = np.arange(0.0, 2.0 * np.pi, DEG)
    psi = float(min(grid, key=lambda each: float(np.sum(left(each) ** 2))))
    slope = np.zeros_like(rate)
    for _ in range(4):
        slope = seen(psi + 1e-3) - seen(psi - 1e-3)
        slope = (slope - slope.mean(axis=0)) / 2e-3
        size = float(np.sum(slope**2))
        if size <= 1e-30:
            break
        psi += float(np.sum(slope * left(psi))) / size
    residual = left(psi)
    size = float(np.sum(slope**2))
    variance = float(np.sum(residual**2)) / max(residual.size - 4, 1)
    psi_variance = variance / size if size > 1e-30 else np.inf
    # The bias is the mean of what is left, which moves with the heading.
    moved = (seen(psi + 1e-3) - seen(psi - 1e-3)).mean(axis=0) / 2e-3
    spread = variance / len(rate) + np.where(np.abs(moved) > 1e-12, moved**2 * psi_variance, 0.0)
    return BiasFit(
        (rate - seen(psi)).mean(axis=0), np.sqrt(spread), psi % (2.0 * np.pi),
        float(np.sqrt(psi_variance)),
    )  # fmt: skip
