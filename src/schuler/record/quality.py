"""What rows showed as they were checked: missing ones, spikes, gaps, jitter, saturation, holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.record.spikes import Spike, spikes_warning
from schuler.units import time_text

__all__ = ["CHANNELS", "Quality"]

_TIMES = {2: "twice", 3: "three times", 4: "four times", 5: "five times", 6: "six times",
          7: "seven times", 8: "eight times", 9: "nine times", 10: "ten times"}  # fmt: skip

_LEAST_RUNS = 20
"""Runs of equal values that show a hold."""

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
        state: NDArray[np.float64],
        nominal: float,
        kind: str,
        spikes: tuple[Spike, ...] = (),
    ) -> Quality:
        """Read an intake kernel's state (`schuler.kernels.intake`)."""
        s = state
        n = int(s[72])
        safe = max(n, 1)
        mean = s[60:66] / safe
        std = np.sqrt(np.maximum(s[66:72] / safe - mean**2, 0.0))
        regular = int(s[23])
        jitter = 0.0
        if regular > 1:
            m = s[21] / regular
            jitter = float(np.sqrt(max(s[22] / regular - m * m, 0.0)))
            # Rounded time stamps of a perfect clock differ by a few ulps: no jitter.
            jitter = 0.0 if jitter < 1e-7 * m else jitter
        saturated, stuck = [], []
        holds = _hold(s[86:90], n), _hold(s[90:94], n)
        for j, label in enumerate(CHANNELS):
            if n >= 10 and s[54 + j] >= n:
                stuck.append(f"{label} is {mean[j]:.6g} in every row")
            elif (
                s[42 + j] >= 5 * holds[j // 3]
                and s[30 + j] > abs(mean[j]) + 2.0 * std[j]
                and s[48 + j] >= 5
            ):
                stuck_rows = int(s[48 + j])
                saturated.append(
                    f"{label} stays at its extreme {s[30 + j]:.6g} for {int(s[42 + j])} rows "
                    f"running ({stuck_rows} rows in all)"
                )
        where = ""
        if s[17] > 0:
            where = f"data row {int(s[26])} (t = {_instant(s[28])} s), {CHANNELS[int(s[27])]}"
        return cls(
            rows=int(s[0]),
            valid_rows=n,
            nominal_dt=nominal,
            jitter_rms=jitter,
            shortest_dt=float(s[73]),
            longest_dt=float(s[74]),
            not_finite=int(s[17]),
            first_not_finite=where,
            repeated=int(s[18]),
            gaps=int(s[19]),
            longest_gap=float(s[20]),
            first_gap_time=float(s[24]),
            saturated=tuple(saturated),
            stuck=tuple(stuck),
            mean=tuple(float(v) for v in mean),
            std=tuple(float(v) for v in std),
            mean_norm_gyro=float(s[76]) / safe,
            mean_norm_accel=float(s[77]) / safe,
            spikes=spikes,
            interpolated=int(s[101]),
            hold_gyro=holds[0],
            hold_accel=holds[1],
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
        if self.jitter_rms > 0.05 * self.nominal_dt:
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
