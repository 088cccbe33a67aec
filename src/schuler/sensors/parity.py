"""Parity of a redundant array: what its sensors contradict each other by, and the tests on it.

The parity p = V m, with V H = 0 and V V^T = I, does not see the motion. Without a fault it is white
noise; a fault b of sensor j adds b v_j, with v_j the j-th column of V (Potter and Suman, 1977;
Daly, Gai and Harrison, 1979, the generalised likelihood ratio). Detection: p^T p / s^2 is
chi-square with n - 3 degrees of freedom, and with a fault non-central by b^2 |v_j|^2 / s^2.
Isolation: the largest (p . v_j)^2 / |v_j|^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.sensors.array import SensorArray

__all__ = ["ParityTest", "isolable", "parity_matrix"]

Array = NDArray[np.float64]


def parity_matrix(array: SensorArray, working: Sequence[int] | None = None) -> Array:
    """Return V (k - 3, n): orthonormal rows that see no motion; zero for sensors that are out.

    Raises
    ------
    InputError
        If there is no redundancy.

    Examples
    --------
    >>> from schuler.sensors import named_array
    >>> array = named_array("symmetric4")
    >>> bool(np.allclose(parity_matrix(array) @ array.h, 0.0))
    True
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
    """Say whether parity alone can isolate one sensor: no two columns of V point the same way.

    Examples
    --------
    >>> from schuler.sensors import named_array
    >>> isolable(named_array("symmetric4")), isolable(named_array("dodecahedron"))
    (False, True)
    """
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

    Examples
    --------
    >>> from schuler.sensors import named_array
    >>> test = ParityTest(named_array("dodecahedron"), sigma=1e-6, window=10)
    >>> test.freedom, round(test.threshold, 2)
    (3, 16.27)
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
            raise InputError(
                f"sensor {sensor} does not enter the parity: no fault of it is detected"
            )
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
