"""Tests on a turntable from records: dwells and turns found or given, one calibration out.

Positions are dwells in a record, or records of one dwell each. Where the table put the instrument
is either given in a sequence, or told from the force: the nearest of the known directions of 6, 12,
18 or 24 positions; or it is recognised from forces and turns (`table_recognition`). What is
not observable in a test is taken from an earlier calibration (`base`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import psi_to_heading
from schuler.calibration.apply import Calibration
from schuler.calibration.table_dwells import TOO_FAR, dwells_of, nearest_directions, turn_stretches
from schuler.calibration.table_recognition import fit_gyro_bias, mean_outputs, recognise
from schuler.calibration.table_result import TableTest
from schuler.calibration.table_sequence import (
    Position,
    RateTurn,
    positions_from_toml,
    turns_from_toml,
)
from schuler.calibration.turntable import rate_test, scheme, static_test
from schuler.constants import DEG, EARTH_RATE
from schuler.earth import Site
from schuler.errors import InputError
from schuler.record import ImuRecord

__all__ = [
    "Position", "RateTurn", "TableTest", "calibrate_positions", "calibrate_rates",
    "positions_from_toml", "turns_from_toml",
]  # fmt: skip

Array = NDArray[np.float64]

_TELLS = 10.0 * DEG
"""Sigma of a table's heading beyond which nothing is said of it."""


def calibrate_positions(
    records: Sequence[ImuRecord], gravity: float, *,
    positions: int | Sequence[Position] | None = 6,
    site: Site | None = None, base: Calibration | None = None, initial: float = 1.0,
    name: str = "positions",
) -> TableTest:  # fmt: skip
    """Calibrate accelerometers, and with known attitudes the gyros' bias, from dwells.

    Parameters
    ----------
    records : sequence of ImuRecord
        One record with all dwells, or a record for each.
    gravity : float
        At the place, m/s^2.
    positions : int, sequence of Position, or None
        6, 12, 18 or 24, whose directions are told from the force; where the table was, in order; or
        None to recognise them (`recognise`), with the turns between them.
    site : Site, optional
        With attitudes, given or recognised: its Earth rate shows the gyros' bias.
    base : Calibration, optional
        Has what is not observable in this test.
    initial : float
        Rest at the start of a record in which the dwells are found, s.
    name : str

    Raises
    ------
    InputError
        For dwells that are not as many as the positions, or leave an axis that is not observable.

    Examples
    --------
    >>> from dataclasses import replace
    >>> dt = record.dt[:, None]
    >>> up = sc.calibration.turntable.scheme(6)
    >>> dwells = [replace(record, dvel=(9.81 * x + [0.05, 0.0, 0.0]) * dt) for x in up]
    >>> fit = calibrate_positions(dwells, 9.81)
    >>> round(float(fit.calibration.accel_bias[0]), 3)
    0.05
    """
    recognised, given = None, None
    if positions is None:
        recognised = recognise(records, initial)
        dwells = recognised.dwells
    elif isinstance(positions, int):
        dwells = dwells_of(records, None, positions, initial)
    else:
        given = list(positions)
        dwells = dwells_of(records, given, len(given), initial)
    rate, force = mean_outputs(dwells)
    if recognised is not None:
        up = recognised.up
    elif given is None:
        assert isinstance(positions, int)
        up = nearest_directions(force, scheme(positions))
    else:
        up = np.array([p.mat_nb[2] for p in given])
        angle = np.arccos(
            np.clip(np.sum(force * up, axis=1) / np.linalg.norm(force, axis=1), -1, 1)
        )
        if angle.max() > TOO_FAR:
            k = int(angle.argmax())
            raise InputError(
                f"position {k + 1}: the force is {angle[k] / DEG:.0f} deg from where the sequence "
                "says that up is: look at its order, its angles and the axes of the record"
            )
    fit = static_test(force, gravity * up)
    parts: dict[str, Array] = {"accel_bias": fit.bias, "accel_matrix": fit.matrix}
    sigma = {"accel_bias": fit.bias_sigma, "accel_matrix": fit.matrix_sigma}
    base = base or Calibration()
    if given is not None and site is not None:
        earth_n = EARTH_RATE * np.array([0.0, np.cos(site.latitude), np.sin(site.latitude)])
        earth = np.array([p.mat_nb.T @ earth_n for p in given])
        left = rate - earth @ np.linalg.inv(base.gyro_matrix).T
        parts["gyro_bias"] = left.mean(axis=0)
        sigma["gyro_bias"] = left.std(axis=0, ddof=1) / np.sqrt(len(left))
    note = "" if recognised is None else recognised.text
    if recognised is not None and recognised.attitude_deg is not None and site is not None:
        found = fit_gyro_bias(rate, recognised.attitude_deg, site, base.gyro_matrix)
        parts["gyro_bias"], sigma["gyro_bias"] = found.bias, found.bias_sigma
        if found.psi_sigma < _TELLS:
            # psi is counter-clockwise, a heading clockwise.
            heading = float(psi_to_heading(found.psi)) / DEG
            note += f", the first dwell's heading {heading:.2f} ± {found.psi_sigma / DEG:.2g} deg"
    residual = force - fit.bias - gravity * up @ fit.model.T
    return TableTest(
        "positions", _merged(base, parts, sigma, name), tuple(parts),
        np.array([[r.start, r.time[-1]] for r in dwells]), gravity * up, residual,
        fit.residual_rms, note,
    )  # fmt: skip


