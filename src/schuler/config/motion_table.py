"""What every motion of a scenario file may have: others that add to it, and one on board.

Each model checks by making its motion once: what the motion refuses when it is made is then an
error of the file, at the table of the motion.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from schuler.config.quantities import (
    MetresTriple,
)
from schuler.motion import (
    Carried,
    Motion,
    Sum,
)

if TYPE_CHECKING:
    from schuler.config.motions import AnyMotion

__all__ = ["ORIGIN", "MotionTable", "Strict"]


ORIGIN = (0.0, 0.0, 0.0)

_TRIAL = np.array([0.0, 7.3, 31.7])
"""Times at which a motion is tried out, s."""


class Strict(BaseModel):
    """A table whose keys are all known."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=False)


class MotionTable(Strict):
    """What every motion may have: others that add to it, and one on board."""

    with_: list[AnyMotion] = Field(default_factory=list, alias="with")
    on_board: AnyMotion | None = None
    mount: MetresTriple | None = None

    @property
    def frames(self) -> int:
        """Turning frames of the chain."""
        return 1 + (self.on_board.frames if self.on_board else 0)

    @abstractmethod
    def own(self, rng: np.random.Generator, duration: float) -> Motion:
        """Make the motion of this table alone."""

    def make(self, rng: np.random.Generator, duration: float) -> Motion:
        """Make the motion with all that adds to it and rides on it.

        Parameters
        ----------
        rng : numpy.random.Generator
            What is random is drawn in the order of the file: own, with, on board.
        duration : float
            Length of the record, s.
        """
        motion = self.own(rng, duration)
        if self.with_:
            motion = Sum((motion, *(part.make(rng, duration) for part in self.with_)))
        if self.on_board is None:
            return motion
        return Carried(motion, self.on_board.make(rng, duration), self.mount or ORIGIN)

    @model_validator(mode="after")
    def _fits(self) -> Any:
        if self.mount is not None and self.on_board is None:
            raise ValueError("mount says where on_board sits, but there is no on_board")
        alone = self.frames - (self.on_board.frames if self.on_board else 0)
        for part in self.with_:
            if part.frames != alone:
                raise ValueError(
                    "what adds (with) must turn in as many frames as the motion itself: "
                    f"{part.kind} has {part.frames}, {getattr(self, 'kind', 'it')} has {alone}"
                )
        self.make(np.random.default_rng(0), 60.0).track(_TRIAL)
        return self

    @field_validator("on_board")
    @classmethod
    def _stays(cls, value: Any) -> Any:
        if value is not None:
            path = value.make(np.random.default_rng(0), 60.0).track(_TRIAL).path
            if np.any(path):
                raise ValueError(
                    f"what is on board may turn but not travel, and {value.kind} travels: "
                    "give its way to the motion that carries it"
                )
        return value
