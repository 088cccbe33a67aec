"""Passes of the filter of a transfer alignment: without feedback, each about the one before.

Corrected in mid-span, a start that is wrong by a degree makes the filter too sure of what straight
flight does not show.
A delay is taken off the master's times, and the passes are made again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.moving.fine import FineAlignment, iterate
from schuler.alignment.moving.prepared import mean_square
from schuler.alignment.moving.setup import Nominal
from schuler.alignment.transfer.master import MasterNoise, state_at
from schuler.alignment.transfer.setup import Matching
from schuler.attitude import multiply, quat_to_rotvec
from schuler.ins import Layout, Measurement

__all__ = ["Found", "budget_and_bound", "passes"]

Array = NDArray[np.float64]

_VIBRATION = (0.0, 0.003, 0.01, 0.03, 0.1)
"""Velocity random walks that are tried until the innovations agree, m/s/sqrt(s)."""

AGREES = 1.3
"""Mean squared normalised innovation up to which all is as it was said to be."""

_DELAY_LEFT, _DELAY_PASSES = 2e-4, 5
"""A delay (s) that is found beyond the first is taken off the times, so many times at most."""

_WIDENED = 4
"""Times that the master's noise is made wider."""

_TURN_LEFT = 2e-3
"""The master's rates are turned anew where the mounting has changed by so much, rad."""

_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


@dataclass(frozen=True, eq=False)
class Found:
    """Passes over a span.

    Parameters
    ----------
    fine : FineAlignment
    layout : Layout
    prior : (n, n) float64
        Covariance before anything is measured.
    measured : tuple of Measurement
    delay : float
        What is off the master's times, s.
    square : float
        Mean squared normalised innovation.
    vibration : float
        Velocity random walk that was taken, m/s/sqrt(s).
    """

    fine: FineAlignment
    layout: Layout
    prior: Array
    measured: tuple[Measurement, ...]
    delay: float
    square: float
    vibration: float


def passes(matching: Matching, vibration: float | None, *, learn: bool) -> tuple[Matching, Found]:
    """Return the passes with the noise that their innovations agree with, and what was matched.

    Parameters
    ----------
    matching : Matching
    vibration : float or None
        Velocity random walk, m/s/sqrt(s); None for the least one that agrees.
    learn : bool
        Widen the master's noise to what its innovations show, before any vibration is taken.
    """
    walks = _VIBRATION if vibration is None else (vibration,)
    found = _delayed(matching, walks[0])
    for _ in range(_WIDENED if learn else 0):
        wider = _widened(matching, found)
        if wider is matching.noise:
            break
        matching = replace(matching, noise=wider)
        found = _delayed(matching, walks[0])
    for walk in walks[1:]:
        if found.square < AGREES:
            break
        found = _delayed(matching, walk)
    return matching, found


def _widened(matching: Matching, found: Found) -> MasterNoise:
    """Return the master's noise, wider where its innovations are larger than their sigma."""
    noise = matching.noise
    for aid in found.measured:
        what = aid.label.removeprefix("master_")
        square = mean_square(found.fine, [aid])
        if what != "rate" and square >= AGREES:
            noise = replace(noise, **{what: getattr(noise, what) * float(np.sqrt(square))})
    return noise


def _delayed(matching: Matching, walk: float) -> Found:
    """Return the passes once the master's delay is off its times."""
    delay, nominal, mounting = matching.known.delay, None, matching.known.mounting
    again = _DELAY_PASSES
    while True:
        # The last passes judge each row; those before are too far off for that.
        measured = matching.measured(delay, mounting, gate=again == 0)
        layout = matching.layout(measured)
        start = matching.start(delay)
        build = partial(matching.build, layout, start, measured, walk)
        fine = iterate(
            matching.record, start, layout, measured, build, nominal=nominal, correct=False,
            budget=False,
        )  # fmt: skip
        if again == 0:
            break
        rest = _rest(fine)
        again -= 1
        nominal = fine.start.nominal
        before, mounting = mounting, _mounting_at_start(matching, nominal, delay)
        turned = np.linalg.norm(quat_to_rotvec(multiply(before * _CONJUGATE, mounting)))
        if abs(rest) < _DELAY_LEFT and (not matching.by_master or turned < _TURN_LEFT):
            again = 0
            continue
        delay += rest
        late = {"transfer.delay": np.zeros(1)}
        nominal = replace(nominal, parameters={**nominal.parameters, **late})
    return Found(
        fine, layout, matching.prior(layout, start), tuple(measured), delay,
        mean_square(fine, measured), walk,
    )  # fmt: skip


def _mounting_at_start(matching: Matching, nominal: Nominal, delay: float) -> Array:
    """Return the mounting (4,) that the slave's attitude at the start has on the master's."""
    master = state_at(matching.master, np.array([matching.record.start + delay]))
    return np.asarray(multiply(master.quat_nb[0] * _CONJUGATE, nominal.quat_nb))


def _rest(fine: FineAlignment) -> float:
    delay = fine.end.parameters.get("transfer.delay")
    return 0.0 if delay is None else float(delay[0])


def budget_and_bound(
    matching: Matching, found: Found, at: str
) -> tuple[dict[str, Array], Array]:  # fmt: skip
    """Return phi's covariance by source, and what it would be without vibration."""
    measured = list(found.measured)
    out: list[FineAlignment] = []
    start = matching.start(found.delay)
    for walk in dict.fromkeys((found.vibration, 0.0)):
        build = partial(matching.build, found.layout, start, measured, walk)
        out.append(
            iterate(
                matching.record, start, found.layout, measured, build,
                nominal=found.fine.start.nominal, correct=False, budget=walk == found.vibration,
                most=1,
            )
        )  # fmt: skip
    last = out[-1].end if at == "end" else out[-1].start
    budget = {name: part for name, part in out[0].budget.items() if np.any(part)}
    return budget, np.asarray(last.covariance[:3, :3])
