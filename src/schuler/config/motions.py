"""The motions of a scenario file, one model a kind, each of which makes its motion."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from schuler.config.machine_motions import CentrifugeTable, RotationTable, TurntableTable
from schuler.config.motion_table import ORIGIN, MotionTable, Strict
from schuler.config.quantities import (
    Band2,
    Count,
    Degrees,
    Metres,
    MetresTriple,
    Number,
    Positive,
    PositiveTime,
    Share,
    Speed,
    Triple,
    as_table,
)
from schuler.motion import (
    Band,
    Crew,
    DisturbedVehicle,
    Hull,
    Lines,
    Manoeuvre,
    Motion,
    Route,
    Sea,
    Static,
    Sway,
    moored_ship,
)

__all__ = ["KINDS", "MODELS", "AnyMotion"]

Channel = Literal["heading", "pitch", "roll", "east", "north", "up"]


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


class SeaTable(Strict):
    """A sea state."""

    height: Annotated[Metres, Field(ge=0)]
    period: PositiveTime
    gamma: Annotated[Number, Field(ge=1)] = 1.0


class HullTable(Strict):
    """How the hull responds."""

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
    # What adds to a motion, or is on board, is any of these.
    _model.model_rebuild(_types_namespace={"AnyMotion": AnyMotion})
