"""Headings and heights beside the fixes or speeds that an alignment in motion begins with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import HeadingFixes, Height
from schuler.attitude import quat_to_matrix, rotvec_to_quat
from schuler.constants import STAMP_ROUNDING
from schuler.errors import InputError
from schuler.in_motion.coarse import CoarseAlignment
from schuler.ins import GroupNoise, Handling, Measurement
from schuler.ins import Heading as HeadingRows
from schuler.ins import Height as HeightRows
from schuler.prefilter.base import held_frame
from schuler.record import ImuRecord
from schuler.units import time_text

__all__ = ["Beside", "check_names", "offset_noise", "offset_priors", "rows_beside", "turned_to"]

Array = NDArray[np.float64]

Beside = HeadingFixes | Height

_FIRST = 5
"""Fixes at the start of a span whose median turns a coarse attitude."""


def check_names(aids: Sequence[Any]) -> None:
    """Refuse two aids of one name: their innovations and offsets would be one.

    Raises
    ------
    InputError
        Naming it.
    """
    names = [aid.name for aid in aids]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"two aids have the name '{twice}': give one of them another")


def rows_beside(aid: Beside, record: ImuRecord, handling: Handling) -> Measurement:
    """Return what the filter takes of headings or heights within a record.

    Raises
    ------
    InputError
        If none lies within it.
    """
    time = np.asarray(aid.time)
    within = (time > record.start + STAMP_ROUNDING) & (time <= record.end + STAMP_ROUNDING)
    if not within.any():
        raise InputError(
            f"{aid.name}: none of its times lies within the span, from t = "
            f"{time_text(record.start)} to "
            f"{time_text(record.end)} s"
        )
    sigma = np.broadcast_to(np.asarray(aid.sigma, np.float64), time.shape)[within]
    common: dict[str, Any] = {"name": aid.name, "handling": handling}
    if isinstance(aid, HeadingFixes):
        heading = np.asarray(aid.heading)[within]
        return HeadingRows(time[within], heading, sigma, baseline=aid.baseline, **common)
    return HeightRows(
        time[within], np.asarray(aid.height)[within], sigma, lever=aid.lever,
        estimate=("offset",) if aid.offset_sigma > 0.0 else (), **common,
    )  # fmt: skip


def offset_priors(aids: Sequence[Any]) -> dict[str, float]:
    """Return 1-sigma of the offsets of heights before anything is measured, m."""
    return {f"{aid.name}.offset": aid.offset_sigma for aid in aids if isinstance(aid, Height)}


def offset_noise(aids: Sequence[Any]) -> dict[str, GroupNoise]:
    """Return how the offsets of heights change by themselves."""
    return {
        f"{aid.name}.offset": GroupNoise(
            sigma=aid.offset_sigma, time=aid.offset_time, source="disturbance"
        )
        for aid in aids if isinstance(aid, Height) and aid.offset_sigma > 0.0
    }  # fmt: skip


def turned_to(
    found: CoarseAlignment, fixes: HeadingFixes, record: ImuRecord, gyro_bias: Array
) -> CoarseAlignment:
    """Return a coarse attitude turned about up, so that it has the headings that were measured.

    Parameters
    ----------
    found : CoarseAlignment
        Whose motion showed no heading; its level part is kept.
    fixes : HeadingFixes
    record : ImuRecord
        The span.
    gyro_bias : (3,) float64
        That rest before showed, rad/s.

    Raises
    ------
    InputError
        If no heading lies within the span.
    """
    time = np.asarray(fixes.time)
    pick = np.flatnonzero(
        (time >= record.start - STAMP_ROUNDING) & (time <= record.end + STAMP_ROUNDING)
    )[:_FIRST]
    if not len(pick):
        raise InputError(f"{fixes.name}: none of its times lies within the span")
    bias = gyro_bias + found.gyro_bias
    still = replace(record, dtheta=record.dtheta - bias * record.dt[:, None])
    rows = np.minimum(np.searchsorted(record.time, time[pick] - STAMP_ROUNDING), len(record) - 1)
    mats = found.mat_nb @ quat_to_matrix(held_frame(still)[rows])
    along = mats @ np.asarray(fixes.baseline, np.float64)
    seen = np.arctan2(along[:, 0], along[:, 1])
    off = np.asarray(fixes.heading)[pick] - seen
    off = off[0] + (off - off[0] + np.pi) % (2.0 * np.pi) - np.pi
    # Headings are clockwise, turns about up are not.
    turn = quat_to_matrix(rotvec_to_quat(np.array([0.0, 0.0, -float(np.median(off))])))
    local = found.mat_nb @ found.mat_i0_ib0.T
    level = np.diag([1.0, 1.0, 0.0])
    sigma = float(np.median(np.broadcast_to(np.asarray(fixes.sigma, np.float64), time.shape)))
    budget = {name: level @ turn @ part @ turn.T @ level for name, part in found.budget.items()}
    return replace(
        found, mat_nb=turn @ found.mat_nb, mat_i0_ib0=local.T @ turn @ found.mat_nb,
        budget={**budget, "heading": np.diag([0.0, 0.0, sigma**2])},
    )  # fmt: skip
