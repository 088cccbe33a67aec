"""The published experiments, redone: printed, by the document's method, by ours, and the limit.

Conditions and printed figures are data (``published/data/*.toml``, each with its citation). No
figure of ours is stored: each is computed when it is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from typing import Any

from schuler.errors import InputError, near
from schuler.published.figures import Curve, Figure
from schuler.published.result import Experiment, Options, Row, changeable, conditions

__all__ = [
    "EXPERIMENTS",
    "Curve",
    "Experiment",
    "Figure",
    "Options",
    "Row",
    "changeable",
    "conditions",
    "run",
    "to_dict",
]

#: names, in the order in which they are run
EXPERIMENTS = ("guo2015", "fang2006", "yu_emd", "du2016", "xu2017", "niu2025")


def run(
    name: str, *, runs: int | None = None, seed: int = 0, workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
    changes: Mapping[str, Any] | None = None,
) -> Experiment:  # fmt: skip
    """Redo a published experiment.

    Parameters
    ----------
    name : str
        One of `EXPERIMENTS`.
    runs, seed, workers, progress
        As in `Options`.
    changes : mapping of str to value, optional
        Conditions that are other than the document's, as ``{"site.lat": 50.0}``; `changeable`
        has them all.

    Raises
    ------
    InputError
        For an unknown name, or options or conditions that cannot be.
    """
    if name not in EXPERIMENTS:
        raise InputError(
            f"'{name}'{near(name, EXPERIMENTS)} is no published experiment; there are "
            f"{', '.join(EXPERIMENTS)}"
        )
    changed = tuple((changes or {}).items())
    conditions(name, changed)
    module = import_module(f"schuler.published.{name}")
    found: Experiment = module.run(Options(runs, seed, workers, progress, changed))
    return found


def to_dict(experiments: Iterable[Experiment]) -> dict[str, Any]:
    """Return experiments with the keys of the JSON schema `schuler.published/1`.

    Examples
    --------
    >>> to_dict([])["schema"]
    'schuler.published/1'
    """
    return {
        "schema": "schuler.published/1",
        "experiments": {each.name: each.to_dict() for each in experiments},
    }
