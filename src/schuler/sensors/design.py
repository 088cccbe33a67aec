"""Search for the best geometry of n sensors that can be mounted within limits."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.constants import DEG
from schuler.errors import InputError
from schuler.sensors.array import SensorArray

__all__ = ["Mounting", "design_array"]

Array = NDArray[np.float64]

CRITERIA = ("accuracy", "failure")


@dataclass(frozen=True)
class Mounting:
    """Where sensors may point.

    Parameters
    ----------
    elevation : (float, float)
        Lowest and highest elevation above the level plane, deg.
    apart : float
        Least angle between any two axes (as lines), deg.

    Examples
    --------
    >>> Mounting(elevation=(0.0, 90.0), apart=20.0)
    Mounting(elevation=(0.0, 90.0), apart=20.0)
    """

    elevation: tuple[float, float] = (-90.0, 90.0)
    apart: float = 0.0

    def __post_init__(self) -> None:
        low, high = self.elevation
        if not -90.0 <= low <= high <= 90.0:
            raise InputError(f"elevations must be within -90 to 90 deg, got {low} to {high}")
        if not 0.0 <= self.apart < 90.0:
            raise InputError(f"axes can be 0 to 90 deg apart, got {self.apart}")


def _axes(x: Array) -> Array:
    az, el = x.reshape(2, -1)
    return np.column_stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])


def _total(h: Array) -> float:
    s = np.linalg.svd(h, compute_uv=False)
    return float(np.sum(1.0 / np.maximum(s, 1e-6) ** 2))


def _after(h: Array) -> Array:
    return np.array([_total(np.delete(h, i, axis=0)) for i in range(len(h))])


def design_array(
    n: int,
    mounting: Mounting | None = None,
    *,
    criterion: str = "accuracy",
    rng: np.random.Generator | None = None,
    starts: int = 12,
) -> SensorArray:
    """Return the best array found from several starts (SLSQP).

    Parameters
    ----------
    n : int
        Sensors, 3 to 12.
    mounting : Mounting, optional
    criterion : {"accuracy", "failure"}
        Least total variance with all sensors (its bound is 9/n), or least after the worst single
        failure.
    rng : numpy.random.Generator, optional
        For the starts.
    starts : int

    Raises
    ------
    InputError
        For a number of sensors or a criterion that cannot be, or limits that leave no array.

    Examples
    --------
    >>> array = design_array(4, starts=2, rng=np.random.default_rng(1))
    >>> round(array.figures()["total_variance"], 3)
    2.25
    """
    from scipy.optimize import minimize

    least = 4 if criterion == "failure" else 3
    if criterion not in CRITERIA:
        raise InputError(f"criterion must be one of {', '.join(CRITERIA)}, got '{criterion}'")
    if not least <= n <= 12:
        raise InputError(f"a design for {criterion} takes {least} to 12 sensors, got {n}")
    limits = mounting or Mounting()
    rng = rng or np.random.default_rng(0)
    low, high = (v * DEG for v in limits.elevation)
    bounds = [(-2 * np.pi, 2 * np.pi)] * n + [(low, high)] * n
    pairs = np.triu_indices(n, 1)
    constraints: list[dict[str, Any]] = []
    if limits.apart:
        most = np.cos(limits.apart * DEG) ** 2
        constraints.append({
            "type": "ineq", "fun": lambda x: most - (_axes(x) @ _axes(x).T)[pairs] ** 2,
        })  # fmt: skip
    best: tuple[float, Array] | None = None
    for _ in range(starts):
        x0 = np.concatenate([rng.uniform(-np.pi, np.pi, n), rng.uniform(low, high, n)])
        if criterion == "accuracy":
            fun: Any = lambda x: _total(_axes(x))  # noqa: E731
            start, box, held = x0, bounds, constraints
        else:
            # The worst of several is smooth only as a bound: least b with every total below b.
            fun = lambda x: x[-1]  # noqa: E731
            start, box = np.append(x0, min(_after(_axes(x0)).max(), 50.0)), [*bounds, (0.0, 1e3)]
            held = [{"type": "ineq", "fun": lambda x: x[-1] - _after(_axes(x[:-1]))}]
            held += [{"type": "ineq", "fun": lambda x, c=c: c["fun"](x[:-1])} for c in constraints]
        with warnings.catch_warnings():
            # SciPy clips a step that leaves the bounds; some versions say so.
            warnings.filterwarnings("ignore", "Values in x were outside bounds", RuntimeWarning)
            found = minimize(fun, start, method="SLSQP", bounds=box, constraints=held,
                             options={"maxiter": 300, "ftol": 1e-12})  # fmt: skip
        x = found.x[: 2 * n]
        if any(np.min(c["fun"](x)) < -1e-6 for c in constraints):
            continue
        h = _axes(x)
        value = _total(h) if criterion == "accuracy" else float(_after(h).max())
        if np.isfinite(value) and value < 1e6 and (best is None or value < best[0]):
            best = (value, h)
    if best is None:
        raise InputError("no array fits within these mounting limits: widen them")
    return SensorArray(best[1], f"designed{n}")
