"""Random errors of an instrument, drawn from its specification onto true increments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.record import ImuRecord
from schuler.sensors.draw import Imperfections
from schuler.sensors.errors import AccelerometerSpec, GyroSpec, ImuSpec

__all__ = ["Drawn", "Instrument", "NoiseTrain", "corrupt", "drop_out"]

Array = NDArray[np.float64]

_PER_DECADE = 2
"""Gauss-Markov processes to a decade that make 1/f noise: its ripple is then under 2 %."""

_FASTEST = 3.0
"""Correlation time of the fastest of them, samples: what is faster is buried in white noise."""

_SMOOTH = 6
"""A process is drawn so many times in its correlation time at least, and is straight between."""

_EVERY = (64, 16, 4, 1)
"""Samples from draw to draw; processes that share it are summed before they are spread out."""


class _Normal:
    """A stream of normal numbers of its own, started from a generator."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._stream = rng.integers(0, 2**64, 2, dtype=np.uint64)
        self._stream[1] |= np.uint64(1)

    def __call__(self, *shape: int) -> Array:
        from schuler.kernels.normal import standard_normal

        out = np.empty(int(np.prod(shape)))
        # Uncompiled, the wrap-around of its integers would be warned of.
        with np.errstate(over="ignore"):
            standard_normal(self._stream, out)
        return out.reshape(shape)


class _Processes:
    """Gauss-Markov processes and random walks on m axes that are drawn equally often."""

    def __init__(
        self, every: int, step: float, axes: int, rng: np.random.Generator, ratios: Array | None
    ) -> None:
        self.every, self.step, self.normal = every, step, _Normal(rng)
        self.ratios = ratios
        self.rho: list[float] = []
        self.kick: list[float] = []
        self.state = np.zeros((0, axes))
        self.line = np.zeros((axes, 2))
        self.place = np.zeros(1, np.int64)

    def include(self, sigma: float, tau: float) -> None:
        """Include a process of standard deviation sigma, or for tau = inf a random walk."""
        span = self.every * self.step
        first = np.zeros(self.state.shape[1])
        if np.isinf(tau):
            self.rho.append(1.0)
            self.kick.append(sigma * float(np.sqrt(span)))
        else:
            self.rho.append(float(np.exp(-span / tau)))
            self.kick.append(sigma * float(np.sqrt(-np.expm1(-2.0 * span / tau))))
            first = sigma * self.normal(len(first))
        self.state = np.vstack([self.state, first])
        self.line[:, 1] += first

    def add(self, out: Array) -> None:
        """Add the next increments to `out` (n, axes)."""
        from schuler.kernels.noise import gauss_markov

        n, axes = out.shape
        noise = out if self.ratios is None else np.zeros_like(out)
        left = (self.every - int(self.place[0])) % self.every
        draws = 0 if n <= left else (n - left + self.every - 1) // self.every
        gauss_markov(
            self.every, np.array(self.rho), np.array(self.kick), self.step, self.place,
            self.state, self.line, self.normal(draws, len(self.rho), axes), noise,
        )  # fmt: skip
        if self.ratios is not None:
            out += self.ratios * noise


