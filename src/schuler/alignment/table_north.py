"""North with one gyro on an indexing table: readings at known table angles, a cosine through them.

A gyro whose input axis lies level at the table angle theta reads

    w(theta) = b + A cos(theta - p),  A = w_e cos L,

b its bias and p the table angle at which the axis points north. The mean of a dwell is Tukey's
biweight, which passes from readings to outliers without an edge. The scatter of the means about
the cosine is that of turn-on and indexing and goes into sigma, beside the noise within each dwell.

Source: the multi-position method (Iozan, Kirkko-Jaakkola, Collin, Takala and Rusu, 2012).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler._result import Result, table_of_rows
from schuler.constants import DEG, DEG_PER_HOUR, EARTH_RATE
from schuler.errors import InputError

__all__ = ["TableNorth", "load_readings", "robust_mean", "table_north"]

Array = NDArray[np.float64]

_TUNING = 6.0
"""Robust sigmas at which a reading loses all its weight (Beers, Flynn and Gebhardt, 1990)."""


@dataclass(frozen=True, eq=False)
class TableNorth(Result):
    """North by an indexing table.

    Parameters
    ----------
    north_deg : float
        Table angle at which the input axis points north, deg in (-180, 180].
    bias, amplitude : float
        Of the gyro and of the cosine, rad/s.
    covariance : (3, 3) float64
        Of north (rad), bias and amplitude (rad/s).
    angles_deg : (n,) float64
        Table angles.
    means, sigmas : (n,) float64
        Robust mean of each dwell and its standard error by the noise within, rad/s.
    residuals : (n,) float64
        Means less the cosine, rad/s.
    clipped : (n,) int64
        Readings left out of each dwell.
    known_amplitude : bool
        Whether the latitude gave the amplitude.
    contradictions : tuple of str
        What the readings show and cannot be; empty where nothing contradicts the result.
    """

    north_deg: float
    bias: float
    amplitude: float
    covariance: Array
    angles_deg: Array
    means: Array
    sigmas: Array
    residuals: Array
    clipped: NDArray[np.int64]
    known_amplitude: bool
    contradictions: tuple[str, ...] = ()

    @property
    def consistent(self) -> bool:
        """Whether nothing contradicts the result."""
        return not self.contradictions

    @property
    def sigma_deg(self) -> float:
        """1-sigma of north, deg."""
        return float(np.sqrt(self.covariance[0, 0])) / DEG

    @property
    def latitude_deg(self) -> float | None:
        """Size of the latitude that the amplitude means, deg; None where it is above Earth rate."""
        cosine = self.amplitude / EARTH_RATE
        return None if cosine > 1.0 else float(np.degrees(np.arccos(cosine)))

    def to_dict(self) -> dict[str, Any]:
        """Return the result with the keys of the JSON schema `schuler.north/2`."""
        sigma = np.sqrt(np.diag(self.covariance))
        return {
            "schema": "schuler.north/2",
            "north_deg": self.north_deg,
            "sigma_deg": self.sigma_deg,
            "bias_deg_h": self.bias / DEG_PER_HOUR,
            "bias_sigma_deg_h": float(sigma[1]) / DEG_PER_HOUR,
            "amplitude_deg_h": self.amplitude / DEG_PER_HOUR,
            "amplitude_sigma_deg_h": float(sigma[2]) / DEG_PER_HOUR,
            "latitude_deg": self.latitude_deg,
            "consistent": self.consistent,
            "contradictions": list(self.contradictions),
            "rows": [
                {"angle_deg": float(a), "mean_deg_h": float(m) / DEG_PER_HOUR,
                 "sigma_deg_h": float(s) / DEG_PER_HOUR, "residual_deg_h": float(r) / DEG_PER_HOUR,
                 "clipped": int(c)}
                for a, m, s, r, c in zip(self.angles_deg, self.means, self.sigmas, self.residuals,
                                         self.clipped, strict=True)
            ],
        }  # fmt: skip

    def columns(self) -> dict[str, Any]:
        """Return a row to each dwell."""
        return table_of_rows(self.to_dict()["rows"])

    def __str__(self) -> str:
        sigma = np.sqrt(np.diag(self.covariance)) / DEG_PER_HOUR
        held = " (of the latitude)" if self.known_amplitude else f" ± {sigma[2]:.2g}"
        first = f"INCONSISTENT: {'; '.join(self.contradictions)}; " if self.contradictions else ""
        lines = [
            f"{first}north at table angle {self.north_deg:.3f} deg ± {self.sigma_deg:.2g} deg",
            f"bias {self.bias / DEG_PER_HOUR:.4g} ± {sigma[1]:.2g} deg/h, amplitude "
            f"{self.amplitude / DEG_PER_HOUR:.5g}{held} deg/h",
            f"{'angle deg':>10} {'mean deg/h':>12} {'sigma':>9} {'residual':>10} {'clipped':>8}",
        ]
        lines += [
            f"{a:10.4g} {m / DEG_PER_HOUR:12.5f} {s / DEG_PER_HOUR:9.2g} "
            f"{r / DEG_PER_HOUR:10.4f} {c:8d}"
            for a, m, s, r, c in zip(
                self.angles_deg, self.means, self.sigmas, self.residuals, self.clipped, strict=True
            )
        ]
        return "\n".join(lines)


def robust_mean(readings: ArrayLike) -> tuple[float, float, int]:
    """Return Tukey's biweight mean, its standard error, and how many readings have no weight.

    Parameters
    ----------
    readings : (n,) array_like

    Raises
    ------
    InputError
        For fewer than four finite readings.

    Examples
    --------
    >>> mean, error, left_out = robust_mean([1.0, 1.1, 0.9, 1.0, 50.0])
    >>> round(mean, 2), left_out
    (1.0, 1)
    """
    x = np.asarray(readings, np.float64).ravel()
    x = x[np.isfinite(x)]
    if len(x) < 4:
        raise InputError(f"a dwell needs four readings at least, got {len(x)}")
    mean = float(np.median(x))
    spread = 1.4826 * float(np.median(np.abs(x - mean)))
    if spread == 0.0:
        # More than half are the same number: nothing says how far an outlier is.
        return float(x.mean()), float(x.std(ddof=1) / np.sqrt(len(x))), 0
    u = np.zeros(len(x))
    for _ in range(100):
        u = (x - mean) / (_TUNING * spread)
        weight = np.where(np.abs(u) < 1.0, (1.0 - u**2) ** 2, 0.0)
        before, mean = mean, float(weight @ x / weight.sum())
        if abs(mean - before) < 1e-12 * spread:
            break
    inside = np.abs(u) < 1.0
    v = u[inside] ** 2
    # From the influence of a reading: the square root of the sum of psi^2 over the sum of psi'.
    psi2 = float(np.sum((x[inside] - mean) ** 2 * (1.0 - v) ** 4))
    slope = float(np.sum((1.0 - v) * (1.0 - 5.0 * v)))
    return mean, float(np.sqrt(psi2) / max(slope, 1.0)), int(np.sum(~inside))


def table_north(
    angles_deg: ArrayLike,
    readings: Sequence[ArrayLike],
    *,
    latitude: float | None = None,
) -> TableNorth:
    """Return the table angle at which the gyro's axis points north.

    Parameters
    ----------
    angles_deg : (n,) array_like
        Table angle of each dwell, in the sense in which the gyro turns, deg.
    readings : sequence of n arrays
        Rates of each dwell, rad/s.
    latitude : float, optional
        rad; fixes the amplitude. Without it the amplitude is estimated, which needs three
        different angles.

    Raises
    ------
    InputError
        If numbers do not match, or the angles do not fix north.

    Examples
    --------
    >>> angles, rng = np.array([0.0, 90.0, 180.0, 270.0]), np.random.default_rng(1)
    >>> rates = 4.9e-5 * np.cos(np.radians(angles - 20.0))
    >>> found = table_north(angles, [x + 1e-8 * rng.standard_normal(50) for x in rates])
    >>> round(found.north_deg, 1)
    20.0
    """
    angles = np.asarray(angles_deg, np.float64).ravel()
    if len(angles) != len(readings):
        raise InputError(
            f"there are {len(angles)} table angles and {len(readings)} dwells: one angle a dwell"
        )
    if not np.all(np.isfinite(angles)):
        raise InputError(f"the table angles must be finite, got {angles.tolist()}")
    means, sigmas, clipped = (np.array(c) for c in zip(*map(robust_mean, readings), strict=True))
    theta = angles * DEG
    design = np.column_stack([np.ones(len(angles)), np.cos(theta), np.sin(theta)])
    if np.linalg.matrix_rank(design, tol=1e-6) < 3:
        raise InputError(
            "these table angles do not fix north, bias and amplitude: take three or more that "
            "differ, as 0, 120, 240 deg"
        )
    x = np.linalg.lstsq(design, means, rcond=None)[0]
    text = _contradiction(design, means, sigmas, x, latitude)
    if latitude is not None:
        x = _on_circle(design, means, x, EARTH_RATE * float(np.cos(latitude)))
    bias, c, s = x
    amplitude = float(np.hypot(c, s))
    if amplitude == 0.0:
        raise InputError("the readings do not change with the table angle: no Earth rate in them")
    residuals = means - design @ x
    north = np.arctan2(s, c)
    # To north, bias and amplitude.
    slope = np.column_stack([
        amplitude * np.sin(theta - north), np.ones(len(theta)), np.cos(theta - north),
    ])[:, : 2 if latitude is not None else 3]  # fmt: skip
    free = len(means) - slope.shape[1]
    # The scatter about the cosine shows the noise of a mean, where there is any to judge by.
    within = float(np.mean(sigmas**2))
    variance = max(float(residuals @ residuals) / free, within) if free > 0 else within
    covariance = np.zeros((3, 3))
    k = slope.shape[1]
    covariance[:k, :k] = variance * np.linalg.inv(slope.T @ slope)
    return TableNorth(
        float(np.degrees(north)), float(bias), amplitude, covariance, angles, means, sigmas,
        residuals, clipped, latitude is not None, () if text is None else (text,),
    )  # fmt: skip


_MISREADINGS = {
    180.0 / np.pi: "degrees read as radians", np.pi / 180.0: "radians read as degrees",
    3600.0: "values an hour read as values a second",
    1.0 / 3600.0: "values a second read as values an hour",
    3600.0 / DEG: "deg/h read as rad/s", DEG / 3600.0: "rad/s read as deg/h",
}  # fmt: skip
"""What makes an amplitude wrong by a factor."""

_SCALE = 0.01
"""1-sigma of a gyro's scale factor that is taken for granted."""

