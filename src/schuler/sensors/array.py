"""Redundant arrays: more sensors than axes, any geometry, fused into a triad.

m = H w + noise, H with a row of direction for each sensor; w = (H^T W H)^-1 H^T W m. The sum of
the variances is least where H^T H = (n/3) I, and then it does not depend on the axes' turn.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler._files import check_keys, read_toml
from schuler.errors import InputError
from schuler.record import ImuRecord

__all__ = ["SensorArray"]

Array = NDArray[np.float64]

_RANK = 1e-9
"""Relative singular value below which directions count as coplanar."""

MOST = 16
"""Sensors whose subsets are all looked at: 65,536."""


@dataclass(frozen=True, eq=False)
class SensorArray:
    """Sensors with one axis each.

    Parameters
    ----------
    matrix : (n, 3) array_like
        H: a direction for each sensor, in body axes (RFU).
    name : str
    sigma : (n,) array_like, optional
        1 sigma of each sensor's noise, in any unit: the weights of the fusion are 1/sigma^2.
    bias : (n,) array_like, optional
        Known bias of each, rad/s (or m/s^2), taken out before fusing.
    scale : (n,) array_like, optional
        Known scale factor error of each, taken out before fusing.

    Raises
    ------
    InputError
        For fewer than three sensors, directions that do not span the space, or bad numbers.

    Examples
    --------
    >>> array = sc.SensorArray([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    >>> array.matrix.shape
    (4, 3)
    """

    matrix: ArrayLike
    name: str = "array"
    sigma: ArrayLike | None = None
    bias: ArrayLike | None = None
    scale: ArrayLike | None = None

    def __post_init__(self) -> None:
        h = np.asarray(self.matrix, np.float64)
        if h.ndim != 2 or h.shape[1] != 3 or len(h) < 3 or not np.all(np.isfinite(h)):
            raise InputError(f"{self.name}: expected finite directions of shape (n >= 3, 3), "
                             f"got {h.shape}")  # fmt: skip
        if np.any(np.linalg.norm(h, axis=1) < 1e-6):
            raise InputError(f"{self.name}: a direction is zero")
        object.__setattr__(self, "matrix", h)
        for key, default in (("sigma", 1.0), ("bias", 0.0), ("scale", 0.0)):
            value = getattr(self, key)
            array = np.full(len(h), default) if value is None else np.asarray(value, np.float64)
            if array.shape != (len(h),) or not np.all(np.isfinite(array)):
                raise InputError(
                    f"{self.name}: expected {len(h)} finite numbers for {key}, got shape "
                    f"{array.shape}"
                )
            object.__setattr__(self, key, array)
        if np.any(self._s <= 0):
            raise InputError(f"{self.name}: sigma must be positive for each sensor")
        if not self.spans(range(len(h))):
            raise InputError(f"{self.name}: the directions lie in a plane; three axes need more")

    def __len__(self) -> int:
        return len(self.h)

    @property
    def h(self) -> Array:
        """The matrix H, (n, 3)."""
        return np.asarray(self.matrix)

    @property
    def _s(self) -> Array:
        return np.asarray(self.sigma)

    def _pick(self, working: Sequence[int] | None) -> list[int]:
        picked = list(range(len(self))) if working is None else [int(i) for i in working]
        if len(set(picked)) != len(picked) or not all(0 <= i < len(self) for i in picked):
            raise InputError(
                f"{self.name}: sensors are numbered 0 to {len(self) - 1}, each once; got {picked}"
            )
        return picked

    def spans(self, working: Sequence[int]) -> bool:
        """Say whether some sensors alone still measure all three axes."""
        picked = self._pick(working)
        if len(picked) < 3:
            return False
        s = np.linalg.svd(self.h[picked], compute_uv=False)
        return bool(s[2] > _RANK * s[0])

    # -- fusing ------------------------------------------------------------------------

    def estimator(self, working: Sequence[int] | None = None) -> Array:
        """Return (H^T W H)^-1 H^T W, (3, n); columns of sensors that do not work are zero.

        Raises
        ------
        InputError
            If the working sensors do not measure all three axes.

        Examples
        --------
        >>> sc.sensors.named_array("symmetric4").estimator().shape
        (3, 4)
        """
        picked = self._pick(working)
        if not self.spans(picked):
            raise InputError(
                f"{self.name}: sensors {picked} do not measure all three axes; nothing can be fused"
            )
        w = 1.0 / self._s[picked]
        out = np.zeros((3, len(self)))
        out[:, picked] = np.linalg.pinv(self.h[picked] * w[:, None]) * w
        return out

    def fuse(self, record: ImuRecord, working: Sequence[int] | None = None) -> ImuRecord:
        """Return a record of three gyros from one with a column for each sensor.

        Parameters
        ----------
        record : ImuRecord
            dtheta (n, m) with m sensors in this array's order.
        working : sequence of int, optional
            The sensors to use; all, when not given.

        Raises
        ------
        InputError
            If the columns are not this array's, or the sensors do not measure all axes.

        Examples
        --------
        >>> array = sc.sensors.named_array("symmetric4")
        >>> array.fuse(array.measure(record)).dtheta.shape
        (1200, 3)
        """
        m = record.dtheta.shape[1]
        if m != len(self):
            raise InputError(
                f"{record.name}: has {m} gyro columns, but the array '{self.name}' has {len(self)}"
            )
        fused = self.solve(record.dtheta, record.dt[:, None], working)
        return replace(record, dtheta=np.ascontiguousarray(fused))

    def solve(
        self, measured: Array, interval: float | Array, working: Sequence[int] | None = None
    ) -> Array:
        """Return the triad's values (n, 3) of the sensors' (n, m), known errors taken out.

        Parameters
        ----------
        measured : (n, m) float64
            Rates, or increments over an interval.
        interval : float or (n, 1) float64
            1 for rates, or the intervals, s: what the known bias is multiplied by.
        working : sequence of int, optional
        """
        bias, scale = np.asarray(self.bias), np.asarray(self.scale)
        clean = measured
        if np.any(bias) or np.any(scale):
            clean = (clean - interval * bias) / (1.0 + scale)
        return np.asarray(clean @ self.estimator(working).T)

    def measure(self, record: ImuRecord) -> ImuRecord:
        """Return what this array measures where three perfect gyros measure `record`.

        Examples
        --------
        >>> sc.sensors.named_array("symmetric4").measure(record).dtheta.shape
        (1200, 4)
        """
        if record.dtheta.shape[1] != 3:
            raise InputError(f"{record.name}: expected three gyros, got {record.dtheta.shape[1]}")
        bias, scale = np.asarray(self.bias), np.asarray(self.scale)
        seen = (record.dtheta @ self.h.T) * (1.0 + scale) + record.dt[:, None] * bias
        return replace(record, dtheta=np.ascontiguousarray(seen))

    def equivalent(self, errors: ArrayLike) -> Array:
        """Return the triad's error that errors (n,) of the sensors make, (3,).

        Examples
        --------
        >>> sc.sensors.named_array("triad").equivalent([1e-8, 0.0, 0.0]).tolist()
        [1e-08, 0.0, 0.0]
        """
        return np.asarray(self.estimator() @ np.asarray(errors, np.float64))

    # -- figures -----------------------------------------------------------------------

    def covariance(self, working: Sequence[int] | None = None) -> Array:
        """Return (H^T W H)^-1, (3, 3), for sensors of the given (by default unit) sigma."""
        k = self.estimator(working)
        return np.asarray((k * self._s**2) @ k.T)

    def variance(self, working: Sequence[int] | None = None) -> Array:
        """Return the variance of each fused axis, (3,).

        Examples
        --------
        >>> sc.sensors.named_array("symmetric4").variance().round(3).tolist()
        [0.75, 0.75, 0.75]
        """
        return np.diag(self.covariance(working)).copy()

    def subsets(self, least: int = 3) -> Iterator[tuple[int, ...]]:
        """Yield the sets of sensors that measure all axes, the largest first.

        Raises
        ------
        InputError
            For more sensors than `MOST`.

        Examples
        --------
        >>> list(sc.sensors.named_array("symmetric4").subsets(4))
        [(0, 1, 2, 3)]
        """
        if len(self) > MOST:
            raise InputError(f"{self.name}: the subsets of more than {MOST} sensors are too many")
        for size in range(len(self), least - 1, -1):
            for picked in combinations(range(len(self)), size):
                if self.spans(picked):
                    yield picked

    def subset_variance(self) -> dict[str, list[float]]:
        """Return the per-axis variance of every set that measures all axes: "0,1,2" -> (3,).

        Examples
        --------
        >>> len(sc.sensors.named_array("symmetric4").subset_variance())
        5
        """
        return {",".join(map(str, s)): self.variance(s).tolist() for s in self.subsets()}

    def subset_determinant(self) -> dict[str, float]:
        """Return sqrt(det(H^T H)) of every set that measures all axes, |det H| for three.

        Examples
        --------
        >>> sc.sensors.named_array("triad").subset_determinant()
        {'0,1,2': 1.0}
        """
        return {
            ",".join(map(str, s)): float(
                np.sqrt(np.linalg.det(self.h[list(s)].T @ self.h[list(s)]))
            )
            for s in self.subsets()
        }

    def figures(self) -> dict[str, Any]:
        """Return what the geometry is worth, with all sensors and after any one failure.

        Figures that do not change when the array is turned as a whole (the sum of variances,
        determinants) cannot tell two arrays apart that are turned images of each other, as the
        cone of four and the symmetric skew are; the variance of each axis can.
        """
        h, n = self.h, len(self)
        gram = h.T @ h
        after: list[dict[str, Any]] = []
        for lost in range(n):
            left = [i for i in range(n) if i != lost]
            works = self.spans(left)
            v = self.variance(left).tolist() if works else None
            after.append({"lost": lost, "variance": v, "total": sum(v) if v else None})
        triples = [
            abs(float(np.linalg.det(h[list(t)]))) for t in combinations(range(n), 3)
        ]  # fmt: skip
        return {
            "variance": self.variance().tolist(),
            "total_variance": float(np.trace(self.covariance())),
            "determinant": float(np.linalg.det(gram)),
            "condition": float(np.linalg.cond(gram)),
            "optimal": bool(np.allclose(gram, n / 3.0 * np.eye(3), atol=1e-9)),
            "triple_determinants": triples,
            "after_one_failure": after,
        }

    def turned(self, rotation: ArrayLike) -> SensorArray:
        """Return the array turned by a rotation matrix (3, 3).

        Examples
        --------
        >>> half = np.diag([-1.0, -1.0, 1.0])
        >>> sc.sensors.named_array("triad").turned(half).h[2].tolist()
        [0.0, 0.0, 1.0]
        """
        return replace(self, matrix=self.h @ np.asarray(rotation, np.float64).T)

    @classmethod
    def from_toml(cls, path: str | Path) -> SensorArray:
        """Read an array: ``directions = [[..], ..]`` and, if known, sigma, bias and scale.

        Bias is in deg/h, scale in ppm; directions are made to unit length.

        Raises
        ------
        InputError
            If the file cannot be read, is not TOML, or holds bad values.
        """
        from schuler.constants import DEG_PER_HOUR

        path = Path(path)
        data = read_toml(path)
        known = ("name", "directions", "sigma", "bias_deg_h", "scale_ppm")
        check_keys(data, known, str(path))
        try:
            h = np.array(data["directions"], np.float64)
            with np.errstate(invalid="ignore"):
                h = h / np.linalg.norm(h, axis=-1, keepdims=True)
            parts = {k: np.array(data[k], np.float64) for k in known[2:] if k in data}
        except KeyError:
            raise InputError(f"{path}: 'directions' is missing") from None
        except (ValueError, TypeError, np.exceptions.AxisError):
            raise InputError(f"{path}: expected lists of numbers, three for a direction") from None
        return cls(
            h,
            str(data.get("name", path.stem)),
            parts.get("sigma"),
            None if "bias_deg_h" not in parts else DEG_PER_HOUR * parts["bias_deg_h"],
            None if "scale_ppm" not in parts else 1e-6 * parts["scale_ppm"],
        )
