"""`Campaign`: what is to be done, as a value, and the chunks that it is cut into."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from schuler._version import __version__
from schuler.alignment import parse_method
from schuler.campaigns.chunk import Chunk
from schuler.config import Scenario
from schuler.config.load import with_overrides
from schuler.errors import InputError

__all__ = ["Campaign", "Point"]


@dataclass(frozen=True)
class Point:
    """One place in a sweep: the values that are set there, and the scenario that they make."""

    number: int
    values: Mapping[str, Any]
    scenario: Scenario
    methods: tuple[str, ...]

    @property
    def label(self) -> str:
        """What is set here: ``motion.heading = 90``."""
        return ", ".join(f"{key} = {value}" for key, value in self.values.items())


@dataclass(frozen=True, eq=False)
class Campaign:
    """Many runs of a scenario, at each place of a sweep, aligned by each method.

    Parameters
    ----------
    scenario : Scenario
    runs : int
        Runs at each place. Run k has the same seed at all of them, so that places differ by what
        is swept and not by chance.
    sweep : mapping of str to sequence, optional
        Keys of the scenario and the values that they take, all with all.
    methods : tuple of str, mapping or Method, optional
        Alignment methods; those of the scenario when not given.
    chunk : int
        Runs of a chunk.

    Raises
    ------
    InputError
        For numbers out of range, an unknown method, or values that the scenario refuses.

    Examples
    --------
    >>> plan = sc.Campaign(sc.load_scenario("truck.toml"), 100, {"motion.shake_mm": (1, 4)})
    >>> plan.runs
    100
    """

    scenario: Scenario
    runs: int
    sweep: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    methods: tuple[Any, ...] = ()
    chunk: int = 16

    def __post_init__(self) -> None:
        if self.runs < 1:
            raise InputError(f"a campaign needs one run at least, got {self.runs}")
        if self.chunk < 1:
            raise InputError(f"a chunk needs one run at least, got {self.chunk}")
        object.__setattr__(self, "methods", tuple(_name(m) for m in self.methods))
        if len(set(self.methods)) != len(self.methods):
            raise InputError(f"a method is named twice: {', '.join(self.methods)}")
        for key, values in self.sweep.items():
            if not values:
                raise InputError(f"the sweep of {key} has no values")
        # All places are checked before the first run.
        _ = self.points

    @cached_property
    def points(self) -> tuple[Point, ...]:
        """The places of the sweep; one without values where nothing is swept."""
        out = []
        for number, combination in enumerate(itertools.product(*self.sweep.values())):
            values = dict(zip(self.sweep, combination, strict=True))
            scenario = with_overrides(self.scenario, values) if values else self.scenario
            out.append(Point(number, values, scenario, self.methods or scenario.methods))
        return tuple(out)

    @property
    def total(self) -> int:
        """Runs at all places together."""
        return self.runs * len(self.points)

    @property
    def rows(self) -> int:
        """Rows of the results: one for each run and method."""
        return self.runs * sum(len(point.methods) for point in self.points)

    def chunks(self) -> Iterator[Chunk]:
        """Give the chunks in order."""
        number = 0
        for point in self.points:
            text = point.scenario.to_json()
            for first in range(0, self.runs, self.chunk):
                count = min(self.chunk, self.runs - first)
                yield Chunk(number, point.number, text, point.methods, first, count, __version__)
                number += 1

    @cached_property
    def manifest(self) -> dict[str, Any]:
        """What makes this campaign this one, as plain values."""
        return {
            "schema": "schuler.campaign/1",
            "schuler": __version__,
            "scenario": json.loads(self.scenario.to_json()),
            "runs": self.runs,
            "sweep": {key: list(values) for key, values in self.sweep.items()},
            "methods": list(self.methods),
            "points": [point.scenario.digest for point in self.points],
            "chunk": self.chunk,
        }

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the manifest."""
        return hashlib.sha256(json.dumps(self.manifest, sort_keys=True).encode()).hexdigest()


def _name(method: Any) -> str:
    """Return the text of a method, by which workers make it again."""
    return str(parse_method(method))
