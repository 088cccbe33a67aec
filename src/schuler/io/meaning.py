"""What a file's numbers mean, settled once: kind, factors to SI, axes, clock; and said aloud."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from schuler.errors import InputError, shown
from schuler.io.axes import RFU, Axes, parse_axes
from schuler.io.clock import Clock
from schuler.io.content import Array, Block, Content
from schuler.io.mapping import Mapping
from schuler.record.check import Reading
from schuler.sensors.array import SensorArray
from schuler.sensors.named_arrays import load_array
from schuler.units import known_unit, parse_factor

__all__ = ["Meaning", "settle"]

#: fields that say what the numbers are, as against how the file is laid out
_ABOUT = (
    "columns", "gyro", "accel", "time", "mean_rates", "axes", "rate", "start_time",
    "coning_corrected", "sculling_corrected", "variables",
)  # fmt: skip


_CACHED = 8192
"""Rows that are converted together."""


@dataclass(frozen=True)
class Meaning:
    """How rows become SI values in body axes.

    Parameters
    ----------
    kind : str
        As for `schuler.record.Intake`.
    mapping : Mapping
        With every choice that was made filled in.
    gyro, accel : (3,) float64
        Factors to SI for the file's x, y, z.
    clock : Clock
        Makes seconds of stamps.
    axes : Axes
        From the file's axes to right, forward, up.
    words : str
        All this for a person to read, but for the clock.
    time_label : str
        What messages call the file's time.
    array : SensorArray or None
        The geometry of redundant gyros, fused here.
    assumed : list of str
        What was not given and was assumed, each in a few words.
    reading : Reading
        How the values were read, for a check of what they show.
    """

    kind: str
    mapping: Mapping
    gyro: Array
    accel: Array
    clock: Clock
    axes: Axes
    words: str
    time_label: str
    array: SensorArray | None = None
    assumed: list[str] = field(default_factory=list)
    reading: Reading = field(default_factory=Reading)

    @property
    def sentence(self) -> str:
        """All that is settled, for a person to read."""
        m = self.mapping
        if m.rate is not None:
            clock = f"time from the rate {m.rate:.9g} Hz, starting at {m.start_time or 0.0:.9g} s"
        else:
            clock = f"time from {self.time_label} in {self.clock.label}"
        return shown(f"{self.words}, {clock}")

    def convert(
        self, block: Block, done: int, clock: Clock | None = None,
        working: tuple[int, ...] | None = None,
    ) -> tuple[Array, Array, Array | None]:  # fmt: skip
        """Turn a block of a file into time, values (n, 6) and dt in SI and body axes.

        Parameters
        ----------
        block : Block
            As a reader gives it.
        done : int
            Rows before this block, for a clock made from the rate.
        clock : Clock, optional
            The clock of this pass over the file.
        working : tuple of int, optional
            The gyros of an array that are used; all, when not given.
        """
        clock = clock or self.clock
        time, values, dt = block
        columns = values.T if isinstance(values, np.ndarray) else values
        n = len(columns[0])
        out = np.empty((n, 6))
        # Rows that fit into the processor's cache: else each column would fetch all of them again.
        for a in range(0, n, _CACHED):
            part = slice(a, a + _CACHED)
            for j in range(3):
                k, s = self.axes.take[j], self.axes.sign[j]
                if self.array is None:
                    np.multiply(columns[k][part], s * self.gyro[k], out=out[part, j])
                np.multiply(columns[k - 3][part], s * self.accel[k], out=out[part, 3 + j])
        if self.array is not None:
            gyros = np.column_stack([np.asarray(c, np.float64) for c in columns[:-3]])
            interval = 0.0 if self.kind == "increments" else 1.0
            out[:, :3] = self.array.solve(self.gyro[0] * gyros, interval, working)
        if self.mapping.rate is not None:
            # Instantaneous rates begin at the start; what ends with a row ends one interval later.
            first = done if self.kind == "rates" else done + 1
            start = self.mapping.start_time or 0.0
            return start + np.arange(first, first + n) / self.mapping.rate, out, None
        if time is None:
            raise InputError("there is no time column: give the rate with --rate")
        seconds = clock.seconds(time)
        if dt is None or self.kind != "increments":
            return seconds, out, None
        return seconds, out, clock.interval(dt)

    def gyros(self, block: Block, time: Array) -> Array:
        """Return an array's gyros (n, m) as rates, rad/s.

        Parameters
        ----------
        block : Block
            As a reader gives it.
        time : (n,) float64
            Its times, s.
        """
        out = self.own_gyros(block)
        if self.kind == "increments" and len(time) > 1:
            out /= float(np.median(np.diff(time)))
        return out

    def own_gyros(self, block: Block) -> Array:
        """Return an array's gyros (n, m) as they came: rates, rad/s, or increments, rad."""
        values = block[1]
        columns = values.T if isinstance(values, np.ndarray) else values
        gyros = np.column_stack([np.asarray(c, np.float64) for c in columns[:-3]])
        return np.asarray(self.gyro[0] * gyros)


