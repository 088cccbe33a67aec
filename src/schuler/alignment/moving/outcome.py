"""From a span's filter to a `MovingAlignment`: what contradicts, what is unusual, the bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import GnssFixes
from schuler.alignment.history import History
from schuler.alignment.moving.fine import FineAlignment, difference, filtered_end, run_pass
from schuler.alignment.moving.prepared import Prepared, Taken
from schuler.alignment.moving.result import InMotion, MovingAlignment
from schuler.alignment.moving.setup import make_filter, prior_sigma
from schuler.constants import DEG
from schuler.earth import Site
from schuler.in_motion.coarse import CoarseAlignment
from schuler.ins import ErrorStateFilter, Measurement
from schuler.record import Summariser, Summary
from schuler.sensors import CONSUMER_MEMS, ImuSpec

__all__ = ["Later", "Tally", "bound_filter", "compose"]

Array = NDArray[np.float64]

_WRONG = 2.0
"""Innovations beside their sigma, rms, beyond which record and aids contradict each other."""

_BEYOND = 6.0
"""Prior sigmas beyond which an estimate of the instrument contradicts its specification."""

_GROSS = 0.3
"""Scale factor or misalignment from which on it is another unit or axis."""

_REFUSED = 0.3
"""Share of refused measurements that contradicts."""


@dataclass
class Tally:
    """Measurements that a filter took and refused, by aid, and the squares of their innovations.

    Parameters
    ----------
    used, refused : dict of str to int
    square : float
        Sum of the squared normalised innovations.
    count : int
        Of them.
    """

    used: dict[str, int] = field(default_factory=dict)
    refused: dict[str, int] = field(default_factory=dict)
    square: float = 0.0
    count: int = 0

    def add(self, flt: ErrorStateFilter, measured: Sequence[Measurement]) -> None:
        """Count what a filter has kept of each aid."""
        for aid in measured:
            _, z, sigma, weight = flt.innovations(aid.label)
            taken = weight > 0.0
            good = (sigma > 0.0) & taken[:, None]
            self.used[aid.label] = self.used.get(aid.label, 0) + int(np.sum(taken))
            self.refused[aid.label] = self.refused.get(aid.label, 0) + int(np.sum(~taken))
            self.square += float(np.sum((z[good] / sigma[good]) ** 2))
            self.count += int(good.sum())

    @property
    def mean_square(self) -> float:
        """Mean squared normalised innovation of what was taken."""
        return self.square / max(self.count, 1)


@dataclass(frozen=True, eq=False)
class Later:
    """What a filter that ran on after a span's passes has at a later instant.

    Parameters
    ----------
    end : float
        The instant, s.
    samples : int
        Since the span's start.
    tally : Tally
        Of all measurements since then.
    bound : (3, 3) float64
        Of phi.
    warnings : tuple of str
    history, summary : History, Summary
        Of the span.
    """

    end: float
    samples: int
    tally: Tally
    bound: Array
    warnings: tuple[str, ...]
    history: History
    summary: Summary


def compose(
    prepared: Prepared, rough: CoarseAlignment, found: FineAlignment, taken: Taken, spec: ImuSpec,
    warnings: Sequence[str], at: str, later: Later | None = None,
) -> MovingAlignment:  # fmt: skip
    """Return the alignment of a span, or of the instant up to which its filter ran on.

    Parameters
    ----------
    prepared, rough, found, taken
        Of the span; `found` has the state of the later instant as its end.
    spec : ImuSpec
    warnings : sequence of str
        That come first.
    at : {"start", "end"}
    later : Later, optional
    """
    measured, noise = taken.measured, taken.noise
    record = prepared.record
    state = found.end if at == "end" else found.start
    phi = state.covariance[:3, :3]
    budget = (
        {name: part for name, part in found.budget.items() if np.any(part)}
        if at == "end" else {"all_sources": phi}
    )  # fmt: skip
    warnings = list(warnings)
    if later is None:
        tally = Tally()
        tally.add(found.filter, measured)
        bound = _bound(prepared, found, taken, at)
        history, summary = History.of_record(record), _summary(prepared)
    else:
        tally, bound = later.tally, later.bound
        history, summary = later.history, later.summary
        warnings += later.warnings
    contradictions = _refusals(tally)
    if tally.mean_square > _WRONG:
        contradictions.append(
            f"innovations are {np.sqrt(tally.mean_square):.2g} times their sigma: the instrument's "
            "noise, the delay, the lever arm or the axes are not what they are said to be"
        )
    beyond, unusual = _beyond_prior(prepared, rough, found)
    contradictions += beyond
    warnings += unusual
    if found.moved > 1.0:
        contradictions.append(
            f"after {found.passes} passes the start still moves by {found.moved:.2g} sigma"
        )
    if noise > 0.0 and spec is not CONSUMER_MEMS:
        warnings.append(
            f"vibration: a velocity random walk of {noise:.2g} m/s/sqrt(s) was taken, "
            f"beside {spec.accelerometer.white:.2g} of the specification"
        )
    for each in prepared.aids:
        if isinstance(each, GnssFixes):
            contradictions += each.contradictions()
    where = Site(state.lat / DEG, (state.lon / DEG + 180.0) % 360.0 - 180.0, state.height)
    b, a = (state.layout[f"{name}_bias"] for name in ("gyro", "accelerometer"))
    pick = [*range(b.start, b.stop), *range(a.start, a.stop)]
    fix = MovingAlignment(
        method=InMotion(rough.form, noise), site=where, start=record.start,
        end=record.end if later is None else later.end,
        samples=len(record) if later is None else later.samples, at=at, quat_nb=state.quat_nb,
        covariance=np.asarray(phi), budget=budget, bound=bound, warnings=tuple(warnings),
        spec=spec, orthonormality=None, gyro_bias=state.parameters["gyro_bias"],
        accel_bias=state.parameters["accelerometer_bias"],
        bias_covariance=state.covariance[np.ix_(pick, pick)], history=history, summary=summary,
        inputs={"record": record.name}, state=state, coarse=rough, measured=measured,
        used=tally.used, refused=tally.refused, passes=found.passes,
        mean_square=tally.mean_square, restamped=taken.restamped,
        epochs=found.filter.history(),
        innovations={aid.label: found.filter.innovations(aid.label) for aid in measured},
        smoothed_heading=found.smoothed_heading,
    )  # fmt: skip
    contradicted = fix.contradicted(contradictions)
    assert isinstance(contradicted, MovingAlignment)
    return contradicted


def _summary(prepared: Prepared) -> Summary:
    summariser = Summariser()
    summariser.push(prepared.record)
    return summariser.summary()


def _refusals(tally: Tally) -> list[str]:
    out = []
    for name, off in tally.refused.items():
        total = off + tally.used[name]
        if total and off > _REFUSED * total:
            out.append(
                f"{off} of {total} measurements of {name} were refused: the record's axes and "
                "units, or their sigma, are not what they are said to be"
            )
    return out


def _beyond_prior(
    prepared: Prepared, rough: CoarseAlignment, found: FineAlignment
) -> tuple[list[str], list[str]]:
    """Return contradictions and warnings of sensors' errors that are not what was specified.

    A wrong unit hides in a scale factor, wrong axes in a misalignment: these are large. A smaller
    one beyond the specification, as vibration makes, says little of the attitude. What bias and
    scale of an accelerometer add up to at the mean force is seen far better than either.
    """
    layout = found.start.layout
    off = difference(layout, found.start.nominal, prepared.nominal(rough))
    prior = prior_sigma(layout, prepared.spec, prepared.aids)
    name = prepared.spec.name
    contradictions, warnings = [], []
    for sensor in ("gyro", "accelerometer"):
        level = f"{sensor}_bias"
        size, sigma = off[layout[level]], prior[layout[level]]
        group = f"{sensor}_matrix"
        if group in layout:
            place = layout[group]
            matrix, spread = off[place].reshape(3, 3), prior[place].reshape(3, 3)
            if sensor == "accelerometer":
                mean = prepared.record.dvel.sum(axis=0) / prepared.record.duration
                size, sigma = size + matrix @ mean, np.hypot(sigma, np.abs(spread @ mean))
            beyond = np.abs(matrix) / np.maximum(spread, 1e-300)
            worst = float(beyond.max())
            if worst > _BEYOND:
                text = (
                    f"the {sensor}'s scale factor or misalignment is found {worst:.0f} times its "
                    f"1-sigma of '{name}'"
                )
                if np.any((beyond > _BEYOND) & (np.abs(matrix) > _GROSS)):
                    contradictions.append(f"{text}: units, axes or the specification are wrong")
                else:
                    warnings.append(f"{text} ({np.abs(matrix).max():.2g})")
        worst = float(np.max(np.abs(size) / np.maximum(sigma, 1e-300)))
        if worst > _BEYOND:
            contradictions.append(
                f"the {sensor}'s bias is found {worst:.0f} times its 1-sigma of '{name}': units, "
                "axes or the specification are wrong"
            )
    return contradictions, warnings


def bound_filter(
    prepared: Prepared, found: FineAlignment, taken: Taken, at: str = "end"
) -> ErrorStateFilter | None:
    """Return a filter with the specification's noise alone, run along the path that was found.

    None where the passes had no other noise: their covariance is the bound.
    """
    if taken.noise == 0.0:
        return None
    flt = make_filter(
        found.start.nominal, prepared.spec, 0.0, taken.measured, prepared.aids,
        smooth=at == "start",
    )  # fmt: skip
    run_pass(flt, prepared.record)
    return flt


def _bound(prepared: Prepared, found: FineAlignment, taken: Taken, at: str) -> Array:
    """Return the bound along the path that was found."""
    flt = bound_filter(prepared, found, taken, at)
    if flt is None:
        return np.asarray((found.end if at == "end" else found.start).covariance[:3, :3])
    if at == "start":
        return np.asarray(flt.smoothed().covariance[0][:3, :3])
    return np.asarray(filtered_end(flt)[0].covariance[:3, :3])
