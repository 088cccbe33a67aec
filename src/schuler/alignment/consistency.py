"""Whether a record obeys what must be true: Earth rate, gravity, latitude, the instrument.

Every test is a function of the running sums, so that it streams. Each has a threshold whose
false-alarm probability is stated, and each is tested at that rate by Monte Carlo
(`tests/alignment/test_consistency.py`).

Earth rate. The normal equations of the optimal estimate are solved with the base free to turn at a
steady rate: about east and north, where gravity shows such a turn, without any prior; about up,
where nothing shows it, with the size that the turns about the level axes have (a settling vehicle
yaws about as much as it tilts). What is left of the gyro bias then contradicts the specification
where the chi-square of its observable part (eigenvectors of P0 - P) is beyond chance. Without a
specification, the least bias that explains the record becomes part of the uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.axes_consistency import AXES_MARGIN, AxesTest, axes_test, axes_text
from schuler.alignment.debias import bias_sigma
from schuler.alignment.history import History
from schuler.alignment.stationary.gains import NormalEquations
from schuler.alignment.stationary.optimal import OptimalAlignment
from schuler.constants import ARCSEC, DEG, DEG_PER_HOUR, EARTH_RATE, MICRO_G
from schuler.earth import Site
from schuler.estimate.chi_square import chi_square_tail
from schuler.record import Summary
from schuler.sensors import ImuSpec

__all__ = [
    "DOUBT",
    "FALSE_ALARM",
    "Consistency",
    "Contradiction",
    "EarthRateTest",
    "check",
    "earth_rate_test",
    "gravity_test",
]

Array = NDArray[np.float64]

FALSE_ALARM = 3e-4
"""Probability that a test of a good record contradicts it."""

DOUBT = 0.01
"""Chance of the gyro bias that a record shows below which sigma holds more than the specified one.

Between it and `FALSE_ALARM` nothing is contradicted; one good record in 100 comes below it.
"""

_LEAST_DEFLECTION = 0.1 * ARCSEC
"""No level is known better, and no accelerometer is tested beyond it, rad."""

_HEIGHT_SIGMA = 200.0
"""Of a height that somebody typed in, m."""

_GROSS = 1.0 * DEG_PER_HOUR
"""Without a specification a smaller bias is no contradiction, whatever else would explain it."""


@dataclass(frozen=True)
class Contradiction:
    """Something that the record shows and that cannot be.

    Parameters
    ----------
    kind : str
        ``earth-rate``, ``axes``, ``gravity`` or ``rest``.
    text : str
        One sentence: what is, what must be, what would explain it.
    """

    kind: str
    text: str


@dataclass(frozen=True)
class EarthRateTest:
    """The gyro bias that the record shows, held against its prior.

    Parameters
    ----------
    statistic : float
        Chi-square of the observable part of the biases.
    freedom : int
        Its degrees of freedom.
    probability : float
        Of a statistic as large by chance.
    least_bias : float
        Smallest 1-sigma bias of one gyro that explains the record, rad/s; the prior itself where
        that does.
    hidden_bias : float
        1-sigma of a bias of one gyro that the record would not show, rad/s.
    north, up : float
        Excess of the rate about north and up over the Earth's, rad/s.
    base_rate : float
        Yaw rate of the base (1-sigma) that was allowed for, rad/s.
    accel_probability, accel_bias : float
        The same of the accelerometers, and the largest bias seen, m/s^2.
    """

    statistic: float
    freedom: int
    probability: float
    least_bias: float
    hidden_bias: float
    north: float
    up: float
    base_rate: float
    accel_probability: float
    accel_bias: float


@dataclass(frozen=True)
class Consistency:
    """What the tests of a record found.

    Parameters
    ----------
    contradictions : tuple of Contradiction
    earth_rate : EarthRateTest or None
        None where the unit turns all the time.
    axes : AxesTest or None
        None for a record that is too short.
    least_bias : float
        1-sigma of one gyro's bias that the uncertainty must hold, rad/s.
    """

    contradictions: tuple[Contradiction, ...]
    earth_rate: EarthRateTest | None
    axes: AxesTest | None
    least_bias: float


# -- Earth rate ------------------------------------------------------------------------


_SHARE = {"gyro": 0.02, "accelerometer": 1.0}
"""A bias of which the record shows less, relative to its prior's information, is not tested.

Below it a gyro's bias is known seven times worse than its prior. What a single position shows of an
accelerometer's is second order, so it must be known better than its prior, as by several dwells.
"""

_FINE = 1.2 * DEG_PER_HOUR
"""A gyro's bias that is known better than this (1-sigma) is tested whatever its prior."""

_DIGITS = 1e-9
"""Share of the information that its elimination leaves uncertain."""

_UNSPECIFIED_GYRO = 0.05 * DEG_PER_HOUR
"""Without a specification, biases are tested that a record shows to thirty times this, rad/s."""


