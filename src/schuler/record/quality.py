"""What rows showed as they were checked: missing ones, spikes, gaps, jitter, saturation, holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.states import IntakeState
from schuler.record.spikes import Spike, spikes_warning
from schuler.units import time_text

__all__ = ["CHANNELS", "Quality"]

_TIMES = {2: "twice", 3: "three times", 4: "four times", 5: "five times", 6: "six times",
          7: "seven times", 8: "eight times", 9: "nine times", 10: "ten times"}  # fmt: skip

_LEAST_RUNS = 20
"""Runs of equal values that show a hold."""

_FEW_LOST = 1e-3
"""Share of the rows whose loss costs nothing."""

_LONG_GAP = 8.5
"""Nominal intervals that are filled by interpolation of the values."""

_JITTER = 0.05
"""Of the time stamps (rms), over the nominal interval, from which on it is said."""

CHANNELS = ("gyro x", "gyro y", "gyro z", "accel x", "accel y", "accel z")


@dataclass(frozen=True)
class Quality:
    """Counts and extremes of the rows that went through an `Intake`.

    All times in s, rates in Hz, values in SI as they came (rates or increments).
    """

    rows: int
    valid_rows: int
    nominal_dt: float
    jitter_rms: float
    shortest_dt: float
    longest_dt: float
    not_finite: int
    first_not_finite: str
    repeated: int
    gaps: int
    longest_gap: float
    first_gap_time: float
    saturated: tuple[str, ...]
    stuck: tuple[str, ...]
    mean: tuple[float, ...]
    std: tuple[float, ...]
    mean_norm_gyro: float
    mean_norm_accel: float
    spikes: tuple[Spike, ...] = ()
    interpolated: int = 0
    hold_gyro: float = 1.0
    hold_accel: float = 1.0

    @classmethod
    def from_state(
        cls,
        state: IntakeState,
        nominal: float,
        kind: str,
        spikes: tuple[Spike, ...] = (),
    ) -> Quality:
        """Read an intake kernel's state (`schuler.kernels.intake`)."""
        s = state
        n = int(s.integrated)
        safe = max(n, 1)
        mean = s.sum_values / safe
        std = np.sqrt(np.maximum(s.sum_values2 / safe - mean**2, 0.0))
        regular = int(s.regular)
        jitter = 0.0
        if regular > 1:
            m = float(s.sum_dt) / regular
            jitter = float(np.sqrt(max(float(s.sum_dt2) / regular - m * m, 0.0)))
            # Rounded time stamps of a perfect clock differ by a few ulps: no jitter.
            jitter = 0.0 if jitter < 1e-7 * m else jitter
        saturated, stuck = [], []
        holds = _hold(s.holds[0], n), _hold(s.holds[1], n)
        for j, label in enumerate(CHANNELS):
            if n >= 10 and s.longest_run[j] >= n:
                stuck.append(f"{label} is {mean[j]:.6g} in every row")
            elif (
                s.run_at_largest[j] >= 5 * holds[j // 3]
                and s.largest[j] > abs(mean[j]) + 2.0 * std[j]
                and s.rows_at_largest[j] >= 5
            ):
                stuck_rows = int(s.rows_at_largest[j])
                saturated.append(
                    f"{label} stays at its extreme {s.largest[j]:.6g} for "
                    f"{int(s.run_at_largest[j])} rows running ({stuck_rows} rows in all)"
                )
        where = ""
        if s.not_finite > 0:
            when, channel = _instant(float(s.bad_time)), CHANNELS[int(s.bad_channel)]
            where = f"data row {int(s.bad_row)} (t = {when} s), {channel}"
        return cls(
            rows=int(s.rows),
            valid_rows=n,
            nominal_dt=nominal,
            jitter_rms=jitter,
            shortest_dt=float(s.shortest_dt),
            longest_dt=float(s.longest_dt),
            not_finite=int(s.not_finite),
            first_not_finite=where,
            repeated=int(s.repeated),
            gaps=int(s.gaps),
            longest_gap=float(s.longest_gap),
            first_gap_time=float(s.first_gap_time),
            saturated=tuple(saturated),
            stuck=tuple(stuck),
            mean=tuple(float(v) for v in mean),
            std=tuple(float(v) for v in std),
            mean_norm_gyro=float(s.sum_norms[0]) / safe,
            mean_norm_accel=float(s.sum_norms[1]) / safe,
            spikes=spikes,
            interpolated=int(s.interpolated),
            hold_gyro=holds[0],
            hold_accel=holds[1],
        )

    @property
    def sampling_faults(self) -> bool:
        """Whether what was made of the rows has errors that no specification of a sensor holds.

        So it is where more than one row in a thousand was lost or replaced, or more than a few at
        once; where values are held or cut off; and where the times of the samples are unsure.
        """
        missing = self.gaps + len(self.spikes) + self.not_finite
        return bool(
            missing > _FEW_LOST * self.rows
            or self.longest_gap > _LONG_GAP * self.nominal_dt
            or self.jitter_rms > _JITTER * self.nominal_dt
            or max(self.hold_gyro, self.hold_accel) > 1.0
            or self.saturated
            or self.stuck
        )

    def warnings(self) -> list[str]:
        """Say in plain sentences what a user should know before trusting the record."""
        found = []
        if self.not_finite:
            found.append(
                f"{self.not_finite} row(s) with a value that is not a number were dropped, "
                f"the first at {self.first_not_finite}"
            )
        if self.repeated:
            found.append(f"{self.repeated} row(s) that repeat the row before them were dropped")
        if self.spikes:
            found.append(spikes_warning(self.spikes))
        if self.gaps:
            found.append(
                f"{self.gaps} gap(s) bridged by interpolation, the first after "
                f"t = {_instant(self.first_gap_time)} s, the longest {self.longest_gap:.4g} s"
            )
        if self.jitter_rms > _JITTER * self.nominal_dt:
            found.append(
                f"the time stamps jitter by {self.jitter_rms * 1e3:.3g} ms rms around "
                f"{self.nominal_dt * 1e3:.6g} ms; if the instrument's clock is steady, give its "
                "rate instead of the time column"
            )
        found += self._holds()
        found += [f"{text}: saturated?" for text in self.saturated]
        found += [f"{text}: is the channel connected?" for text in self.stuck]
        return found

    def _holds(self) -> list[str]:
        """Say which sensors run slower than the rows."""
        gyro, accel = self.hold_gyro, self.hold_accel
        if gyro == accel:
            parts = [("values", "sensor", gyro)]
        else:
            parts = [("gyro values", "gyros", gyro), ("accel values", "accelerometers", accel)]
        return [
            f"{what} repeat {_TIMES.get(round(hold), f'{hold:.4g} times')}: the {who} "
            f"{'runs' if who == 'sensor' else 'run'} at {1.0 / (hold * self.nominal_dt):.4g} Hz"
            for what, who, hold in parts
            if hold > 1.0
        ]


def _hold(runs: NDArray[np.float64], rows: int) -> float:
    """Return how often each value of a triad comes, 1 where values do not repeat.

    Parameters
    ----------
    runs : (4,) float64
        Current run, changes, shortest and longest run between changes.
    rows : int
    """
    _, changes, shortest, longest = runs
    if changes < _LEAST_RUNS or shortest < 2:
        return 1.0
    # A sensor that runs at no whole part of the rate comes so many times or once more.
    if longest == shortest:
        return float(shortest)
    return float(rows / (changes + 1.0)) if longest <= 2.0 * shortest else 1.0


def _instant(seconds: float) -> str:
    return f"{seconds:.6g}" if abs(seconds) < 1e6 else time_text(seconds)