_BEYOND = 3.6
"""Sigmas of a false alarm of 3e-4."""


def _contradiction(
    design: Array, means: Array, sigmas: Array, x: Array, latitude: float | None
) -> str | None:
    """Hold the amplitude of the free cosine against the Earth's rate."""
    residuals = means - design @ x
    within = float(np.mean(sigmas**2))
    free = len(means) - 3
    variance = max(float(residuals @ residuals) / free, within) if free > 0 else within
    amplitude = float(np.hypot(x[1], x[2]))
    along = np.array([0.0, x[1], x[2]]) / max(amplitude, 1e-300)
    sigma = np.sqrt(variance * float(along @ np.linalg.inv(design.T @ design) @ along))
    expected = EARTH_RATE * (1.0 if latitude is None else float(np.cos(latitude)))
    off = amplitude - expected
    if latitude is None and off < 0.0:
        return None
    if abs(off) <= _BEYOND * np.hypot(sigma, _SCALE * expected):
        return None
    where = "the Earth's rate" if latitude is None else (
        f"the Earth's horizontal rate at latitude {latitude / DEG:.4g} deg"
    )  # fmt: skip
    factor = amplitude / expected
    likely = [text for size, text in _MISREADINGS.items() if abs(np.log(factor / size)) < 0.05]
    advice = (
        f"a factor of {factor:.4g}, as of {likely[0]} (--gyro)" if likely
        else "check the unit (--gyro), the table angles, and that the axis is level"
    )  # fmt: skip
    return (
        f"the cosine's amplitude is {amplitude / DEG_PER_HOUR:.5g} ± "
        f"{sigma / DEG_PER_HOUR:.2g} deg/h, where {where} is {expected / DEG_PER_HOUR:.5g} deg/h: "
        f"{advice}"
    )