class NoiseTrain:
    """The noise of one triad, in increments, chunk by chunk; any chunking gives the same.

    Parameters
    ----------
    part : GyroSpec or AccelerometerSpec
        Angle or velocity random walk, bias instability, rate random walk and Gauss-Markov noise
        are made; rounding is the instrument's.
    step : float
        Sampling interval, s.
    axes : int
    rng : numpy.random.Generator
    longest : float
        Length of the record, s: 1/f noise is made of processes up to a hundred times longer.

    Raises
    ------
    InputError
        If the specification is by axis, of three, and there are not three axes.
    """

    def __init__(
        self,
        part: GyroSpec | AccelerometerSpec,
        step: float,
        axes: int,
        rng: np.random.Generator,
        longest: float,
    ) -> None:
        self._white: float | Array = part.by_axis(part.WHITE) * float(np.sqrt(step))
        ratios = {name: np.array(each) for name, each in part.ratios}
        if ratios and axes != 3:
            raise InputError(
                f"the specification has figures of three axes, and there are {axes} sensors: give "
                "one value of each"
            )
        self._normal = _Normal(rng)
        wanted: list[tuple[float, float, str]] = []
        if part.bias_instability:
            sigma = part.bias_instability * float(np.sqrt(np.log(10.0) / _PER_DECADE / np.pi))
            # What forgets within a sample is white to the record.
            below = 1.0 - 10.0 ** (-1.0 / _PER_DECADE)
            first = _FASTEST * step
            fast = 2.0 * sigma**2 * first * 10.0 ** (-1.0 / _PER_DECADE) / below
            share = ratios.get("bias_instability", 1.0)
            self._white = np.hypot(self._white, share * np.sqrt(fast * step))
            low, high = np.log10(first), np.log10(100.0 * max(longest, 10.0 * step))
            times = 10.0 ** np.arange(low, high, 1.0 / _PER_DECADE)
            wanted += [(sigma, float(t), "bias_instability") for t in times]
        if part.gauss_markov:
            wanted.append((part.gauss_markov, part.gauss_markov_time, "gauss_markov"))
        if part.drift:
            wanted.append((part.drift, float("inf"), part.DRIFT))
        self._processes: dict[tuple[int, str], _Processes] = {}
        for sigma, tau, name in wanted:
            often = 4 if np.isinf(tau) else int(min(tau / step / _SMOOTH, _EVERY[0]))
            every = next(e for e in _EVERY if e <= max(often, 1))
            # Processes with the same ratios from axis to axis are summed before they are spread.
            key = every, name if name in ratios else ""
            group = self._processes.setdefault(
                key, _Processes(every, step, axes, rng, ratios.get(name))
            )
            group.include(sigma, tau)

    def make(self, out: Array) -> None:
        """Fill `out` (n, axes) with the next noise increments."""
        if np.any(self._white):
            np.multiply(self._white, self._normal(*out.shape), out=out)
        else:
            out[:] = 0.0
        for process in self._processes.values():
            process.add(out)


class Instrument:
    """A gyro and an accelerometer triad that turn true increments into what they say.

    Parameters
    ----------
    spec : ImuSpec or None
        Noise; None is none.
    gyro, accelerometer : Imperfections
        Constant errors.
    step : float
        Sampling interval, s.
    rng : numpy.random.Generator or None
    temperature_rate : float
        Warming, K/s.
    """

    def __init__(
        self,
        spec: ImuSpec | None,
        gyro: Imperfections,
        accelerometer: Imperfections,
        step: float,
        rng: np.random.Generator | None,
        temperature_rate: float = 0.0,
    ) -> None:
        from schuler.kernels import noise

        self._measure: Callable[..., None] = noise.measure
        self._state = np.zeros(noise.STATE_SIZE)
        self._spec, self._rng, self._step = spec, rng, step
        self._warm = temperature_rate
        both = (gyro, accelerometer)
        self._constant = [
            np.concatenate([b.bias for b in both]),
            np.concatenate([b.matrix for b in both]),
            np.concatenate([b.asymmetry for b in both]),
            np.ascontiguousarray(gyro.g_sensitivity),
            np.concatenate([b.g2_sensitivity for b in both]),
            np.concatenate([b.temperature for b in both]),
        ]
        self._most, self._grain = np.zeros(6), np.zeros(6)
        if spec is not None:
            parts = (spec.gyro, spec.accelerometer)
            self._most[:] = np.repeat([p.full_scale for p in parts], 3)
            steps = [np.full(3, p.by_axis("quantisation")) for p in parts]
            self._grain[:] = np.sqrt(12.0) * np.concatenate(steps)
            if rng is not None:
                # The rounding's phase: where in its step each sum begins.
                self._state[:6] = self._grain * rng.uniform(0.0, 1.0, 6)

    def corrupt(self, dtheta: Array, dvel: Array, chunk: int = 4096) -> None:
        """Replace true angle and velocity increments (n, 3) by what is measured."""
        n = len(dtheta)
        noise = np.zeros((2, min(chunk, n), 3))
        trains: list[NoiseTrain] = []
        if self._spec is not None and self._rng is not None:
            trains = [
                NoiseTrain(part, self._step, 3, self._rng, n * self._step)
                for part in (self._spec.gyro, self._spec.accelerometer)
            ]
        bias, matrix, asymmetry, g1, g2, heat = self._constant
        for a in range(0, n, chunk):
            b = min(a + chunk, n)
            for train, out in zip(trains, noise, strict=False):
                train.make(out[: b - a])
            self._measure(
                self._state, self._step, self._warm, bias, matrix, asymmetry, g1, g2, heat,
                self._most, self._grain, noise[0, : b - a], noise[1, : b - a],
                dtheta[a:b], dvel[a:b],
            )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Drawn:
    """Increments with errors, and the constant bias (SI, per axis) that is in them."""

    increments: Array
    bias: Array


