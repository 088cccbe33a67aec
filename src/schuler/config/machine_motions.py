"""Motions in a scenario file of machines that rotate an IMU: turntable, scheme, centrifuge."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from schuler.config.motion_table import ORIGIN, MotionTable, Strict
from schuler.config.quantities import (
    AngularRate,
    Count,
    Degrees,
    DegreesTriple,
    Metres,
    MetresTriple,
    Positive,
    Time,
    deg_per_second,
)
from schuler.motion import (
    Centrifuge,
    Dwell,
    Motion,
    Turn,
    Turntable,
    continuous_rotation,
    four_position,
    two_axis_16,
)

__all__ = ["CentrifugeTable", "RotationTable", "TurntableTable"]


Axis = Literal["psi", "theta", "gamma"]


class StepTable(Strict):
    """A dwell, or a turn of one axis."""

    dwell: Time | None = None
    turn: Axis | None = None
    angle: Degrees | None = None
    rate: AngularRate = np.radians(10.0)
    acceleration_deg_s2: Positive = 20.0

    @model_validator(mode="after")
    def _one(self) -> StepTable:
        if (self.dwell is None) == (self.turn is None):
            raise ValueError("a step is either a dwell (dwell = '60 s') or a turn (turn = 'psi')")
        if self.turn is not None and self.angle is None:
            raise ValueError("a turn needs its angle")
        if self.dwell is not None and self.model_fields_set - {"dwell"}:
            raise ValueError("a dwell has nothing but its time")
        self.make()
        return self

    def make(self) -> Dwell | Turn:
        """Make the step."""
        if self.dwell is not None:
            return Dwell(self.dwell)
        assert self.turn is not None
        assert self.angle is not None
        rate = deg_per_second(self.rate)
        return Turn(self.turn, self.angle, rate, self.acceleration_deg_s2)


class TurntableTable(MotionTable):
    """A turntable that runs a list of steps."""

    kind: Literal["turntable"]
    steps: Annotated[list[StepTable], Field(min_length=1)]
    start: DegreesTriple = ORIGIN
    repeat: bool = False
    lever: MetresTriple = ORIGIN

    def own(self, rng: np.random.Generator, duration: float) -> Motion:
        """Make it."""
        steps = tuple(step.make() for step in self.steps)
        return Turntable(steps, self.start, self.repeat, self.lever)


class RotationTable(MotionTable):
    """A named scheme of rotation modulation."""

    kind: Literal["rotation"]
    scheme: Literal["four-position", "two-axis-16", "continuous"]
    dwell: Time | None = None
    rate: AngularRate = np.radians(10.0)
    acceleration_deg_s2: Positive = 20.0
    axis: Axis = "psi"
    turns: Annotated[Count, Field(ge=1)] = 1

    @model_validator(mode="after")
    def _belongs(self) -> RotationTable:
        strange = {
            "four-position": {"turns"},
            "two-axis-16": {"turns", "axis"},
            "continuous": {"dwell"},
        }[self.scheme] & self.model_fields_set
        if strange:
            raise ValueError(f"{min(strange)} is nothing that the scheme {self.scheme} has")
        if self.scheme != "continuous" and self.dwell is None:
            raise ValueError(f"the scheme {self.scheme} needs its dwell, such as '60 s'")
        return self

    def own(self, rng: np.random.Generator, duration: float) -> Motion:
        """Make it."""
        rate, acceleration = deg_per_second(self.rate), self.acceleration_deg_s2
        if self.scheme == "continuous":
            return continuous_rotation(
                rate, turns=self.turns, acceleration=acceleration, axis=self.axis
            )
        dwell = self.dwell or 0.0
        if self.scheme == "two-axis-16":
            return two_axis_16(dwell, rate=rate, acceleration=acceleration)
        return four_position(dwell, rate=rate, acceleration=acceleration, axis=self.axis)


class CentrifugeTable(MotionTable):
    """A centrifuge."""

    kind: Literal["centrifuge"]
    radius: Annotated[Metres, Field(ge=0)]
    rate: AngularRate
    spin_up: Time = 0.0
    counter_rotation: bool = True
    orientation: DegreesTriple = ORIGIN
    start: Degrees = 0.0

    @property
    def frames(self) -> int:
        """Turning frames: arm, platform, IMU, and what is on board."""
        return 2 + super().frames

    def own(self, rng: np.random.Generator, duration: float) -> Motion:
        """Make it."""
        return Centrifuge(
            self.radius, deg_per_second(self.rate), self.spin_up, self.counter_rotation,
            self.orientation, self.start,
        )  # fmt: skip
