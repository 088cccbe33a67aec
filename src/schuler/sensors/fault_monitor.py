"""`FaultMonitor`: watch an array, detect and isolate faults, exclude sensors and take them back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.sensors.parity import ParityTest, isolable

__all__ = ["FaultMonitor", "Verdict"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Verdict:
    """What a monitor did at a window's end: sensor None is "seen, not isolable".

    Examples
    --------
    >>> Verdict(1.2, "excluded", 2, "its parity is 9.1 sigma").action
    'excluded'
    """

    time: float
    action: str
    sensor: int | None
    reason: str


class FaultMonitor:
    """Watch an array: detect, isolate, exclude, and take back what has healed.

    Parameters
    ----------
    test : ParityTest
        Its array, noise, false-alarm rate and window are used.
    heal : int
        Windows in a row in which an excluded sensor must agree with the others.

    Examples
    --------
    >>> from schuler.sensors import named_array
    >>> array, rng = named_array("dodecahedron"), np.random.default_rng(1)
    >>> monitor = FaultMonitor(ParityTest(array, sigma=1e-6, window=20))
    >>> measured = 1e-6 * rng.standard_normal((200, 6))
    >>> measured[100:, 2] += 1e-5
    >>> fused = monitor.run(0.01 * np.arange(200), measured)
    >>> monitor.out
    [2]
    """

    def __init__(self, test: ParityTest, heal: int = 10) -> None:
        if heal < 1:
            raise InputError(f"healing takes one window or more, got {heal}")
        self.test = test
        self.heal = heal
        self.out: list[int] = []
        self.verdicts: list[Verdict] = []
        self._good: dict[int, int] = {}
        self._tests: dict[tuple[int, ...], ParityTest] = {}
        self._silent = False
        self._unseen = 0

    @property
    def working(self) -> list[int]:
        """The sensors that are in use."""
        return [i for i in range(len(self.test.array)) if i not in self.out]

    def run(self, time: ArrayLike, measured: ArrayLike) -> Array:
        """Take increments (k, n) with their times; return the fused triad's, (whole windows, 3).

        The rows of a window are fused with the sensors that its own test leaves in use; a rest
        shorter than a window is fused with the sensors of the last.
        """
        t, m = np.asarray(time, np.float64), np.asarray(measured, np.float64)
        w = self.test.window
        fused = np.empty((len(m), 3))
        for a in range(0, len(m), w):
            rows = slice(a, min(a + w, len(m)))
            if rows.stop - a == w:
                self._window(float(t[rows.stop - 1]), m[rows])
            fused[rows] = m[rows] @ self.test.array.estimator(self.working).T
        return fused

    def _for(self, working: list[int]) -> ParityTest:
        key = tuple(working)
        if key not in self._tests:
            s = self.test
            self._tests[key] = ParityTest(s.array, s.sigma, s.false_alarm, s.window, key)
        return self._tests[key]

    def _window(self, time: float, rows: Array) -> None:
        working = self.working
        if len(working) >= 4:
            test = self._for(working)
            seen = float(test.statistic(rows)[0]) > test.threshold
            if seen and isolable(test.array, working):
                like = test.likelihoods(rows)[0]
                like[self.out] = -1.0
                j = int(np.argmax(like))
                left = [i for i in working if i != j]
                if test.array.spans(left):
                    self.out.append(j)
                    self._good[j] = 0
                    self._say(time, "excluded", j, f"its parity is {np.sqrt(like[j]):.1f} sigma")
            elif seen and not self._silent:
                self._say(
                    time, "detected", None,
                    f"{len(working)} sensors show that one is wrong, not which: isolation needs "
                    "five, or a rate known from elsewhere (an alignment, a turn of the table)",
                )  # fmt: skip
            # A window that misses does not end a fault: only as many as heal a sensor.
            self._unseen = 0 if seen else self._unseen + 1
            self._silent = seen or (self._silent and self._unseen < self.heal)
        self._reconsider(time, rows)

    def _reconsider(self, time: float, rows: Array) -> None:
        """Test each excluded sensor against what the others say of it."""
        from scipy.special import ndtri

        s = self.test
        limit = float(-ndtri(0.5 * s.false_alarm))
        for j in list(self.out):
            k = s.array.estimator(self.working)
            row = s.array.h[j] @ k
            each = np.asarray(s.array.sigma) / np.mean(np.asarray(s.array.sigma)) * s.sigma
            sigma = np.sqrt((each[j] ** 2 + float(row**2 @ each**2)) / len(rows))
            left = float(np.mean(rows[:, j] - rows @ row))
            # A stuck or noisy sensor can be right on the mean: its scatter must be right, too.
            scatter = float(np.std(rows[:, j] - rows @ row)) / (sigma * np.sqrt(len(rows)))
            good = abs(left) < limit * sigma and (len(rows) < 8 or 0.5 < scatter < 1.5)
            self._good[j] = self._good[j] + 1 if good else 0
            if self._good[j] >= self.heal:
                self.out.remove(j)
                self._say(time, "taken back", j, f"it agreed for {self.heal} windows")

    def _say(self, time: float, action: str, sensor: int | None, reason: str) -> None:
        self.verdicts.append(Verdict(time, action, sensor, reason))