@dataclass(frozen=True, eq=False)
class _Observable:
    """The part of a triad's biases that a record shows: k values with variances.

    Parameters
    ----------
    vectors : (3, k) float64
    value, variance : (k,) float64
        rad/s or m/s^2.
    """

    vectors: Array
    value: Array
    variance: Array

    @classmethod
    def of(cls, normal: NormalEquations, which: str, prior: Array, unit: float) -> _Observable:
        """Make it.

        Parameters
        ----------
        normal : NormalEquations
        which : {"gyro", "accelerometer"}
        prior : (n,) float64
            1-sigma of all else.
        unit : float
            Scale of what is expected, rad/s or m/s^2.
        """
        columns = NormalEquations.GYRO if which == "gyro" else NormalEquations.ACCEL
        information, right = normal.marginal(columns, prior)
        weight, vectors = np.linalg.eigh(information)
        # What is below the digits of the elimination is not seen either.
        whole = float(np.diag(normal.information)[columns].max())
        wanted = _SHARE[which] / unit**2
        if which == "gyro":
            wanted = min(wanted, 1.0 / _FINE**2)
        seen = weight > max(wanted, _DIGITS * whole)
        return cls(vectors[:, seen], (vectors.T @ right)[seen] / weight[seen], 1.0 / weight[seen])

    def statistic(self, prior: float) -> float:
        """Return the chi-square of the values against a prior about zero."""
        return float(np.sum(self.value**2 / (self.variance + prior**2)))

    def probability(self, prior: float) -> float:
        """Return how likely chance makes as large a chi-square."""
        k = len(self.value)
        return chi_square_tail(k, self.statistic(prior)) if k else 1.0

    def likely(self) -> float:
        """Return twice the 1-sigma of a bias that makes the values likeliest.

        Twice, because one or two values say little of the size of what made them.
        """
        sizes = np.geomspace(1e-3, 1e4, 140) * float(np.sqrt(self.variance.min()))
        total = self.variance[:, None] + sizes**2
        log = -0.5 * np.sum(np.log(total) + self.value[:, None] ** 2 / total, axis=0)
        return 2.0 * float(sizes[np.argmax(log)])

    def hidden(self) -> float:
        """Return the size of a bias that is as large as the noise of what is best seen."""
        return float(np.sqrt(self.variance.min())) if len(self.variance) else 0.0

    @property
    def bias(self) -> Array:
        """The biases as far as they are seen, (3,)."""
        return np.asarray(self.vectors @ self.value)


def earth_rate_test(
    best: OptimalAlignment, site: Site, spec: ImuSpec | None, up: Array, north: Array,
    latitude_known: bool = True,
) -> EarthRateTest:  # fmt: skip
    """Hold the gyro bias that a record shows against its prior.

    Parameters
    ----------
    best : OptimalAlignment
        The optimal estimate.
    site : Site
    spec : ImuSpec or None
        Without one the prior is that there is no bias.
    up, north : (3,) float64
        Of the level frame in body axes, in the middle of the record.
    latitude_known : bool
        False where the site's was found in the same record, which fits it as far as it can.
    """
    normal = best.normal
    force = site.gravity
    # Deflection of the vertical acts like a bias of the accelerometers.
    accel = max(site.deflection, _LEAST_DEFLECTION) * force
    gyro = 0.0
    if spec is not None:
        gyro = bias_sigma(spec.gyro, force)
        accel = float(np.hypot(accel, bias_sigma(spec.accelerometer, force)))
    scale = gyro or _UNSPECIFIED_GYRO
    # What a base yaws with its tilting, and what two tilts make of yaw to second order.
    yaw = float(np.hypot(normal.base_rate(scale, accel)[0], best.tilt / best.history.duration))
    prior = normal.priors(scale, accel, (np.inf, np.inf, yaw), latitude_known)
    seen = _Observable.of(normal, "gyro", prior, scale)
    probability = seen.probability(gyro)
    doubted = FALSE_ALARM if spec is None else DOUBT
    least = max(gyro, seen.likely()) if probability < doubted else gyro
    bias = seen.bias
    held = _Observable.of(normal, "accelerometer", prior, accel)
    return EarthRateTest(
        seen.statistic(gyro), len(seen.value), probability, least, seen.hidden(),
        float(bias @ north), float(bias @ up), yaw, held.probability(accel),
        float(np.abs(held.bias).max()) if len(held.value) else 0.0,
    )  # fmt: skip


def _degrees_per_hour(rate: float) -> str:
    return f"{rate / DEG_PER_HOUR:.3g} deg/h"


