"""The whole of a scenario file as a pydantic model."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from schuler.alignment.methods import parse_method
from schuler.config.motion_table import Strict
from schuler.config.motions import AnyMotion
from schuler.config.quantities import (
    Acceleration,
    AngularRate,
    Count,
    Degrees,
    Metres,
    PositiveTime,
    RateHz,
    TemperatureRate,
    as_table,
)
from schuler.errors import InputError
from schuler.prefilter import parse_prefilter

__all__ = ["MOST_SAMPLES", "ScenarioFile", "known_keys"]

MOST_SAMPLES = 50_000_000
"""More do not fit into the memory of a usual machine: a slip of the unit."""


def _three(value: Any) -> Any:
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise ValueError("expected three values, one for each axis x, y, z")
    return tuple(value)


def _methods(value: Any) -> Any:
    """Return the texts of one method or of several, each a text or a table."""
    given = value if isinstance(value, list | tuple) else [value]
    if not given or not all(isinstance(each, str | dict) for each in given):
        raise ValueError("expected a method or a list of methods, each a name or a table")
    try:
        names = [str(parse_method(each)) for each in given]
    except InputError as error:
        raise ValueError(str(error)) from None
    if len(set(names)) != len(names):
        raise ValueError("a method is named twice")
    return tuple(names)


def _prefilter(value: Any) -> Any:
    """Return the text of a prefilter or of a chain of them."""
    try:
        found = parse_prefilter(value)
    except InputError as error:
        raise ValueError(str(error)) from None
    return None if found is None else str(found)


class SiteTable(Strict):
    """Where."""

    lat: Annotated[Degrees, Field(ge=-90, le=90)]
    lon: Annotated[Degrees, Field(ge=-180, le=360)] = 0.0
    height: Annotated[Metres, Field(ge=-12000, le=100000)] = 0.0
    # The simulated gravity is that of the formula.
    gravity_sigma: Annotated[float, Field(ge=0, le=1000)] = 0.0
    deflection_sigma: Annotated[float, Field(ge=0, le=120)] = 0.0


class BiasesTable(Strict):
    """Biases that are fixed and not drawn."""

    gyro: (
        Annotated[tuple[AngularRate, AngularRate, AngularRate], BeforeValidator(_three)] | None
    ) = None
    accelerometer: (
        Annotated[tuple[Acceleration, Acceleration, Acceleration], BeforeValidator(_three)] | None
    ) = None


class AlignTable(Strict):
    """What a campaign does with each record."""

    method: Annotated[tuple[str, ...], BeforeValidator(_methods)] = ("centred",)
    prefilter: Annotated[str | None, BeforeValidator(_prefilter)] = None
    at: Literal["end", "start"] = "end"
    spec: Any = None

    @property
    def methods(self) -> tuple[str, ...]:
        """The methods with the prefilter of all."""
        if self.prefilter is None:
            return self.method
        chain = parse_prefilter(self.prefilter)
        return tuple(str(parse_method(name).with_prefilter(chain)) for name in self.method)


class ScenarioFile(Strict):
    """A scenario file; instruments are checked apart, by the module that knows them."""

    name: str | None = None
    about: str = ""
    duration: PositiveTime
    rate: RateHz
    seed: Count = 0
    temperature_rate: TemperatureRate = 0.0
    site: Annotated[SiteTable, BeforeValidator(as_table)]
    motion: AnyMotion
    instrument: Any = None
    biases: Annotated[BiasesTable, BeforeValidator(as_table)] = Field(default_factory=BiasesTable)
    align: Annotated[AlignTable, BeforeValidator(as_table)] = Field(default_factory=AlignTable)

    @model_validator(mode="after")
    def _some_samples(self) -> ScenarioFile:
        samples = self.duration * self.rate
        if not 1 <= round(samples) <= MOST_SAMPLES:
            raise ValueError(
                f"duration and rate make {samples:.3g} samples, expected 1 to {MOST_SAMPLES}"
            )
        return self


def known_keys(loc: tuple[int | str, ...]) -> list[str]:
    """Return the keys that a table has, by pydantic's place of it (with kinds in the place)."""
    from schuler.config.motions import MODELS

    model: Any = ScenarioFile
    for part in loc:
        if isinstance(part, int):
            continue
        if part in MODELS:
            model = MODELS[part]
            continue
        fields = {f.alias or name: f for name, f in model.model_fields.items()}
        model = _table_of(fields[part].annotation) or model if part in fields else model
    return [f.alias or name for name, f in model.model_fields.items()]


def _table_of(annotation: Any) -> Any:
    """Return the model inside an annotation such as ``list[Step]`` or ``Crew | None``."""
    if isinstance(annotation, type) and issubclass(annotation, Strict):
        return annotation
    for inner in getattr(annotation, "__args__", ()):
        if found := _table_of(inner):
            return found
    return None
