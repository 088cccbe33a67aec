"""A scheme by every objective: beside the published one, and beside the best found for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from schuler.centrifuge.objective import OBJECTIVES, Objective, judge, time_to_reach
from schuler.centrifuge.plant import Plant
from schuler.errors import InputError

__all__ = ["LABELS", "Scorecard", "by_objective", "score"]

#: what the objectives are called where a person reads them, with their units
LABELS = {
    "sum-rho": "sum of |correlation|",
    "a": "mean (sigma / wanted)^2",
    "d": "log det of the covariance",
    "e": "largest eigenvalue",
    "min-max": "largest sigma / wanted",
    "time": "time to reach the wanted, s",
}


@dataclass(frozen=True)
class Scorecard:
    """Values of a scheme by objective; infinite where a coefficient is not observable.

    Parameters
    ----------
    optimised : str
        The objective that the search made small.
    plan, published : dict of str to float
    best : dict of str to float
        The least found by a search for that objective; empty where none was made.

    Examples
    --------
    >>> from schuler.centrifuge import PUBLISHED_POSITIONS
    >>> values = score(Plant(), PUBLISHED_POSITIONS, 20.0)
    >>> card = Scorecard("min-max", plan=values, published=values)
    >>> len(card.rows())
    6
    """

    optimised: str
    plan: dict[str, float]
    published: dict[str, float]
    best: dict[str, float] = field(default_factory=dict)

    @property
    def headline(self) -> str:
        """What was optimised, and what that cost elsewhere."""
        name = self.optimised
        text = (
            f"optimised: {LABELS[name]}, {self.plan[name]:.4g} "
            f"(published scheme {self.published[name]:.4g})"
        )
        worse = [k for k in OBJECTIVES if self.plan[k] > self.published[k]]
        text += "; worse than the published scheme in " + (
            ", ".join(
                f"{LABELS[k]} ({self.plan[k]:.4g}, published {self.published[k]:.4g})"
                for k in worse
            )
            or "nothing"
        )
        given_up = [
            k for k, value in self.best.items()
            if k != name and self.plan[k] - value > 0.01 * abs(value)
        ]  # fmt: skip
        if given_up:
            text += "; short of the best found in " + ", ".join(
                f"{LABELS[k]} ({self.plan[k]:.4g}, best {self.best[k]:.4g})" for k in given_up
            )
        return text

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each objective, as JSON takes it: null is infinite or not searched."""

        def plain(value: float | None) -> float | None:
            return value if value is not None and np.isfinite(value) else None

        return [
            {"name": name, "plan": plain(self.plan[name]), "published": plain(self.published[name]),
             "best": plain(self.best.get(name))}
            for name in OBJECTIVES
        ]  # fmt: skip

    def __str__(self) -> str:
        lines = [f"{'':28} {'this plan':>10} {'published':>10} {'best found':>10}"]
        for name, text in LABELS.items():
            best = f"{self.best[name]:10.4g}" if name in self.best else f"{'-':>10}"
            lines.append(
                f"{text:28} {self.plan[name]:10.4g} {self.published[name]:10.4g} {best}"
                + ("  optimised" if name == self.optimised else "")
            )
        return "\n".join(lines)


def by_objective(cards: Mapping[int, Scorecard]) -> str:
    """Return a table of every objective by the number of positions, the least of each marked.

    Parameters
    ----------
    cards : mapping of int to Scorecard
        Of the plan with so many positions.

    Examples
    --------
    >>> from schuler.centrifuge import PUBLISHED_POSITIONS
    >>> values = score(Plant(), PUBLISHED_POSITIONS, 20.0)
    >>> by_objective({6: Scorecard("min-max", values, values)}).splitlines()[0]
    'positions                             6'
    """
    lines = [f"{'positions':28}" + "".join(f"{count:>11}" for count in cards)]
    for name, text in LABELS.items():
        values = [card.plan[name] for card in cards.values()]
        least = min(values)
        lines.append(
            f"{text:28}" + "".join(
                f"{value:10.4g}{'*' if value == least and np.isfinite(value) else ' '}"
                for value in values
            )
        )  # fmt: skip
    return "\n".join(line.rstrip() for line in lines)


def score(
    plant: Plant, positions: ArrayLike, dwell: float, objective: Objective | None = None
) -> dict[str, float]:
    """Return a scheme's value by every objective, the time to reach the wanted accuracy among them.

    Parameters
    ----------
    plant : Plant
    positions : (p, 3) array_like
        alpha, beta, gamma, deg.
    dwell : float
        s at each position.
    objective : Objective, optional
        Its wanted accuracies count.

    Examples
    --------
    >>> from schuler.centrifuge import PUBLISHED_POSITIONS
    >>> sorted(score(Plant(), PUBLISHED_POSITIONS, 20.0))
    ['a', 'd', 'e', 'min-max', 'sum-rho', 'time']
    """
    try:
        values = dict(judge(plant, positions, dwell, objective).values)
    except InputError:
        # A scheme in which a coefficient is not observable at this dwell.
        values = dict.fromkeys((name for name in OBJECTIVES if name != "time"), float("inf"))
    return {**values, "time": time_to_reach(plant, positions, objective)}
