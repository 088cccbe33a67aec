"""Do an array's gyros agree over a record? A faulty one is found by parity, and named.

The parity sees no motion, so its mean over a record at rest or moving is that of the gyros' errors.
Means over groups of samples are compared with their own scatter from one to the next (its median,
which one jump does not change), so nothing has to be known of the noise. The statistic is the
squared length of a mean over its variance, close to Fisher's F; it is looked at for the whole
record, and for the worst group, so that a late fault is seen as well. What biases may be is allowed
for.

A gyro is faulty where one alone explains what is seen: without it, the others agree, or disagree
ten times less. Five gyros or more can do that. Of four, the parity is one number, to which each
contributes: that one is wrong is all that can be said.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.constants import DEG_PER_HOUR, EARTH_RATE
from schuler.errors import InputError
from schuler.sensors.array import SensorArray
from schuler.sensors.parity import parity_matrix

__all__ = ["ArrayCheck", "ArrayVerdict"]

Array = NDArray[np.float64]

_ROWS = 64
_MOST = 4096
_GROUPS = 32
_LEAST = 8
#: what gyros may differ by where no specification says it: a thousandth of the Earth's rate each
_ALLOWED = 1e-3 * EARTH_RATE
#: the median of a scatter knows as much as so much of its number of values
_EFFICIENCY = 0.3
_DOMINANT = 10.0
#: cosine between two gyros' parities above which neither can be isolated
_ALIKE = 0.999


@dataclass(frozen=True)
class ArrayVerdict:
    """What the parity says of an array's gyros.

    Parameters
    ----------
    working : tuple of int
        The gyros to use, counted from 0.
    notes : tuple of str
        Gyros that are left out, and why.
    contradictions : tuple of str
        What could not be resolved by leaving one out.
    """

    working: tuple[int, ...]
    notes: tuple[str, ...] = ()
    contradictions: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Seen:
    """Parity of some of the gyros: its size (rad/s), and how often the noise that is."""

    size: float
    times: float
    direction: Array


class ArrayCheck:
    """Accumulates the gyros' values, and says whether they agree.

    Parameters
    ----------
    array : SensorArray
    bias : float, optional
        What a gyro's bias may be (1 sigma, rad/s), by its specification.
    false_alarm : float
        Chance that gyros without a fault, white noise and biases within `bias`, are said to
        disagree.

    Raises
    ------
    InputError
        If the false-alarm rate is none.
    """

    def __init__(
        self, array: SensorArray, bias: float | None = None, false_alarm: float = 1e-3
    ) -> None:
        if not 0.0 < false_alarm < 0.5:
            raise InputError(f"a false-alarm rate is 0 to 0.5, got {false_alarm}")
        self.array = array
        self._bias = _ALLOWED if bias is None else max(bias, _ALLOWED)
        self._false_alarm = false_alarm
        self._stated = bias is not None
        self._rows = _ROWS
        self._sums: list[Array] = []
        self._rest = np.empty((0, len(array)))

    def push(self, rates: Array) -> None:
        """Take rates (n, m), rad/s, in time's order; rows with a missing value are left out."""
        known, scale = np.asarray(self.array.bias), np.asarray(self.array.scale)
        clean = (rates[np.isfinite(rates).all(axis=1)] - known) / (1.0 + scale)
        held = np.vstack([self._rest, clean])
        k = len(held) // self._rows
        whole = held[: k * self._rows].reshape(k, self._rows, held.shape[1])
        self._sums += list(whole.mean(axis=1))
        self._rest = held[k * self._rows :]
        while len(self._sums) > _MOST:
            pairs = len(self._sums) // 2
            odd = self._sums[2 * pairs :]
            self._sums = [0.5 * (self._sums[2 * i] + self._sums[2 * i + 1]) for i in range(pairs)]
            # A single one of half the length waits for its other half, in its own rows.
            self._rest = np.vstack([*(np.repeat(o[None], self._rows, 0) for o in odd), self._rest])
            self._rows *= 2

    def verdict(self) -> ArrayVerdict:
        """Return which gyros to use, and what is to be said."""
        everyone = tuple(range(len(self.array)))
        groups = self._groups()
        if len(everyone) < 4 or groups is None:
            return ArrayVerdict(everyone)
        seen = self._look(groups, everyone)
        if seen is None:
            return ArrayVerdict(everyone)
        faulty = self._isolate(groups, everyone, seen)
        if faulty is None:
            return ArrayVerdict(everyone, (), (self._disagree(len(everyone), seen),))
        working = tuple(i for i in everyone if i != faulty)
        row = self.array.h[faulty] @ self.array.estimator(working)
        off = float(np.mean(groups[:, faulty] - groups @ row)) / DEG_PER_HOUR
        largest = float(np.max(np.abs(groups[:, faulty] - groups @ row))) / DEG_PER_HOUR
        size = f"{off:+.3g} deg/h" if largest < 2.0 * abs(off) else f"up to {largest:.3g} deg/h"
        note = (
            f"gyro {faulty + 1} was left out: it differs from the other {len(working)} by {size}, "
            f"{seen.times:.3g} times the noise of that (false alarms: {self._false_alarm:g})"
        )
        left = self._look(groups, working) if len(working) > 3 else None
        if left is None:
            return ArrayVerdict(working, (note,))
        return ArrayVerdict(working, (note,), (self._disagree(len(working), left),))

    # ----------------------------------------------------------------------------------

    def _groups(self) -> Array | None:
        """Return means over groups of equal length, (k, m); None for too short a record."""
        sums = np.array(self._sums)
        if len(sums) < _LEAST:
            return None
        each = max(1, len(sums) // _GROUPS)
        k = len(sums) // each
        return np.asarray(sums[: k * each].reshape(k, each, -1).mean(axis=1))

    def _look(self, groups: Array, working: tuple[int, ...]) -> _Seen | None:
        """Return what the parity of some gyros shows, or None where it is noise and bias."""
        from scipy.special import chdtri, fdtri

        p = groups @ parity_matrix(self.array, working).T
        k, m = p.shape
        steps = np.sum(np.diff(p, axis=0) ** 2, axis=1)
        # The median of a chi-square of m, for differences of two.
        variance = float(np.median(steps)) / (2.0 * float(chdtri(m, 0.5)))
        variance = max(variance, float(np.finfo(float).tiny))
        freedom = _EFFICIENCY * m * (k - 1)
        mean = p.mean(axis=0)
        sizes = np.sum(p**2, axis=1)
        worst = int(np.argmax(sizes))
        allowed = self._bias**2 * float(chdtri(m, 0.5 * self._false_alarm))
        # An upper quantile of F is one over a lower one with the degrees of freedom exchanged.
        # Half of the false alarms for the mean, half for the worst of the groups.
        most = m * float(1.0 / fdtri(freedom, m, 0.5 * self._false_alarm))
        most_of_worst = m * float(1.0 / fdtri(freedom, m, 0.5 * self._false_alarm / k))
        size = float(np.sum(mean**2))
        if size > variance / k * most + allowed:
            return _Seen(size**0.5, (size / (variance / k)) ** 0.5, mean)
        if sizes[worst] > variance * most_of_worst + allowed:
            return _Seen(sizes[worst] ** 0.5, (sizes[worst] / variance) ** 0.5, p[worst])
        return None

    def _isolate(self, groups: Array, working: tuple[int, ...], seen: _Seen) -> int | None:
        """Return the gyro that explains what is seen, or None where none does alone."""
        v = parity_matrix(self.array, working)
        if len(v) < 2:
            return None
        size = np.linalg.norm(v, axis=0)
        unit = np.divide(v, size, out=np.zeros_like(v), where=size > 1e-9)
        like = (seen.direction @ unit) ** 2
        j = int(np.argmax(like))
        alike = np.abs(unit.T @ unit[:, j])
        alike[j] = 0.0
        if alike.max() > _ALIKE or not self.array.spans([i for i in working if i != j]):
            return None
        after = {i: self._without(groups, working, i) for i in working}
        agreeing = [i for i, left in after.items() if left is None]
        if agreeing:
            # Where the others agree without either of two, neither can be isolated.
            return j if agreeing == [j] else None
        left = after[j]
        return j if left is not None and left.size * _DOMINANT < seen.size else None

    def _without(self, groups: Array, working: tuple[int, ...], out: int) -> _Seen | None:
        rest = tuple(i for i in working if i != out)
        if not self.array.spans(rest):
            # What measures too little contradicts itself, so that it excuses nobody.
            return _Seen(np.inf, np.inf, np.zeros(1))
        return self._look(groups, rest)

    def _disagree(self, count: int, seen: _Seen) -> str:
        cause = (
            "one is wrong, and which cannot be told"
            if count == 4
            else "more than one is wrong, or none alone explains it"
        )
        bias = "" if self._stated else ", or their biases are of that size (say --spec)"
        return (
            f"the {count} gyros disagree by {seen.size / DEG_PER_HOUR:.3g} deg/h, "
            f"{seen.times:.3g} times the noise of that: {cause}{bias}"
        )
