"""Low-pass filters that start as if they had always run.

A causal filter that begins at zero spends its first time constants rising to gravity. It begins
instead with what gravity alone would have made of the force before the record: a straight line
whose integral fits the velocity of the first minutes, continued backwards. In the inertial frame
gravity is such a line over minutes, and the vehicle's bounded velocity drops out of the fit; no
latitude is needed. The mean of a second would hold the vehicle's motion itself, and a transient of
twenty seconds of it. The zero-phase form runs both ways and does not delay.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError
from schuler.prefilter.base import Prefilter, check_channels, each_channel, even_interval
from schuler.record import ImuRecord

__all__ = ["LowPass", "LowPassStream"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LowPass(Prefilter):
    """A Butterworth or FIR low-pass.

    Parameters
    ----------
    cutoff : float
        Hz; 0.05 in the document.
    order : int
        Of the Butterworth filter; for "fir" the number of taps is chosen for a transition band
        as wide as the cut-off.
    kind : {"butterworth", "fir"}
    zero_phase : bool
        Run forward and backward: no delay, twice the attenuation, not causal.
    start_span : float
        The line of so much of the record (s) is what the filter starts from; in the inertial frame
        gravity is a line over minutes. Of less than a third of the filter's memory it is the mean.
    channels : {"accel", "gyro", "both"}
    frame : {"inertial", "body"}
        Where the force is filtered (`each_channel`).

    Examples
    --------
    >>> slow = sc.LowPass(cutoff=0.1, zero_phase=True)
    >>> sc.align(record, site, sc.Inertial("wahba", prefilter=slow), spec).consistent
    True
    """

    cutoff: float = field(default=0.05, metadata={"unit": "frequency"})
    order: int = 2
    kind: str = "butterworth"
    zero_phase: bool = False
    start_span: float = field(default=300.0, metadata={"unit": "time"})
    channels: str = "accel"
    frame: str = "inertial"

    def __post_init__(self) -> None:
        if self.kind not in ("butterworth", "fir"):
            raise InputError(f"kind must be butterworth or fir, got '{self.kind}'")
        check_channels(self.channels, self.frame)
        if not (self.cutoff > 0 and self.order >= 1 and self.start_span > 0):
            raise InputError("cutoff, order and start_span must be positive")

    def sections(self, interval: float) -> Array:
        """Return the filter as second-order sections (k, 6) for a sampling interval, s.

        Raises
        ------
        InputError
            If the cut-off is not below half the sampling rate.

        Examples
        --------
        >>> sc.LowPass(1.0).sections(0.05).shape[1]
        6
        """
        from scipy import signal

        rate = 1.0 / interval
        if not self.cutoff < 0.5 * rate:
            raise InputError(
                f"the cut-off ({self.cutoff:g} Hz) must be below half the sampling rate "
                f"({0.5 * rate:g} Hz)"
            )
        return np.asarray(signal.butter(self.order, self.cutoff, fs=rate, output="sos"))

    def taps(self, interval: float) -> Array:
        """Return the taps (k,) of the FIR filter for a sampling interval, s.

        Examples
        --------
        >>> len(sc.LowPass(1.0).taps(0.05)) % 2
        1
        """
        from scipy import signal

        count = 2 * round(1.65 / (self.cutoff * interval)) + 1
        return np.asarray(signal.firwin(count, self.cutoff, fs=1.0 / interval))

    def __call__(self, record: ImuRecord) -> ImuRecord:
        """Return the filtered record.

        Raises
        ------
        InputError
            For a record that is short or unevenly sampled, or a cut-off beyond it.
        """
        from scipy import signal

        interval = even_interval(record)
        span = min(len(record), max(2, round(self.start_span / interval)))
        # The straight line through the first (or last) samples, continued by so many before them.
        ahead = self.memory(interval)
        if self.kind == "fir":
            taps = self.taps(interval)
            half = len(taps) // 2

            def run(x: Array) -> Array:
                if self.zero_phase:
                    before, after = _line(x[:span], half), _line(x[::-1][:span], half)[::-1]
                    padded = np.concatenate([before, x, after])
                else:
                    padded = np.concatenate([_line(x[:span], len(taps) - 1), x])
                return np.asarray(signal.fftconvolve(padded, taps, "valid"))

        else:
            sos = self.sections(interval)
            state = signal.sosfilt_zi(sos)

            def forward(x: Array) -> Array:
                padded = np.concatenate([_line(x[:span], ahead), x])
                return np.asarray(signal.sosfilt(sos, padded, zi=state * padded[0])[0][ahead:])

            def run(x: Array) -> Array:
                y = forward(x)
                return forward(y[::-1])[::-1] if self.zero_phase else y

        return each_channel(record, self.channels, self.frame, run)

    def memory(self, interval: float) -> int:
        """Return the samples after which the filter has forgotten its start.

        Examples
        --------
        >>> sc.LowPass(1.0).memory(0.05) > 0
        True
        """
        return int(3.0 / (self.cutoff * interval)) + 1

    @property
    def streams(self) -> bool:
        """Whether the filter can take a record in chunks."""
        return not self.zero_phase and self.kind == "butterworth" and self.frame == "body"

    def stream(self) -> LowPassStream:
        """Return a filter that takes chunks; its samples do not depend on the chunking.

        Raises
        ------
        InputError
            If the filter needs the whole record.

        Examples
        --------
        >>> stream = sc.LowPass(1.0, frame="body").stream()
        >>> type(stream).__name__
        'LowPassStream'
        """
        if not self.streams:
            raise InputError(
                "only the causal Butterworth filter in the body's frame can run on a stream"
            )
        return LowPassStream(self)


def _line(x: Array, ahead: int) -> Array:
    """Return the straight line through samples, continued by so many before the first, (ahead,).

    It is the line whose integral fits that of the samples best, with an unknown offset: a vehicle
    that stays where it is has a bounded velocity, so that its motion averages out of the line
    faster than out of one that is fitted to the force.
    """
    n = len(x)
    # From much less than is continued by, a slope would be noise.
    if 3 * n < ahead:
        return np.full(ahead, x.mean())
    mean = float(x.mean())
    integral = np.concatenate([[0.0], np.cumsum(x - mean)])
    t = np.linspace(-1.0, 1.0, n + 1)
    _, first, second = np.polynomial.polynomial.polyfit(t, integral, 2)
    before = 2.0 * (np.arange(-ahead, 0) + 0.5) / n - 1.0
    return np.asarray(mean + (first + 2.0 * second * before) * 2.0 / n)


class LowPassStream:
    """A causal low-pass fed chunk by chunk.

    It starts from the line through the first `start_span` seconds, and gives nothing back before
    it has them; `close` gives what is still held.
    """

    def __init__(self, design: LowPass) -> None:
        self._design = design
        self._held: list[ImuRecord] = []
        self._sos: Array | None = None
        self._state: Array | None = None
        self._last: ImuRecord | None = None

    def copy(self) -> LowPassStream:
        """Return a stream that continues by itself from here."""
        other = copy(self)
        other._held = list(self._held)
        return other

    def push(self, chunk: ImuRecord) -> ImuRecord:
        """Take a chunk and return the filtered samples that are ready (possibly none)."""
        self._last = chunk
        if self._state is not None:
            return self._run(chunk)
        if len(chunk):
            self._held.append(chunk)
        if not self._held:
            return chunk
        interval = float(self._held[0].dt[0])
        wanted = max(1, round(self._design.start_span / interval))
        if sum(len(x) for x in self._held) < wanted:
            return chunk.rows(0, 0)
        return self._open(wanted, interval)

    def close(self) -> ImuRecord:
        """Return what is still held: all of a stream that is shorter than `start_span`, or none.

        Raises
        ------
        InputError
            If nothing came.
        """
        if self._state is not None and self._last is not None:
            return self._last.rows(0, 0)
        if not self._held:
            raise InputError("a prefilter needs 16 samples at least, the record has 0")
        held = sum(len(x) for x in self._held)
        return self._open(held, float(self._held[0].dt[0]))

    def _open(self, wanted: int, interval: float) -> ImuRecord:
        from scipy import signal

        record = ImuRecord.concatenate(self._held)
        self._held = []
        self._sos = self._design.sections(interval)
        first = np.hstack([record.gyro[:wanted], record.accel[:wanted]])
        before = np.column_stack([_line(x, self._design.memory(interval)) for x in first.T])
        state = signal.sosfilt_zi(self._sos)[:, :, None] * before[0]
        _, self._state = signal.sosfilt(self._sos, before, axis=0, zi=state)
        return self._run(record)

    def _run(self, chunk: ImuRecord) -> ImuRecord:
        from scipy import signal

        if not len(chunk):
            return chunk
        rates = np.hstack([chunk.gyro, chunk.accel])
        out, self._state = signal.sosfilt(self._sos, rates, axis=0, zi=self._state)
        n = chunk.dtheta.shape[1]
        dt = chunk.dt[:, None]
        gyro = out[:, :n] * dt if self._design.channels != "accel" else chunk.dtheta
        accel = out[:, n:] * dt if self._design.channels != "gyro" else chunk.dvel
        return replace(chunk, dtheta=gyro, dvel=accel)
