"""The motions of a scenario file, one model a kind, each of which makes its motion.

Each model checks by making its motion once: what the motion's own constructor refuses is then an
error of the file, at the motion's table.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, field_validator, model_validator

from schuler.config.quantities import (
    AngularRate,
    Band2,
    Count,
    Degrees,
    DegreesTriple,
    Metres,
    MetresTriple,
    Number,
    Positive,
    PositiveTime,
    Share,
    Speed,
    Time,
    Triple,
    as_table,
    deg_per_second,
)
from schuler.motion import (
    Band,
    Carried,
    Centrifuge,
    Crew,
    DisturbedVehicle,
    Dwell,
    Hull,
    Lines,
    Manoeuvre,
    Motion,
    Route,
    Sea,
    Static,
    Sum,
    Sway,
    Turn,
    Turntable,
    continuous_rotation,
    four_position,
    moored_ship,
    two_axis_16,
)

__all__ = ["KINDS", "MODELS", "AnyMotion", "MotionTable", "Strict"]

Channel = Literal["heading", "pitch", "roll", "east", "north", "up"]
Axis = Literal["psi", "theta", "gamma"]
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


class StaticTable(MotionTable):
    """A base at rest."""

    kind: Literal["static"]
    heading: Degrees = 0.0
    pitch: Degrees = 0.0
    roll: Degrees = 0.0

    def own(self, rng: np.random.Generator, duration: float) -> Motion:
        """Make it."""
        return Static(self.heading, self.pitch, self.roll)


class BandTable(Strict):
    """Random motion of one channel in a band."""

    channel: Channel
    rms: Share
    low: Positive
    high: Positive
    lines: Annotated[Count, Field(ge=1)] = 16

    @model_validator(mode="after")
    def _ordered(self) -> BandTable:
        if self.low > self.high:
            raise ValueError(f"expected low <= high, got {self.low:g} and {self.high:g} Hz")
        return self


class LineTable(Strict):
    """One sinusoid."""

    channel: Channel
    frequency: Positive
    amplitude: Number
    phase: Degrees = 0.0


class SwayTable(MotionTable):
    """Sway of bands and lines."""

    kind: Literal["sway"]
    heading: Degrees = 0.0
    pitch: Degrees = 0.0
    roll: Degrees = 0.0
    bands: list[BandTable] = Field(default_factory=list)
    lines: list[LineTable] = Field(default_factory=list)
    lever: MetresTriple = ORIGIN

    def own(self, rng: np.random.Generator, duration: float) -> Motion:
        """Make it."""
        drawn = [Band(b.channel, b.rms, b.low, b.high, b.lines).draw(rng) for b in self.bands]
        fixed = [
            Lines(
                x.channel, np.array([x.frequency]), np.array([x.amplitude]),
                np.radians([x.phase]),
            )
            for x in self.lines
        ]  # fmt: skip
        return Sway(self.heading, self.pitch, self.roll, (*drawn, *fixed), self.lever)


class CrewTable(Strict):
    """How busy the vehicle is; what is not said is a truck with its crew at work."""

    idle_g: Share = Crew.idle_g
    idle_hz: Band2 = Crew.idle_hz
    wind_deg: Share = Crew.wind_deg
    wind_band: Band2 = Crew.wind_band
    moving_deg: Share = Crew.moving_deg
    moving_mm: Share = Crew.moving_mm
    moving_band: Band2 = Crew.moving_band
    boarding_per_minute: Share = Crew.boarding_per_minute
    boarding_deg: Share = Crew.boarding_deg
    slams_per_minute: Share = Crew.slams_per_minute
    slam_g: Share = Crew.slam_g


class VehicleTable(MotionTable):
    """A disturbed vehicle: by the rms of its sway and shake, or by its crew."""

    kind: Literal["vehicle"]
    heading: Degrees = 0.0
    pitch: Degrees = 0.0
    roll: Degrees = 0.0
    sway_deg: Triple = (0.05, 0.2, 0.3)
    sway_band: Band2 = (0.2, 2.0)
    shake_mm: Triple = (4.0, 4.0, 2.0)
    shake_band: Band2 = (0.2, 5.0)
    steps: Count = 6
    step_mm: Share = 3.0
    crew: CrewTable | None = None
    lever: MetresTriple = (0.3, -0.5, 0.8)

    @model_validator(mode="after")
    def _one_way(self) -> VehicleTable:
        said = self.model_fields_set
        plain = {"sway_deg", "sway_band", "shake_mm", "shake_band", "steps", "step_mm"} & said
        if self.crew is not None and plain:
            raise ValueError(f"a vehicle has either crew or {min(plain)}, not both")
        if self.crew is None and "lever" in said:
            raise ValueError("a vehicle's lever goes with crew; without it there is no lever")
        return self

    def own(self, rng: np.random.Generator, duration: float) -> Motion:
        """Draw it."""
        angles = {"heading": self.heading, "pitch": self.pitch, "roll": self.roll}
        if self.crew is not None:
            crew = Crew(**self.crew.model_dump())
            return DisturbedVehicle.with_crew(rng, duration, crew, lever=self.lever, **angles)
        return DisturbedVehicle.draw(
            rng, duration, sway_deg=self.sway_deg, sway_band=self.sway_band,
            shake_mm=self.shake_mm, shake_band=self.shake_band, steps=self.steps,
            step_mm=self.step_mm, **angles,
        )  # fmt: skip


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


class SeaTable(Strict):
    """A sea state."""

    height: Annotated[Metres, Field(ge=0)]
    period: PositiveTime
    gamma: Annotated[Number, Field(ge=1)] = 1.0


class HullTable(Strict):
    """How the hull answers."""

    roll_period: PositiveTime = Hull.roll_period
    roll_damping: Positive = Hull.roll_damping
    pitch_period: PositiveTime = Hull.pitch_period
    pitch_damping: Positive = Hull.pitch_damping
    heave_period: PositiveTime = Hull.heave_period
    heave_damping: Positive = Hull.heave_damping
    yaw_share: Share = Hull.yaw_share
    length: Annotated[Metres, Field(gt=0)] = Hull.length


class ShipTable(MotionTable):
    """A moored ship in a sea."""

    kind: Literal["ship"]
    sea: SeaTable
    hull: HullTable = Field(default_factory=HullTable)
    heading: Degrees = 0.0
    wave_direction: Degrees = 60.0
    waves: Annotated[Count, Field(ge=1)] = 40
    lever: MetresTriple = ORIGIN

    def own(self, rng: np.random.Generator, duration: float) -> Motion:
        """Draw it."""
        return moored_ship(
            rng, Sea(self.sea.height, self.sea.period, self.sea.gamma), heading=self.heading,
            wave_direction=self.wave_direction, hull=Hull(**self.hull.model_dump()),
            lever=self.lever, lines=self.waves,
        )  # fmt: skip


class ManoeuvreTable(Strict):
    """What changes over a time."""

    time: PositiveTime
    speed: Speed = 0.0
    turn: Degrees = 0.0
    climb: Degrees = 0.0


class RouteTable(MotionTable):
    """A route of manoeuvres."""

    kind: Literal["route"]
    heading: Degrees = 0.0
    speed: Annotated[Speed, Field(ge=0)] = 0.0
    coordinated: bool = False
    manoeuvres: list[ManoeuvreTable] = Field(default_factory=list)
    lever: MetresTriple = ORIGIN

    def own(self, rng: np.random.Generator, duration: float) -> Motion:
        """Make it."""
        parts = tuple(Manoeuvre(m.time, m.speed, m.turn, m.climb) for m in self.manoeuvres)
        return Route(parts, self.heading, self.speed, self.coordinated, self.lever)


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


_Kinds = (
    StaticTable
    | SwayTable
    | VehicleTable
    | TurntableTable
    | RotationTable
    | ShipTable
    | RouteTable
    | CentrifugeTable
)
AnyMotion = Annotated[_Kinds, Field(discriminator="kind"), BeforeValidator(as_table)]

#: kind -> table
MODELS: dict[str, type[MotionTable]] = {
    "static": StaticTable,
    "sway": SwayTable,
    "vehicle": VehicleTable,
    "turntable": TurntableTable,
    "rotation": RotationTable,
    "ship": ShipTable,
    "route": RouteTable,
    "centrifuge": CentrifugeTable,
}
KINDS = tuple(MODELS)

for _model in MODELS.values():
    _model.model_rebuild()
