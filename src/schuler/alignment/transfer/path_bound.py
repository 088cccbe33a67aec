"""The Cramér-Rao bound of a transfer alignment: its filter's covariance along a path."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from schuler.alignment.moving.path_bound import PathLimit, limits_of_filter, record_on
from schuler.alignment.transfer.master import MasterNoise
from schuler.alignment.transfer.setup import (
    DELAY_SIGMA,
    LEAST_ROWS,
    LEVER_SIGMA,
    MOUNTING_SIGMA,
    Known,
    Matching,
)
from schuler.errors import InputError
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec
from schuler.trajectory import Trajectory

__all__ = ["master_limits"]

_IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def master_limits(
    path: Trajectory, spec: ImuSpec, noise: MasterNoise, rate: float,
    times: Sequence[float] | None, *, parts: tuple[str, ...] = ("velocity", "attitude"),
    record: ImuRecord | None = None,
) -> list[PathLimit]:  # fmt: skip
    """Return the bounds of a slave's alignments by a master, in one pass over the path.

    Mounting, lever arm and delay are unknown, as `sc.transfer` takes them when nothing is said.

    Parameters
    ----------
    path : Trajectory
        With velocity and attitude.
    spec : ImuSpec
        Of the slave.
    noise : MasterNoise
    rate : float
        Rows of the master, Hz.
    times : sequence of float or None
        As in `limits_on`.
    parts : tuple of str
        What is matched.
    record : ImuRecord, optional
        What a perfect instrument has along the path.

    Raises
    ------
    InputError
        If the master has too few rows on the path, and as `limits_on`.
    """
    samples = record_on(path) if record is None else record
    known = Known(_IDENTITY, MOUNTING_SIGMA, np.zeros(3), LEVER_SIGMA, 0.0, DELAY_SIGMA)
    matching = Matching(samples, path, parts, known, spec, noise, None, rate)
    measured = matching.measured(0.0, known.mounting, gate=False)
    if min(len(np.asarray(aid.time)) for aid in measured) < LEAST_ROWS:
        raise InputError(
            f"{path.name}: a master of {rate:g} Hz has fewer than {LEAST_ROWS} rows on the path"
        )
    layout = matching.layout(measured)
    start = matching.start(0.0)
    flt = matching.build(layout, start, measured, 0.0, start, np.zeros(layout.size), False)
    return limits_of_filter(flt, samples, path.name, times)
