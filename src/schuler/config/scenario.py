"""`Scenario`: site, motion, instrument and seed as a value that makes records."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from schuler.earth import Site
from schuler.motion import Motion
from schuler.sensors import ImuSpec

if TYPE_CHECKING:
    from schuler.config.motion_table import MotionTable
    from schuler.simulation import Simulation

__all__ = ["Scenario"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scenario:
    """What is simulated: made by `load_scenario` or `parse_scenario`.

    Parameters
    ----------
    name : str
    site : Site
    duration, rate : float
        s and Hz.
    seed : int
    spec : ImuSpec or None
        The instrument; None is one without errors.
    gyro_bias, accel_bias : (3,) float64 or None
        Biases that are fixed and not drawn, rad/s and m/s^2.
    temperature_rate : float
        K/s.
    methods : tuple of str
        Alignment methods of a campaign.
    at : {"end", "start"}
        The instant of the attitude in a campaign.
    align_spec : ImuSpec or None
        The instrument that an alignment assumes.
    data : mapping
        The checked file as plain values, with overrides and the instrument's file worked in:
        `parse_scenario(data)` gives the same scenario anywhere.
    table : MotionTable
        The checked motion.
    folder : Path
        Beside which the files of instruments are looked for.
    files : tuple of Path
        The files that it was read from: its own, and those of instruments.

    Examples
    --------
    >>> scene = sc.load_scenario("truck.toml")
    >>> scene.kind, scene.samples
    ('vehicle', 1200)
    """

    name: str
    site: Site
    duration: float
    rate: float
    seed: int
    spec: ImuSpec | None
    gyro_bias: Array | None
    accel_bias: Array | None
    temperature_rate: float
    methods: tuple[str, ...]
    at: str
    align_spec: ImuSpec | None
    data: Mapping[str, Any] = field(repr=False)
    table: MotionTable = field(repr=False)
    folder: Path = field(default=Path(), repr=False)
    files: tuple[Path, ...] = field(default=(), repr=False, compare=False)

    @property
    def samples(self) -> int:
        """Samples of a record."""
        return round(self.duration * self.rate)

    @property
    def kind(self) -> str:
        """Kind of the motion."""
        return str(self.data["motion"]["kind"])

    def to_json(self) -> str:
        """Return the scenario as one line of JSON, its keys in order."""
        return json.dumps(self.data, sort_keys=True, ensure_ascii=False, allow_nan=False)

    @property
    def digest(self) -> str:
        """SHA-256 of `to_json`."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()

    def sequence(self, run: int | None = None) -> np.random.SeedSequence:
        """Return the seed of the scenario, or that of one of its campaign's runs."""
        return np.random.SeedSequence(self.seed, spawn_key=() if run is None else (run,))

    def build(self, seed: int | np.random.SeedSequence | None = None) -> tuple[Motion, Site]:
        """Draw the motion.

        Parameters
        ----------
        seed : int or SeedSequence, optional
            The scenario's own when not given.

        Returns
        -------
        Motion, Site
        """
        motion, _ = self._generators(seed)
        return self.table.make(motion, self.duration), self.site

    def run(self, seed: int | np.random.SeedSequence | None = None) -> Simulation:
        """Simulate one record with its truth.

        Parameters
        ----------
        seed : int or SeedSequence, optional
            The scenario's own when not given. Motion and instrument draw from streams of their
            own, so that another instrument rides through the same motion.

        Raises
        ------
        InputError
            If motion and record do not go together.
        """
        from schuler.simulation import simulate

        motion, instrument = self._generators(seed)
        return simulate(
            self.table.make(motion, self.duration), self.site, self.duration, self.rate,
            self.spec, instrument, gyro_bias=self.gyro_bias, accel_bias=self.accel_bias,
            temperature_rate=self.temperature_rate, name=self.name,
        )  # fmt: skip

    def _generators(
        self, seed: int | np.random.SeedSequence | None
    ) -> tuple[np.random.Generator, np.random.Generator]:
        if seed is None:
            seed = self.sequence()
        elif not isinstance(seed, np.random.SeedSequence):
            seed = np.random.SeedSequence(seed)
        # Children by name and not by `spawn`, which would count up at every call.
        motion, instrument = (
            np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, 2**31 + k))
            for k in range(2)
        )
        return (
            np.random.Generator(np.random.SFC64(motion)),
            np.random.Generator(np.random.SFC64(instrument)),
        )