def _on_circle(design: Array, means: Array, x: Array, amplitude: float) -> Array:
    """Return bias, cosine and sine of the least squares with a known amplitude (Gauss-Newton)."""
    bias, north = float(x[0]), float(np.arctan2(x[2], x[1]))
    for _ in range(50):
        c, s = np.cos(north), np.sin(north)
        wave = amplitude * (design[:, 1] * c + design[:, 2] * s)
        slope = amplitude * (-design[:, 1] * s + design[:, 2] * c)
        step = np.linalg.lstsq(np.column_stack([np.ones(len(wave)), slope]), means - bias - wave,
                               rcond=None)[0]  # fmt: skip
        bias, north = bias + float(step[0]), north + float(step[1])
        if abs(step[1]) < 1e-13:
            break
    return np.array([bias, amplitude * np.cos(north), amplitude * np.sin(north)])


def load_readings(path: str | Path, unit: float) -> Array:
    r"""Return the last number of each row of a text file, times a unit.

    Rows without numbers, as headers and closing remarks in any encoding, are passed over; the
    rows that count are those with as many numbers as most have.

    Raises
    ------
    InputError
        If the file cannot be read or holds no rows of numbers.

    Examples
    --------
    >>> from pathlib import Path
    >>> length = Path("dwell.txt").write_text("time rate\n0 4.1\n1 4.3\n")
    >>> load_readings("dwell.txt", unit=0.5).tolist()
    [2.05, 2.15]
    """
    try:
        text = Path(path).read_bytes().decode("latin-1")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    rows: list[list[float]] = []
    for line in text.splitlines():
        cells = line.replace(",", " ").replace(";", " ").split()
        try:
            numbers = [float(cell) for cell in cells]
        except ValueError:
            continue
        if numbers:
            rows.append(numbers)
    if not rows:
        raise InputError(f"{path}: no rows of numbers in it")
    widths = np.array([len(row) for row in rows])
    usual = int(np.bincount(widths).argmax())
    values = np.array([row[-1] for row in rows if len(row) == usual])
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise InputError(f"{path}: reading {bad[0] + 1} is not a number")
    return np.asarray(values * unit)
