"""Coarse alignment in motion: one rotation between two series of vectors, with its uncertainty.

The rotation comes from Wahba's problem on sums that are centred (freed of a line for positions),
so that nothing of the start need be known; the sums are cumulative, and any window of them costs
nothing. One linear step then weighs each axis by its noise and lets the biases of the instrument,
with the specification as their prior, explain what a rotation cannot: long windows lose nothing.
White noise of the sensors makes random walks of x; what they do to the result follows from the
step's gains.

Source: Wu and Pan (2013), optimisation-based alignment in motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.attitude import quat_to_matrix, rotvec_to_quat
from schuler.constants import DEG
from schuler.errors import InputError
from schuler.in_motion.earth_side import local_axes, spun
from schuler.in_motion.rotation import LEAST_ROWS, Sums, robust_weights
from schuler.in_motion.series import Series
from schuler.sensors import ImuSpec
from schuler.units import time_text

__all__ = ["CoarseAlignment", "coarse", "missing"]

Array = NDArray[np.float64]

ENOUGH = 20.0 * DEG
"""1-sigma of the heading beyond which there is none."""

_LEAST_WINDOW = 12
"""Fewer measurements are no window of a longer span."""

_SHARES = (1.0, 0.75, 0.5, 0.35, 0.25)
"""Windows that are tried, as parts of the span."""

_LARGEST_STEP = 0.2
"""Of the linear step, rad."""

_MOST_STEPS, _SETTLED = 8, 0.03
"""Steps, and the size of one, in 1-sigma, after which there is none more."""

_DELAY = 0.3
"""1-sigma of a delay before anything is measured, s."""


@dataclass(frozen=True, eq=False)
class CoarseAlignment:
    """An attitude found without one to start from.

    Parameters
    ----------
    form : str
        Of the series.
    time : float
        Instant of the attitude, s.
    mat_nb : (3, 3) float64
        East-North-Up where the vehicle was then.
    mat_i0_ib0 : (3, 3) float64
        The rotation of the window.
    budget : dict of str to (3, 3) float64
        Covariance of phi by source, rad^2, in n.
    gyro_bias, accelerometer_bias : (3,) float64
        rad/s, m/s^2.
    delay : float
        What the aid's delay is beyond the one that it had, s; 0 where it is not estimated.
    window : (float, float)
        Begin and end of what was used, s.
    rows, refused : int
        Instants that were used, and those that have no weight.
    ratio : float
        Residuals beside their sigma, rms.
    """

    form: str
    time: float
    mat_nb: Array
    mat_i0_ib0: Array
    budget: dict[str, Array]
    gyro_bias: Array
    accelerometer_bias: Array
    delay: float
    window: tuple[float, float]
    rows: int
    refused: int
    ratio: float

    @property
    def covariance(self) -> Array:
        """Of phi, rad^2, (3, 3)."""
        return np.asarray(sum(self.budget.values(), np.zeros((3, 3))))

    @property
    def heading_sigma(self) -> float:
        """1-sigma about up, rad."""
        return float(np.sqrt(self.covariance[2, 2]))


def coarse(
    series: Series, spec: ImuSpec, place: tuple[float, float], time: float, end: Array,
    turn: Array, *, estimate_delay: bool = False, choose: bool = True, noise: float = 1.0,
    removed: Array | None = None,
) -> CoarseAlignment:  # fmt: skip
    """Return the best attitude that a series gives at an instant.

    Parameters
    ----------
    series : Series
    spec : ImuSpec
        The instrument: prior of the biases, and the noise that x gathers.
    place : (float, float)
        Latitude and longitude at the instant, rad.
    time : float
        The instant, s.
    end, turn : (3, 3) float64
        mat_ib0_b at the instant, and its integral from the start of the pass to there.
    estimate_delay : bool
    choose : bool
        Choose the window by the least sigma, and not take all rows.
    noise : float
        Factor of the stated sigma of the measurements.
    removed : (3,) float64, optional
        Gyro bias that was taken off the series, rad/s: the prior is that of the whole bias.

    Raises
    ------
    InputError
        If there are too few rows, or they show no heading; it says what is missing.

    Examples
    --------
    >>> from schuler.in_motion.body import body_rows
    >>> from schuler.in_motion.series import velocity_series
    >>> series = velocity_series(body_rows(drive, gnss.time), gnss)
    >>> place = site.latitude, site.longitude
    >>> found = coarse(series, spec, place, drive.start, np.eye(3), np.zeros((3, 3)))
    >>> bool(found.heading_sigma < 0.1)
    True
    """
    n = len(series)
    if n < LEAST_ROWS:
        raise InputError(f"{n} measurements lie in the span: an alignment needs {LEAST_ROWS}")
    taken_off = np.zeros(3) if removed is None else removed

    def solved(cut: slice, weights: Array) -> CoarseAlignment:
        window = _Window(series, spec, weights, cut, noise, estimate_delay, taken_off)
        return window.solved(place, time, end, turn)

    best: CoarseAlignment | None = None
    none_agree: InputError | None = None
    shares: tuple[float, ...] = _SHARES if choose else _SHARES[:1]
    try:
        weights = robust_weights(series, noise)
    except InputError as error:
        if not choose:
            raise
        # Over a shorter window they may.
        none_agree, shares, weights = error, (), np.zeros(n)
    at_start = time < 0.5 * (series.rows.time[0] + series.rows.time[-1])
    for share in shares:
        count = max(round(share * n), min(n, _LEAST_WINDOW))
        # A shorter window is the one that is nearest to the instant.
        cut = slice(0, count) if at_start else slice(n - count, n)
        found = solved(cut, weights)
        if best is None or found.heading_sigma < best.heading_sigma:
            best = found
        if count <= _LEAST_WINDOW:
            break
    if choose and (best is None or best.heading_sigma > ENOUGH):
        # A gyro with a large bias holds ib0 for a short while only: the turns may come later.
        for cut in _elsewhere(n):
            try:
                own = np.zeros(n)
                own[cut] = robust_weights(series.between(cut.start, cut.stop), noise)
            except InputError:
                continue
            found = solved(cut, own)
            if best is None or found.heading_sigma < best.heading_sigma:
                best = found
    if best is None:
        assert none_agree is not None
        raise none_agree
    return best


def _elsewhere(n: int) -> list[slice]:
    """Return windows that lie anywhere in n rows, a half over the one before, each kind halved."""
    cuts = []
    count = n
    while count > _LEAST_WINDOW:
        count = max(count // 2, _LEAST_WINDOW)
        cuts += [slice(k, k + count) for k in range(0, n - count + 1, count // 2)]
    return cuts


class _Window:
    """The linear step of one window: unknowns, gains, covariance by source."""

    def __init__(
        self, series: Series, spec: ImuSpec, weights: Array, cut: slice, noise: float,
        delay: bool, removed: Array,
    ) -> None:  # fmt: skip
        self.series = series.between(cut.start, cut.stop)
        self.weights = weights[cut]
        self.first = cut.start
        self.spec, self.delayed, self.noise = spec, delay, noise
        self.removed = removed
        self.whole = series

    def solved(
        self, place: tuple[float, float], time: float, end: Array, turn: Array
    ) -> CoarseAlignment:
        """Return the attitude of the window at an instant, with biases and delay by linear steps.

        Parameters
        ----------
        place : (float, float)
            Latitude and longitude, rad.
        time : float
            s.
        end, turn : (3, 3) float64
            C_b^ib0 at the instant, and the integral of C up to it.
        """
        s, spec = self.series, self.spec
        power = np.trace(s.noise, axis1=1, axis2=2) / 3.0
        mat = Sums(s, self.weights * np.median(power) / power).rotation()
        root = np.linalg.cholesky(np.linalg.inv(self.noise**2 * s.noise))
        white = np.sqrt(self.weights)[:, None, None] * np.swapaxes(root, 1, 2)
        bias, late = np.zeros(6), 0.0
        prior = np.array([
            *[max(spec.gyro.bias, 1e-12)] * 3, *[max(spec.accelerometer.bias, 1e-9)] * 3,
            *([_DELAY] if self.delayed else []),
        ])  # fmt: skip
        b = slice(3, 3 + len(prior))
        for _ in range(_MOST_STEPS):
            # The prior is that of the whole bias, and not of what is left of it.
            x = s.x - s.by_gyro @ bias[:3] - s.by_accelerometer @ bias[3:] - late * s.slope
            h = self._rows(mat, x)
            a = (white @ h).reshape(-1, h.shape[2])
            whole = bias + np.concatenate([self.removed, np.zeros(3)])
            now = np.array([*whole, *([late] if self.delayed else [])])
            y = np.einsum("iab,ib->ia", white, s.y - x @ mat.T).ravel()
            normal, right = a.T @ a, a.T @ y
            normal[b, b] += np.diag(prior**-2.0)
            right[b] -= now / prior**2
            # Of an angle nothing is known beforehand: the variance of a uniform one.
            normal[:3, :3] += np.eye(3) * 3.0 / np.pi**2
            scale = 1.0 / np.sqrt(np.diag(normal))
            inverse = np.linalg.inv(scale[:, None] * normal * scale).astype(np.float64)
            inverse = np.asarray(scale[:, None] * inverse * scale, np.float64)
            step = inverse @ right
            # Where phi is hardly observable, a step is no larger than what linear rows bear.
            phi = step[:3] * min(1.0, _LARGEST_STEP / max(float(np.linalg.norm(step[:3])), 1e-12))
            mat = np.asarray(quat_to_matrix(rotvec_to_quat(phi)) @ mat)
            bias = bias + step[3:9]
            late += float(step[9]) if self.delayed else 0.0
            far = float(np.max(np.abs(step[:9]) / np.sqrt(np.diag(inverse)[:9])))
            if far < _SETTLED:
                break
        found = self._result(mat, bias, late, inverse, white, h, prior, place, time, end, turn)
        if far > 10.0 * _SETTLED:
            # What does not settle was linear about an attitude that is none.
            found.budget["aiding"] = found.budget["aiding"] + np.eye(3) * np.pi**2 / 3.0
        return found

    def _rows(self, mat: Array, x: Array) -> Array:
        """Return the rows (n, 3, m) of what a residual is by the unknowns."""
        s = self.series
        turned = x @ mat.T
        o = np.zeros(len(s))
        cross = np.stack([
            np.stack([o, turned[:, 2], -turned[:, 1]], -1),
            np.stack([-turned[:, 2], o, turned[:, 0]], -1),
            np.stack([turned[:, 1], -turned[:, 0], o], -1),
        ], axis=1)  # fmt: skip
        parts = [cross, -mat @ s.by_gyro, -mat @ s.by_accelerometer]
        if self.delayed:
            parts.append(-(s.slope @ mat.T)[:, :, None])
        parts += [column[:, None, None] * np.eye(3) for column in _scaled(s.nuisance).T]
        return np.concatenate(parts, axis=2)

    def _result(
        self, mat: Array, bias: Array, late: float, inverse: Array, white: Array, h: Array,
        prior: Array, place: tuple[float, float], time: float, end: Array, turn: Array,
    ) -> CoarseAlignment:  # fmt: skip
        s = self.series
        t_end = time - s.rows.start
        # phi at the instant, i0: of the rotation, and of what the gyro bias did to the tracking.
        combine = np.zeros((3, inverse.shape[0]))
        combine[:, :3], combine[:, 3:6] = np.eye(3), -mat @ turn
        gain = np.einsum("ab,icb,icd->iad", combine @ inverse, white @ h, white)
        parts = {"aiding": np.einsum("iab,ibc,idc->ad", gain, self.noise**2 * s.noise, gain)}
        part = combine @ inverse
        parts["aiding"] = parts["aiding"] + 3.0 / np.pi**2 * part[:, :3] @ part[:, :3].T
        for name, at in (("gyro_bias", slice(3, 6)), ("accelerometer_bias", slice(6, 9))):
            k = part[:, at] / prior[at.start - 3 : at.stop - 3]
            parts[name] = k @ k.T
        if self.delayed:
            k = part[:, 9:10] / prior[6]
            parts["aiding"] = parts["aiding"] + k @ k.T
        parts |= self._walks(mat, gain, t_end)
        x = s.x - s.by_gyro @ bias[:3] - s.by_accelerometer @ bias[3:] - late * s.slope
        left = s.y - x @ mat.T
        root = np.sqrt(self.weights)[:, None]
        fit, *_ = np.linalg.lstsq(root * s.nuisance, root * left, rcond=None)
        left = np.einsum("iab,ib->ia", white, left - s.nuisance @ fit)
        free = max(3.0 * float(self.weights.sum()) - 3.0 - 3.0 * s.nuisance.shape[1], 1.0)
        ratio = float(np.sqrt(np.sum(left**2) / free))
        lat, lon = place
        turn_i0 = np.linalg.inv(quat_to_matrix(rotvec_to_quat(mat @ turn @ bias[:3])))
        axes = spun(np.array(t_end), local_axes(np.array(lat), np.array(lon)).T).T
        budget = {name: axes.T @ p @ axes for name, p in parts.items()}
        return CoarseAlignment(
            s.form, time, axes.T @ turn_i0 @ mat @ end, mat, budget, bias[:3], bias[3:], late,
            (float(s.rows.time[0]), float(s.rows.time[-1])), int(np.sum(self.weights > 0.0)),
            int(np.sum(self.weights == 0.0)), ratio,
        )  # fmt: skip

    def _walks(self, mat: Array, gain: Array, t_end: float) -> dict[str, Array]:
        """Return what the sensors' white noise does through the random walks in x."""
        s, spec = self.series, self.spec
        # Walks begin before the window; that part of them the window's own unknowns take up.
        t = np.concatenate([[0.0], self.whole.t])
        v = np.concatenate([np.zeros((1, 3)), self.whole.rows.velocity])
        r = np.concatenate([np.zeros((1, 3)), self.whole.rows.way])
        k = np.zeros((len(t) - 1, 3, 3))
        k[self.first : self.first + len(s)] = gain @ mat
        step, middle = np.diff(t), 0.5 * (t[1:] + t[:-1])
        mean_v = 0.5 * (v[1:] + v[:-1])

        def later(rows: Array) -> Array:
            """Return sums of rows from each on."""
            return np.cumsum(rows[::-1], axis=0)[::-1]

        ones = later(k)
        if s.form == "position":
            lever, mean = self.whole.x - self.whole.rows.way, 0.5 * (r[1:] + r[:-1])
            times = later(t[1:, None, None] * k)
            force = times - middle[:, None, None] * ones
            turning = (
                later(k @ _cross_rows(r[1:] + lever)) - ones @ _cross_rows(mean)
                - force @ _cross_rows(mean_v)
            )  # fmt: skip
        else:
            # A lever arm's or a body's own velocity turns with ib0 and is no integral.
            own = self.whole.x - self.whole.rows.velocity
            force = ones
            turning = later(k @ _cross_rows(v[1:] + own)) - ones @ _cross_rows(mean_v)
        turning = -turning
        force = -force
        before = np.clip((t_end - t[:-1]) / np.maximum(step, 1e-12), 0.0, 1.0)
        whole = turning - before[:, None, None] * mat
        gyro = spec.gyro.white**2 * np.einsum("i,iab,icb->ac", step, whole, whole)
        accel = spec.accelerometer.white**2 * np.einsum("i,iab,icb->ac", step, force, force)
        return {
            "gyro_angle_random_walk": gyro, "accelerometer_velocity_random_walk": accel,
        }  # fmt: skip


def _cross_rows(v: Array) -> Array:
    o = np.zeros(len(v))
    return np.stack([
        np.stack([o, -v[:, 2], v[:, 1]], -1), np.stack([v[:, 2], o, -v[:, 0]], -1),
        np.stack([-v[:, 1], v[:, 0], o], -1),
    ], axis=1)  # fmt: skip


def _scaled(nuisance: Array) -> Array:
    """Return the nuisance functions with a size of one."""
    return np.asarray(nuisance / np.max(np.abs(nuisance), axis=0))


def missing(found: CoarseAlignment, series: Series) -> str:
    """Return what a span lacks that shows no heading, in a sentence."""
    t = series.rows.time
    span = f"the {t[-1] - t[0]:.4g} s from t = {time_text(t[0])} s"
    sigma = f" (1-sigma {found.heading_sigma / DEG:.0f} deg)"
    if series.form == "body velocity":
        return (
            f"{span} show no heading{sigma}: a velocity in body axes leaves it to the Earth's "
            "rotation, for which this instrument is too coarse or the span too short: take "
            "longer, or give GNSS fixes"
        )
    return (
        f"{span} show no heading{sigma}: no acceleration in this span: brake or turn, or take a "
        "longer span"
    )