def calibrate_rates(
    record: ImuRecord, turns: Sequence[RateTurn], site: Site, *, base: Calibration | None = None,
    name: str = "rates",
) -> TableTest:  # fmt: skip
    """Calibrate the gyros from turns of a table at known constant rates.

    Each turn is cut to whole revolutions, over which what is across its axis averages out.

    Parameters
    ----------
    record : ImuRecord
    turns : sequence of RateTurn
        About each axis, both ways; in order where their times are not given.
    site : Site
        Its Earth rate along the table's axis is taken off.
    base : Calibration, optional
        Has what is not observable in this test: the accelerometers.
    name : str

    Raises
    ------
    InputError
        For turns that are not found in the record, or leave an axis that is not observable.

    Examples
    --------
    >>> rates, axes = np.tile([0.6, -0.6], 3), np.repeat(np.eye(3), 2, axis=0)
    >>> turning = np.repeat(rates[:, None] * axes, 240, axis=0)
    >>> turning[np.arange(1440) % 240 < 60] = 0.0
    >>> time, dt = 0.05 * np.arange(1, 1441), np.full(1440, 0.05)
    >>> turned = sc.ImuRecord(time, dt, (turning + 1e-4) * 0.05, np.zeros((1440, 3)))
    >>> turns = [RateTurn(tuple(axis), rate) for rate, axis in zip(rates, axes)]
    >>> fit = calibrate_rates(turned, turns, sc.Site(0.0))
    >>> round(float(fit.calibration.gyro_bias[0]), 5)
    0.0001
    """
    stretches = turn_stretches(record, turns)
    earth_n = EARTH_RATE * np.array([0.0, np.cos(site.latitude), np.sin(site.latitude)])
    outputs, along, kept = [], [], []
    for k, (turn, (a, b)) in enumerate(zip(turns, stretches, strict=True), 1):
        revolution = 2.0 * np.pi / abs(turn.rate)
        whole = np.floor((b - a) / revolution + 1e-6) * revolution
        part = record.between(a, a + (whole or b - a))
        if len(part) < 10:
            raise InputError(f"turn {k}: holds {len(part)} samples; a turn needs ten or more")
        outputs.append(np.sum(part.dtheta, axis=0) / np.sum(part.dt))
        direction = np.asarray(turn.direction) / np.linalg.norm(turn.direction)
        along.append(float(direction @ earth_n))
        kept.append((part.start, part.time[-1]))
    rates, axes = np.array([t.rate for t in turns]), np.array([t.axis for t in turns])
    y = np.array(outputs)
    fit = rate_test(y, rates, axes, along)
    truth = (rates + along)[:, None] * axes / np.linalg.norm(axes, axis=1)[:, None]
    residual = y - fit.bias - truth @ fit.model.T
    parts = {"gyro_bias": fit.bias, "gyro_matrix": fit.matrix}
    sigma = {"gyro_bias": fit.bias_sigma, "gyro_matrix": fit.matrix_sigma}
    return TableTest(
        "rates", _merged(base or Calibration(), parts, sigma, name), tuple(parts), np.array(kept),
        truth, residual, fit.residual_rms,
    )  # fmt: skip


def _merged(
    base: Calibration, parts: dict[str, Array], sigma: dict[str, Array], name: str
) -> Calibration:
    kept = {key: value for key, value in base.sigma.items() if key not in parts}
    changed: dict[str, Any] = dict(parts)
    return replace(base, **changed, sigma={**kept, **sigma}, name=name)