def _earth_rate_text(
    found: EarthRateTest, site: Site, mean_rate: Array, up: Array, bias: float
) -> str:
    """Say what the rate is, what it must be, and which reading would be consistent."""
    _, must_north, must_up = site.earth_rate
    # The base's own yaw, which the estimate allows for, is left in.
    is_up = float(mean_rate @ up)
    is_north = abs(must_north + found.north)
    text = (
        f"the gyros' mean rate is {_degrees_per_hour(is_north)} horizontal and "
        f"{_degrees_per_hour(is_up)} up, where the Earth's at latitude {site.lat:.4g} deg is "
        f"{_degrees_per_hour(must_north)} and {_degrees_per_hour(must_up)}; a gyro bias of at "
        f"least {_degrees_per_hour(found.least_bias)} would explain it"
    )
    if bias > 0:
        text += f", where {_degrees_per_hour(bias)} is specified"
    size = float(np.hypot(is_up, is_north))
    readings = []
    if abs(size - EARTH_RATE) < 0.25 * EARTH_RATE:
        own = float(np.arctan2(is_up, is_north)) / DEG
        if abs(own + site.lat) < min(10.0, abs(site.lat)):
            readings.append("with the other sign of the accelerometers")
            readings.append(f"with the other sign of the latitude ({-site.lat:g} deg)")
        elif abs(own - site.lat) > 0.5:
            readings.append(f"at latitude {own:.1f} deg")
    if readings:
        text += f"; {' or '.join(readings)} it would be consistent"
    elif 0.0 < bias < found.least_bias < DEG * EARTH_RATE:
        # Good gyros tell a latitude that was rounded, though not which one is right.
        text += f"; is the latitude right to {bias / EARTH_RATE / DEG:.1g} deg?"
    return text


# -- gravity ---------------------------------------------------------------------------


def gravity_test(summary: Summary, site: Site, spec: ImuSpec | None) -> Contradiction | None:
    """Hold the length of the force against gravity and the specified accelerometers.

    The threshold is six times the 1-sigma of bias, scale, gravity anomaly and height together,
    and not less than 500 ug: a false alarm of 2e-9 for Gaussian errors. Without a specification
    0.5 % are left to the accelerometers' scale, as `Summary.hints` does.
    """
    gravity = site.gravity
    off = summary.steady_force(gravity) - gravity
    if spec is None:
        return None
    sigma = np.hypot(bias_sigma(spec.accelerometer, gravity), site.gravity_uncertainty)
    sigma = np.hypot(sigma, 3.086e-6 * _HEIGHT_SIGMA)
    # A vehicle that works has a mean force of its own over a short record.
    size = summary.stretch_sums.sum_force / summary.stretch_sums.samples
    sigma = np.hypot(sigma, np.std(size) / np.sqrt(max(len(size) / 4.0, 1.0)))
    if abs(off) <= max(6.0 * sigma, 500.0 * MICRO_G):
        return None
    return Contradiction(
        "gravity",
        f"the mean force is {gravity + off:.5f} m/s^2, where gravity at the site is {gravity:.5f}: "
        f"an accelerometer bias of {off / MICRO_G:.0f} ug, where "
        f"{spec.accelerometer.bias / MICRO_G:.3g} ug is specified; check the accelerometers' unit "
        "and scale, the height and the specification",
    )


# -- all together ----------------------------------------------------------------------


def check(
    h: History, best: OptimalAlignment, summary: Summary, site: Site, spec: ImuSpec | None,
    latitude_known: bool = True,
) -> Consistency:  # fmt: skip
    """Return what contradicts a record, and the gyro bias that its uncertainty must hold.

    Parameters
    ----------
    h : History
        Not thinned.
    best : OptimalAlignment
        The optimal estimate of it.
    summary : Summary
    site : Site
    spec : ImuSpec or None
    latitude_known : bool
        False where the site's was found in the same record.
    """
    from schuler.alignment.history import inertial_to_local

    contradictions: list[Contradiction] = []
    thin = best.history
    axes = axes_test(h, [(float(thin.t[i]), float(thin.t[j])) for i, j in best.dwells])
    if axes is not None and axes.margin >= AXES_MARGIN:
        contradictions.append(Contradiction("axes", axes_text(axes)))
    found: EarthRateTest | None = None
    least = 0.0
    if best.dwells:
        middle = len(best.attitude) // 2
        t = 0.5 * float(thin.t[middle] + thin.t[middle + 1])
        c_nb = inertial_to_local(t, site.latitude) @ best.attitude[middle]
        found = earth_rate_test(best, site, spec, c_nb[2], c_nb[1], latitude_known)
        if found.probability < (FALSE_ALARM if spec is None else DOUBT):
            least = found.least_bias
        if found.probability < FALSE_ALARM:
            bias = 0.0 if spec is None else spec.gyro.bias
            text = _earth_rate_text(found, site, summary.mean_rate, c_nb[2], bias)
            if spec is not None or (least > _GROSS and "it would be consistent" in text):
                contradictions.append(Contradiction("earth-rate", text))
        if spec is not None and found.accel_probability < FALSE_ALARM:
            contradictions.append(
                Contradiction(
                    "accelerometer-bias",
                    f"the dwells show an accelerometer bias of {found.accel_bias / MICRO_G:.3g} "
                    f"ug, where {spec.accelerometer.bias / MICRO_G:.3g} ug is specified; do the "
                    "turns between them agree with the axes?",
                )
            )
    gravity = gravity_test(summary, site, spec)
    if gravity is not None:
        contradictions.append(gravity)
    return Consistency(tuple(contradictions), found, axes, least)
