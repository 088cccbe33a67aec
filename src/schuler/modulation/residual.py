"""What a rotation scheme leaves of each error, averaged over its period; and a search for better.

In n (base at rest, heading 0) the gyro error is C (b + M w), with w the table's own rate plus
the Earth's, seen in the IMU. Averages of products of C and w say what is left of each term. White
noise is left as it is: a rotation does not change its power.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import multiply, quat_to_matrix, quat_to_rotvec
from schuler.constants import DEG, DEG_PER_HOUR, EARTH_RATE
from schuler.errors import InputError
from schuler.motion.rotation import Limits, Scheme
from schuler.motion.turntable import Dwell, Turn

__all__ = ["SchemeResidual", "optimise_scheme", "scheme_residual"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SchemeResidual:
    """Averages over one period of a scheme.

    Parameters
    ----------
    bias : (3, 3) float64
        Mean of C: how much of a bias of each IMU axis is left along east, north, up.
    matrix : (3, 3, 3) float64
        [i, j, k]: mean of C_ij w_k with the table's own rate w, rad/s: what an error M_jk (scale
        factor for j = k, misalignment beside it) leaves along i.
    asymmetry : (3, 3) float64
        Mean of C_ij |w_j|, rad/s: what a scale factor of other size for either sign leaves.
    earth : (3, 3, 3, 3) float64
        [i, j, k, l]: mean of C_ij C_lk: what M_jk leaves along i of a rate along l.
    swing : float
        Largest excursion of the integral of C - mean(C), s: a bias b makes an attitude ripple of
        b times it.
    period : float
        s.
    """

    bias: Array
    matrix: Array = field(repr=False)
    asymmetry: Array = field(repr=False)
    earth: Array = field(repr=False)
    swing: float
    period: float

    def to_dict(self, lat: float) -> dict[str, Any]:
        """Return the residuals in customary units, at a latitude (deg).

        Scale factor terms are for 1 ppm, misalignments for 1 arcsec, in deg/h.
        """
        earth = EARTH_RATE * np.array([0.0, np.cos(lat * DEG), np.sin(lat * DEG)])
        seen = np.einsum("ijkl,l->ijk", self.earth, earth)
        ppm, arcsec = 1e-6 / DEG_PER_HOUR, DEG / 3600.0 / DEG_PER_HOUR
        diagonal = np.einsum("ijj->ij", self.matrix)
        off = self.matrix.copy()
        for j in range(3):
            off[:, j, j] = 0.0
        return {
            "period_s": self.period,
            "bias_left": self.bias.tolist(),
            "scale_factor_with_table_deg_h_per_ppm": (ppm * diagonal).tolist(),
            "scale_factor_with_earth_deg_h_per_ppm": (
                ppm * np.einsum("ijj->ij", seen)
            ).tolist(),
            "asymmetry_deg_h_per_ppm": (ppm * self.asymmetry).tolist(),
            "misalignment_largest_deg_h_per_arcsec": float(arcsec * np.abs(off).max()),
            "random_walk_left": 1.0,
            "bias_ripple_s": self.swing,
        }  # fmt: skip


def scheme_residual(scheme: Scheme, step: float = 0.25) -> SchemeResidual:
    """Average a scheme's errors over its period.

    Parameters
    ----------
    scheme : Scheme
        One that comes back to its start; one that winds up (a spin) is averaged all the same, for
        its attitude repeats.
    step : float
        Of the quadrature (Simpson for C), s.

    Examples
    --------
    >>> from schuler.motion import named_scheme
    >>> left = scheme_residual(named_scheme("continuous"))
    >>> round(float(left.bias[2, 2]), 3)
    1.0
    """
    n = max(int(np.ceil(scheme.period / step)), 8)
    h = scheme.period / n
    # A period's end is its start again: the last edge is asked for just before it.
    edge = scheme.quaternion(np.minimum(h * np.arange(n + 1), scheme.period * (1 - 1e-12)))
    middle = scheme.quaternion(h * (np.arange(n) + 0.5))
    w = quat_to_rotvec(multiply(edge[:-1] * [1.0, -1.0, -1.0, -1.0], edge[1:])) / h
    c, ends = quat_to_matrix(middle), quat_to_matrix(edge)
    whole = (ends[:-1] + 4.0 * c + ends[1:]) / 6.0
    bias = whole.mean(axis=0)
    ripple = h * np.cumsum(whole - bias, axis=0)
    return SchemeResidual(
        bias,
        np.einsum("nij,nk->ijk", c, w) / n,
        np.einsum("nij,nj->ij", c, np.abs(w)) / n,
        np.einsum("nij,nlk->ijkl", c, c) / n,
        float(np.ptp(ripple, axis=0).max()),
        scheme.period,
    )


def _cost(found: SchemeResidual, weights: tuple[float, float, float, float]) -> float:
    """Return a mean drift, rad/s: 1 sigma bias, scale factor, misalignment, asymmetry."""
    bias, scale, misalignment, asymmetry = weights
    diagonal = np.einsum("ijj->ij", found.matrix)
    off = float(np.sum(found.matrix**2) - np.sum(diagonal**2))
    # The ripple of a bias starts a Schuler swing: a drift of its size over a radian of it.
    ripple = bias * found.swing * 1.24e-3
    return float(np.sqrt(
        bias**2 * np.sum(found.bias**2) + scale**2 * np.sum(diagonal**2)
        + misalignment**2 * off + asymmetry**2 * np.sum(found.asymmetry**2) + ripple**2
    ))  # fmt: skip


def optimise_scheme(
    turns: int = 16,
    *,
    bias: float = 0.01 * DEG_PER_HOUR,
    scale: float = 10e-6,
    misalignment: float = 10.0 * DEG / 3600.0,
    asymmetry: float = 1e-6,
    dwell: float = 20.0,
    limits: Limits | None = None,
    rng: np.random.Generator | None = None,
    tries: int = 400,
) -> tuple[Scheme, float]:
    """Search for the order of half turns about two axes that leaves the least mean drift.

    Parameters
    ----------
    turns : int
        Half turns in a period, even, 4 to 64.
    bias, scale, misalignment, asymmetry : float
        1 sigma of the gyros' errors: rad/s, ratios, rad.
    dwell : float
        After each turn, s.
    limits : Limits, optional
        A travel limit is kept.
    rng : numpy.random.Generator, optional
    tries : int
        Orders that are looked at.

    Returns
    -------
    Scheme, float
        The best, and the drift that it leaves, rad/s.

    Raises
    ------
    InputError
        For a number of turns that cannot close, or if no order keeps within the travel.

    Examples
    --------
    >>> best, drift = optimise_scheme(4, tries=4, rng=np.random.default_rng(1))
    >>> drift > 0.0
    True
    """
    if turns % 2 or not 4 <= turns <= 64:
        raise InputError(f"a scheme closes with an even number of half turns, 4 to 64, got {turns}")
    table = limits or Limits()
    rng = rng or np.random.default_rng(0)
    weights = (bias, scale, misalignment, asymmetry)
    choices = [(axis, sign) for axis in ("psi", "gamma") for sign in (180.0, -180.0)]

    def build(order: list[int]) -> Scheme | None:
        """Return the scheme of an order of turns; None where one cannot be made."""
        steps: list[Dwell | Turn] = []
        for k in order:
            axis, angle = choices[k]
            steps += [Dwell(dwell), Turn(axis, angle, table.rate, table.acceleration)]
        for axis in ("psi", "gamma"):
            if sum(choices[k][1] for k in order if choices[k][0] == axis) != 0.0:
                return None
        try:
            return Scheme(f"optimised-{turns}", tuple(steps), table)
        except InputError:
            return None

    def value(order: list[int]) -> tuple[float, Scheme | None]:
        scheme = build(order)
        return (
            (np.inf, None)
            if scheme is None
            else (_cost(scheme_residual(scheme, 2.0), weights), scheme)
        )

    best, best_scheme, current, now = np.inf, None, None, np.inf
    for k in range(tries):
        if current is None or k % 80 == 0:
            # Undone in order with the other sign, and again with the axes exchanged: closed by
            # construction, and much cancels; the first start is the classical one.
            fold = turns % 4 == 0
            part = rng.integers(0, 4, turns // (4 if fold else 2)).tolist()
            if k == 0:
                part = [(0, 2, 1, 3)[i % 4] for i in range(len(part))]
            order = part + [i ^ 1 for i in part]
            if fold:
                order += [i ^ 2 for i in order]
        else:
            order = list(current)
            a, b = rng.integers(0, turns, 2)
            if rng.random() < 0.5:
                order[a], order[b] = order[b], order[a]
            else:
                order[a], order[b] = order[a] ^ 1, order[b] ^ 1
        cost, scheme = value(order)
        if k % 80 == 0 or cost < now:
            current, now = order, cost
        if cost < best:
            best, best_scheme = cost, scheme
    if best_scheme is None:
        raise InputError("no order of half turns keeps within the table's travel: widen it")
    return best_scheme, best
