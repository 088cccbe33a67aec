"""Noise terms of the channels of a record, as they were fitted to its deviations."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler._result import Result
from schuler.allan_variance.deviation import Allan
from schuler.allan_variance.theory import (
    NOISES,
    TERMS,
    unit_variances,
)
from schuler.errors import InputError
from schuler.sensors.by_axis import rms
from schuler.sensors.errors import AccelerometerSpec, GyroSpec, ImuSpec

__all__ = ["MOVED", "ChannelFit", "NoiseFit", "NoiseTerm"]

Array = NDArray[np.float64]


MOVED = 0.8
"""A larger misfit is motion and no noise."""

_GYRO = ("quantisation", "angle_random_walk", "bias_instability", "rate_random_walk", "rate_ramp")
_ACCEL = (
    "quantisation", "velocity_random_walk", "bias_instability", "acceleration_random_walk",
    "acceleration_ramp",
)  # fmt: skip
_GYRO_UNITS = ("arcsec", "deg/sqrt(h)", "deg/h", "deg/h/sqrt(h)", "deg/h/h")
_ACCEL_UNITS = ("mm/s", "ug/sqrt(Hz)", "ug", "ug/sqrt(h)", "ug/h")


@dataclass(frozen=True)
class NoiseTerm:
    """One noise parameter, SI.

    Parameters
    ----------
    value, sigma : float or None
        The coefficient and its standard deviation; None where it is not observable in the record.
    below : float
        The coefficient is under this with 95 % confidence.
    unit : str
        The customary unit.

    Examples
    --------
    >>> walk = noise_fit.channels["gyro_x"].terms["angle_random_walk"]
    >>> walk.unit
    'deg/sqrt(h)'
    """

    value: float | None
    sigma: float | None
    below: float
    unit: str


@dataclass(frozen=True, eq=False)
class ChannelFit:
    """The noise of one channel.

    Parameters
    ----------
    terms : dict of str to NoiseTerm
        By the names that `GyroSpec` and `AccelerometerSpec` have for them: Q, N, B, K in order;
        then ``rate_ramp`` or ``acceleration_ramp``, but for Hadamard deviation, which is blind to
        it.
    misfit : float
        Relative error of the variance that the terms leave, beyond chance; 0 where they
        meet the curve. It is in the sigmas.
    chi2, dof : float, int
        Of the final fit; with a misfit, chi2 is about dof by construction.

    Examples
    --------
    >>> channel = noise_fit.channels["gyro_x"]
    >>> list(channel.terms)[:2]
    ['quantisation', 'angle_random_walk']
    """

    terms: dict[str, NoiseTerm]
    misfit: float
    chi2: float
    dof: int

    def squares(self) -> Array:
        """Return the squared coefficients (5,), 0 for what is absent."""
        squares = np.zeros(len(TERMS))
        squares[: len(self.terms)] = [(t.value or 0.0) ** 2 for t in self.terms.values()]
        return squares


@dataclass(frozen=True, eq=False)
class NoiseFit(Result):
    """The noise of each channel of a record, and what it was found from."""

    source: Allan
    channels: dict[str, ChannelFit] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return deviations and fit with the keys of the JSON schema `schuler.allan/2`."""
        from schuler.allan_variance.output import to_dict

        return to_dict(self.source, self)

    def columns(self) -> dict[str, Any]:
        """Return averaging times, and deviation, bounds and fitted curve of each channel."""
        from schuler.allan_variance.output import columns

        return columns(self.source, self)

    def __str__(self) -> str:
        from schuler.allan_variance.output import fit_lines

        return "\n".join(fit_lines(self))

    def parts(self, channel: str, tau: Array) -> Array:
        """Return the fitted deviation of each term (k, 5) at averaging times (s)."""
        unit = unit_variances(self.source.kind, tau, self.source.duration)
        return np.asarray(np.sqrt(unit * self.channels[channel].squares()))

    def curve(self, channel: str, tau: Array) -> Array:
        """Return the fitted deviation (k,) at averaging times (s)."""
        return np.asarray(np.sqrt(np.sum(self.parts(channel, tau) ** 2, axis=1)))

    def export(
        self, tool: str, path: str | Path, *, inflate: float = 1.0, topic: str = "/imu0"
    ) -> None:
        """Write another tool's file of noise parameters; see `schuler.allan_variance.export`.

        Parameters
        ----------
        tool : {"kalibr", "openvins", "vins", "px4", "ros"}
        path : str or Path
        inflate : float
            What all densities are multiplied by.
        topic : str
            Of the IMU's messages, for tools that name it.

        Raises
        ------
        InputError
            For another tool, a factor that is not positive, a record in motion, or if the file
            cannot be written.
        """
        from schuler.allan_variance.export import export_noise

        export_noise(self, tool, path, inflate=inflate, topic=topic)

    def warnings(self) -> list[str]:
        """Return where the terms do not meet the curve, in a sentence."""
        out = []
        for moved in (False, True):
            off = [
                f"{c} ({100 * f.misfit:.0f} %)"
                for c, f in self.channels.items()
                if f.misfit > 0.0 and (f.misfit > MOVED) == moved
            ]
            if off and moved:
                out.append(
                    f"{', '.join(off)}: this is not the noise of an instrument at rest (the curve "
                    "is so far off any sum of the terms): take a stretch at rest with --start "
                    "and --stop, and trust no figure of these channels"
                )
            elif off:
                out.append(
                    f"{', '.join(off)}: no sum of the terms meets the curve better (in "
                    "parts of the variance), as when the instrument filters; the sigmas include it"
                )
        return out

    def to_spec(self, name: str = "static record", *, by_axis: bool = False) -> ImuSpec:
        """Return an instrument specification: each figure the rms over the fitted axes.

        Bias, scale factor and misalignment do not show in a static record's noise and stay 0:
        add at least the bias before predicting an alignment's accuracy.

        Parameters
        ----------
        name : str
        by_axis : bool
            Keep the figures of x, y and z beside their rms.

        Raises
        ------
        InputError
            If figures by axis are wanted of other than three gyros and three accelerometers.
        """
        parts: list[Any] = []
        for part, names, triad in (
            ("gyro", _GYRO, GyroSpec()), ("accel", _ACCEL, AccelerometerSpec()),
        ):  # fmt: skip
            fits = [f for c, f in self.channels.items() if c.startswith(part)]
            # A ramp is no noise, and an instrument that was warming up has another the next day.
            each = np.array([np.sqrt(f.squares()[:NOISES]) for f in fits]).reshape(-1, NOISES)
            if by_axis and len(each) != 3:
                raise InputError(
                    f"a specification by axis needs three channels of each triad, and there are "
                    f"{len(each)} of the {part}"
                )
            figures = dict(zip(names[:NOISES], each.T.tolist(), strict=True))
            if by_axis:
                parts.append(triad.with_axes(**figures))
                continue
            plain: dict[str, Any] = {k: rms(v) if v else 0.0 for k, v in figures.items()}
            parts.append(replace(triad, **plain))
        return ImuSpec(
            parts[0],
            parts[1],
            name=name,
            source=f"{self.source.kind} deviation of {self.source.name}, "
            f"{self.source.duration:.6g} s",
        )