def corrupt(
    increments: Array,
    dt: Array,
    part: GyroSpec | AccelerometerSpec,
    rng: np.random.Generator,
    bias: ArrayLike | None = None,
) -> Drawn:
    """Add bias, noise and rounding to increments of any number of axes, evenly sampled.

    Parameters
    ----------
    increments : (n, m) float64
        rad or m/s.
    dt : (n,) float64
        s, even.
    part : GyroSpec or AccelerometerSpec
        1-sigma figures per axis.
    rng : numpy.random.Generator
    bias : (m,) array_like, optional
        A fixed bias; drawn from the specification when not given.

    Raises
    ------
    InputError
        If the bias has the wrong shape, or the sampling is uneven.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> drawn = corrupt(np.zeros((100, 3)), np.full(100, 0.01), spec.gyro, rng)
    >>> drawn.increments.shape
    (100, 3)
    """
    n, m = increments.shape
    if bias is None:
        constant = np.multiply(part.by_axis("bias"), rng.standard_normal(m))
    else:
        constant = np.asarray(bias, np.float64)
        if constant.shape != (m,):
            raise InputError(f"expected a bias of shape ({m},), got {constant.shape}")
    step = float(dt.mean())
    if float(np.ptp(dt)) > 1e-6 * step:
        raise InputError("noise can only be made for an even sampling interval")
    noise = np.empty((n, m))
    NoiseTrain(part, step, m, rng, n * step).make(noise)
    out: Array = increments + constant * step + noise
    if part.quantisation:
        grain = part.by_axis("quantisation") * np.sqrt(12.0)
        total = np.cumsum(out, axis=0) + grain * rng.uniform(0, 1, m)
        out = np.diff(np.floor(total / grain), axis=0, prepend=0.0) * grain
    return Drawn(out, constant)


def drop_out(record: ImuRecord, share: float, rng: np.random.Generator) -> ImuRecord:
    """Return a record in which samples are lost at random, each gap bridged by the next sample.

    A bridging sample covers the gap with its own mean rate, as a reader would do it.

    Parameters
    ----------
    record : ImuRecord
    share : float
        Probability that a sample is lost; the first and the last stay.
    rng : numpy.random.Generator
    """
    keep = rng.uniform(0.0, 1.0, len(record)) >= share
    keep[[0, -1]] = True
    rows = np.flatnonzero(keep)
    dt = np.diff(record.time[rows], prepend=record.start)
    longer = (dt / record.dt[rows])[:, None]
    return replace(
        record,
        time=record.time[rows],
        dt=dt,
        dtheta=record.dtheta[rows] * longer,
        dvel=record.dvel[rows] * longer,
    )
