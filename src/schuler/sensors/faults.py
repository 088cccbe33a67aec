"""Faults of a redundant array: detection by parity, isolation, exclusion and re-inclusion.

The parity p = V m, with V H = 0 and V V^T = I, does not see the motion. Without a fault it is white
noise; a fault b of sensor j adds b v_j, with v_j the j-th column of V (Potter and Suman, 1977;
Daly, Gai and Harrison, 1979, the generalised likelihood ratio). Detection: p^T p / s^2 is
chi-square with n - 3 degrees of freedom, and with a fault non-central by b^2 |v_j|^2 / s^2.
Isolation: the largest (p . v_j)^2 / |v_j|^2.

With four sensors the parity is one number: a fault is seen, but all sensors project on it alike and
none can be blamed. Blame then needs more than parity: a known rate (`blame_by_rate`), as an
alignment at rest gives it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.sensors.array import SensorArray

__all__ = [
    "Blame",
    "Fault",
    "FaultMonitor",
    "ParityTest",
    "Verdict",
    "blame_by_rate",
    "isolable",
    "parity_matrix",
]

Array = NDArray[np.float64]

KINDS = ("step", "drift", "stuck", "noise", "scale")


@dataclass(frozen=True)
class Fault:
    """What goes wrong with one sensor from a time on.

    Parameters
    ----------
    sensor : int
        Counted from 0.
    kind : {"step", "drift", "stuck", "noise", "scale"}
        A bias; a bias that grows; the reading of the start for ever; more noise; a scale factor.
    size : float
        rad/s; rad/s^2; not used; factor of the standard deviation; relative.
    start : float
        s.
    end : float
        s; the fault heals then.
    """

    sensor: int
    kind: str = "step"
    size: float = 0.0
    start: float = 0.0
    end: float = np.inf

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f"a fault must be one of {', '.join(KINDS)}, got '{self.kind}'")
        if not (np.isfinite(self.size) and np.isfinite(self.start) and self.end > self.start):
            raise InputError(f"a fault needs a finite size and start, and a later end; got {self}")

    def apply(
        self, time: Array, dt: Array, measured: Array, sigma: float, rng: np.random.Generator
    ) -> Array:
        """Return increments (k, n) with the fault in.

        Parameters
        ----------
        time, dt : (k,) float64
            s.
        measured : (k, n) float64
            Increments, rad.
        sigma : float
            Standard deviation of one increment, for a noise fault, rad.
        rng : numpy.random.Generator
        """
        if not 0 <= self.sensor < measured.shape[1]:
            raise InputError(f"the fault is of sensor {self.sensor}, but there are "
                             f"{measured.shape[1]}")  # fmt: skip
        out = measured.copy()
        on = (time > self.start) & (time <= self.end)
        if not np.any(on):
            return out
        c = out[on, self.sensor]
        if self.kind == "step":
            c = c + self.size * dt[on]
        elif self.kind == "drift":
            c = c + self.size * (time[on] - self.start) * dt[on]
        elif self.kind == "stuck":
            c = np.full_like(c, c[0])
        elif self.kind == "noise":
            # On top of the noise that is there.
            c = c + np.sqrt(max(self.size**2 - 1.0, 0.0)) * sigma * rng.standard_normal(len(c))
        else:
            c = c * (1.0 + self.size)
        out[on, self.sensor] = c
        return out


def parity_matrix(array: SensorArray, working: Sequence[int] | None = None) -> Array:
    """Return V (k - 3, n): orthonormal rows that see no motion; zero for sensors that are out.

    Raises
    ------
    InputError
        If there is no redundancy.
    """
    picked = array._pick(working)
    if len(picked) < 4 or not array.spans(picked):
        raise InputError(
            f"{array.name}: {len(picked)} sensors leave no redundancy; a parity needs four that "
            "measure all axes"
        )
    scale = np.asarray(array.sigma)[picked]
    # In units of each sensor's own noise, so that the parity is white.
    h = array.h[picked] / (scale / scale.mean())[:, None]
    q, _ = np.linalg.qr(h, mode="complete")
    out = np.zeros((len(picked) - 3, len(array)))
    out[:, picked] = q[:, 3:].T / (scale / scale.mean())
    return out


def isolable(array: SensorArray, working: Sequence[int] | None = None) -> bool:
    """Say whether parity alone can blame one sensor: no two columns of V point the same way."""
    v = parity_matrix(array, working)
    picked = array._pick(working)
    size = np.linalg.norm(v[:, picked], axis=0)
    if len(v) < 2 or np.any(size < 1e-9):
        return False
    u = v[:, picked] / size
    cosine = np.abs(u.T @ u) - np.eye(len(picked))
    return bool(cosine.max() < 1.0 - 1e-9)


@dataclass(frozen=True, eq=False)
class ParityTest:
    """A chi-square test of windows of the parity, with a chosen false-alarm rate.

    Parameters
    ----------
    array : SensorArray
    sigma : float
        Standard deviation of one sensor's increment, rad (of the mean one, where they differ).
    false_alarm : float
        Chance that a window without a fault alarms.
    window : int
        Samples that are added before they are tested: long ones find small faults, late.
    working : sequence of int, optional
    """

    array: SensorArray
    sigma: float
    false_alarm: float = 1e-3
    window: int = 1
    working: tuple[int, ...] | None = None
    parity: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not self.sigma > 0:
            raise InputError(f"the noise of a parity test must be positive, got {self.sigma}")
        if not 0.0 < self.false_alarm < 0.5:
            raise InputError(f"a false-alarm rate is 0 to 0.5, got {self.false_alarm}")
        if self.window < 1:
            raise InputError(f"a window has one sample or more, got {self.window}")
        object.__setattr__(self, "parity", parity_matrix(self.array, self.working))

    @property
    def freedom(self) -> int:
        """Degrees of freedom, n - 3."""
        return len(self.parity)

    @property
    def threshold(self) -> float:
        """What the statistic exceeds by chance with the false-alarm rate."""
        from scipy.special import chdtri

        return float(chdtri(self.freedom, self.false_alarm))

    def sums(self, measured: ArrayLike) -> Array:
        """Return the parity of whole windows in standard deviations, (windows, n - 3)."""
        p = np.asarray(measured, np.float64) @ self.parity.T
        k = len(p) // self.window
        p = p[: k * self.window].reshape(k, self.window, -1).sum(axis=1)
        return np.asarray(p / (self.sigma * np.sqrt(self.window)))

    def statistic(self, measured: ArrayLike) -> Array:
        """Return the chi-square statistic of each whole window of increments (k, n)."""
        return np.asarray(np.sum(self.sums(measured) ** 2, axis=1))

    def likelihoods(self, measured: ArrayLike) -> Array:
        """Return (p . v_j)^2 / |v_j|^2 for each window and sensor, in variances, (windows, n)."""
        size = np.linalg.norm(self.parity, axis=0)
        unit = np.divide(self.parity, size, out=np.zeros_like(self.parity), where=size > 0)
        return np.asarray((self.sums(measured) @ unit) ** 2)

    def non_centrality(self, sensor: int, shift: float) -> float:
        """Return lambda of a constant extra increment `shift` (rad a sample) of a sensor."""
        v = float(np.sum(self.parity[:, sensor] ** 2))
        return self.window * shift**2 * v / self.sigma**2

    def miss_rate(self, sensor: int, shift: float) -> float:
        """Return the chance that a window with such a fault does not alarm."""
        from scipy.special import chndtr

        return float(chndtr(self.threshold, self.freedom, self.non_centrality(sensor, shift)))

    def mean_delay(self, sensor: int, shift: float) -> float:
        """Return the mean number of samples from the fault to the end of the first alarm.

        The fault is taken to begin with a window; inside one it waits half a window more.
        """
        return self.window / (1.0 - self.miss_rate(sensor, shift))

    def smallest_fault(self, sensor: int, miss: float = 0.01) -> float:
        """Return the extra increment (rad a sample) that is missed with a given chance."""
        from scipy.optimize import brentq
        from scipy.special import chndtr

        if not 0.0 < miss < 1.0 - self.false_alarm:
            raise InputError(f"a miss rate is 0 to {1 - self.false_alarm:g}, got {miss}")
        unit = self.non_centrality(sensor, 1.0)
        if unit <= 0:
            raise InputError(f"sensor {sensor} does not show in the parity: no fault of it is seen")
        found = brentq(
            lambda x: chndtr(self.threshold, self.freedom, x) - miss, 1e-9, 1e4, xtol=1e-9
        )
        return float(np.sqrt(found / unit))

    def sprt(self, measured: ArrayLike, shift: float, miss: float = 0.01) -> tuple[Any, Any]:
        """Run Wald's sequential test for a fault of each sensor, of either sign.

        Parameters
        ----------
        measured : (k, n) array_like
            Increments; every sample is used, whatever the window.
        shift : float
            Size of the fault that is looked for, rad a sample.
        miss : float
            Chance to accept "no fault" wrongly.

        Returns
        -------
        (k, n) bool, (n,) int
            Where a sensor's test ended in an alarm, and how many tests it ended in all (it begins
            again after each end). Wald: of the ended tests at most the false-alarm rate, over
            1 - miss, are false, for each sign and sensor.
        """
        from schuler.kernels.sequential import sprt

        p = np.asarray(measured, np.float64) @ self.parity.T / self.sigma
        size = np.linalg.norm(self.parity, axis=0)
        unit = np.divide(self.parity, size, out=np.zeros_like(self.parity), where=size > 0)
        x = np.ascontiguousarray(p @ unit)
        upper = np.log((1.0 - miss) / self.false_alarm)
        lower = np.log(miss / (1.0 - self.false_alarm))
        alarms = np.zeros(x.shape, np.bool_)
        ended = np.zeros(x.shape[1], np.int64)
        sprt(x, shift / self.sigma * size, upper, lower, alarms, ended)
        return alarms, ended


@dataclass(frozen=True, eq=False)
class Blame:
    """Which sensor is at fault.

    Parameters
    ----------
    sensor : int or None
        None where it cannot be told.
    size : float or None
        The fault's size as estimated, rad a sample.
    reason : str
        In a sentence.
    """

    sensor: int | None
    size: float | None
    reason: str


def blame_by_rate(
    array: SensorArray, measured: ArrayLike, rate: ArrayLike, sigma: float,
    false_alarm: float = 1e-3,
) -> Blame:  # fmt: skip
    """Blame a sensor by a rate that is known from elsewhere.

    At rest an alignment (made before the fault, or with the other sets of sensors) tells the rate
    in the body; while rotating the table's encoder adds its part. Then each sensor is tested by
    itself, and four are enough.

    Parameters
    ----------
    array : SensorArray
    measured : (k, n) array_like
        Increments, rad.
    rate : (k, 3) or (3,) array_like
        The known increments of the body, rad.
    sigma : float
        Standard deviation of one increment, rad.
    false_alarm : float
        For the largest of all sensors together.
    """
    from scipy.special import ndtri

    m = np.asarray(measured, np.float64)
    left = (m - np.broadcast_to(np.asarray(rate, np.float64), (len(m), 3)) @ array.h.T).mean(axis=0)
    z = left / (sigma / np.sqrt(len(m)))
    j = int(np.argmax(np.abs(z)))
    limit = float(-ndtri(0.5 * false_alarm / len(array)))
    if abs(z[j]) < limit:
        return Blame(None, None, f"no sensor differs from the known rate by {limit:.1f} sigma")
    return Blame(j, float(left[j]), f"sensor {j} differs from the known rate by {abs(z[j]):.1f} "
                 "sigma")  # fmt: skip


@dataclass(frozen=True)
class Verdict:
    """What a monitor did at a window's end: sensor None is "seen, not isolable"."""

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
                    f"{len(working)} sensors show that one is wrong, not which: blame needs five, "
                    "or a rate known from elsewhere (an alignment, a turn of the table)",
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