def settle(
    content: Content, given: Mapping, folder: Mapping, max_gap: float | None = None
) -> Meaning:
    """Settle what a file means: what is given wins over the file, the file over its folder.

    Parameters
    ----------
    content : Content
    given, folder : Mapping
    max_gap : float, optional
        Longest gap that may be bridged, s.

    Raises
    ------
    InputError
        If gyro and accelerometer units are of different kinds, or options contradict each other.
    """
    if content.complete:
        said = [key for key in _ABOUT if key in given.said()]
        if said:
            raise InputError(
                f"schuler wrote this file, and it says itself what it holds; drop '{said[0]}'"
            )
        folder = Mapping()
    m = folder.merged(content.said).merged(given)
    assumed = ""
    gyro, accel = m.gyro, m.accel
    if gyro is None and accel is None:
        gyro, accel, assumed = "rad/s", "m/s^2", " (assumed)"
    elif gyro is None:
        rate = parse_factor(str(accel), ("acceleration", "velocity"), "accel")[1] == "acceleration"
        gyro, assumed = ("rad/s" if rate else "rad"), " (gyro unit assumed)"
    elif accel is None:
        rate = parse_factor(gyro, ("angular rate", "angle"), "gyro")[1] == "angular rate"
        accel, assumed = ("m/s^2" if rate else "m/s"), " (accelerometer unit assumed)"
    assert gyro is not None
    assert accel is not None
    gyro_factor, gyro_kind = parse_factor(gyro, ("angular rate", "angle"), "gyro")
    accel_factor, accel_kind = parse_factor(accel, ("acceleration", "velocity"), "accel")
    if (gyro_kind == "angle") != (accel_kind == "velocity"):
        raise InputError(
            f"the gyro unit '{gyro}' is of {gyro_kind}, the accelerometer unit '{accel}' of "
            f"{accel_kind}: give both as rates (rad/s, m/s^2) or both as increments (rad, m/s)"
        )
    increments = gyro_kind == "angle"
    if increments and m.mean_rates:
        raise InputError(
            f"mean rates are asked for, but '{gyro}' and '{accel}' are increments; drop "
            "--mean-rates or give units of rates"
        )
    if m.start_time is not None and m.rate is None:
        raise InputError("a start time needs a rate; without one, time comes from the file")
    kind = "increments" if increments else ("mean-rates" if m.mean_rates else "rates")
    axes = parse_axes(m.axes) if m.axes else RFU
    array = None if m.array is None else load_array(m.array)
    if array is not None and kind == "increments" and np.any(array.bias):
        raise InputError(
            f"array '{array.name}' has known biases, which can be taken out of rates, not of "
            "increments, as a file is read; read it without them"
        )
    gyros, accels = np.full(3, gyro_factor), np.full(3, accel_factor)
    exact = content.factors is not None and content.said.gyro == gyro
    if content.factors is not None and content.said.gyro == gyro:
        gyros = content.factors[:3]
    if content.factors is not None and content.said.accel == accel:
        accels = content.factors[3:]
    units = f"{gyro} and {accel}"
    if exact and content.said.accel == accel and content.units_label:
        units = content.units_label
    words = {
        "rates": "instantaneous rates",
        "mean-rates": "rates averaged over each interval",
        "increments": "increments",
    }
    clock = Clock(m.time, max_gap, content.notes)
    if m.rate is not None or content.complete:
        clock.decided = True
    elif content.stamps is not None:
        clock.look(content.stamps)
    way = f"axes {axes.name}" + ("" if m.axes else " (assumed)")
    if array is not None:
        way += f", {len(array)} gyros fused as {array.name}"
    return Meaning(
        kind,
        replace(
            m,
            gyro=gyro,
            accel=accel,
            axes=axes.name,
            time=None if m.rate is not None else clock.unit,
            mean_rates=None if increments else bool(m.mean_rates),
        ),
        gyros,
        accels,
        clock,
        axes,
        f"{words[kind]} in {units}{assumed}, {way}",
        content.time_label,
        array,
        _assumed(content, m, assumed, gyro, accel),
        Reading(
            kind,
            gyro if _plain_unit(gyro) else None,
            accel if _plain_unit(accel) else None,
            fixed=content.fixed or content.complete,
            axes_said=m.axes is not None,
            units_said="(assumed)" not in assumed,
        ),
    )


def _plain_unit(text: str) -> bool:
    """Say whether a unit is a plain one, without a scale before it."""
    return not text[:1].isdigit() and known_unit(text)


def _assumed(content: Content, m: Mapping, units: str, gyro: str, accel: str) -> list[str]:
    """Return what was not given, each in a few words."""
    out = []
    if m.axes is None:
        mark = content.mark
        hint = "" if mark is None else (
            f", though the columns' names are {mark[1]}: with --axes {mark[0]} they are read so"
        )  # fmt: skip
        out.append(f"axes right-forward-up (RFU){hint}")
    if "(assumed)" in units:
        out.append(f"units {gyro} and {accel}")
    elif units:
        out.append(f"gyro unit {gyro}" if "gyro" in units else f"accelerometer unit {accel}")
    return out
