"""`FilterState`: what an error-state filter has estimated so far, as its kernel keeps it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.earth import Site
from schuler.errors import InputError
from schuler.ins.custom import State
from schuler.ins.dynamics import ProcessNoise
from schuler.ins.frames import frame_quaternion
from schuler.ins.layout import Layout
from schuler.kernels import ins_layout as kernel
from schuler.kernels.states import StrapdownOptions

__all__ = ["FilterState"]

Array = NDArray[np.float64]

_SOURCES = {"gyro_": "gyro_bias", "accelerometer_": "accelerometer_bias", "motion": "disturbance"}
"""Source of a group's prior, by how its name begins; "start" for all others."""


class FilterState:
    """Navigation, error estimates and their covariance, now.

    Parameters
    ----------
    layout : Layout
    site : Site
    quat_nb : (4,) array_like
    covariance : (n, n) array_like
    noise : ProcessNoise
    v_n : (3,) array_like
    error_state : (n,) array_like
    parameters : dict of str to array_like
    fixed_place : bool
    earth_rate : (3,) array_like or None
    feedback, budget : bool
    step : float
    force_at_rest, vertical : bool
        All as in `ErrorStateFilter`.

    Raises
    ------
    InputError
        For arrays of another shape, or numbers that are not finite.

    Examples
    --------
    >>> from schuler.ins import ErrorStateFilter, ProcessNoise
    >>> layout = Layout(["phi", "velocity"])
    >>> noise = ProcessNoise.of(layout, {})
    >>> flt = ErrorStateFilter(layout, site, [1.0, 0.0, 0.0, 0.0], 1e-6 * np.eye(6), noise)
    >>> isinstance(flt, FilterState), flt.samples, flt.height
    (True, 0, 500.0)
    """

    def __init__(
        self,
        layout: Layout,
        site: Site,
        quat_nb: ArrayLike,
        covariance: ArrayLike,
        noise: ProcessNoise,
        *,
        v_n: ArrayLike,
        error_state: ArrayLike,
        parameters: Mapping[str, ArrayLike],
        fixed_place: bool,
        earth_rate: ArrayLike | None,
        feedback: bool,
        budget: bool,
        step: float,
        force_at_rest: bool,
        vertical: bool,
    ) -> None:
        from schuler.kernels import strapdown

        self.layout, self.noise = layout, noise
        n, size = layout.size, layout.padded
        p = np.asarray(covariance, np.float64)
        q, v = np.asarray(quat_nb, np.float64), np.asarray(v_n, np.float64)
        if p.shape != (n, n) or not np.all(np.isfinite(p)):
            raise InputError(f"the filter has {n} states: expected a finite ({n}, {n}) covariance")
        if q.shape != (4,) or not abs(np.linalg.norm(q) - 1.0) < 1e-6:
            raise InputError("a filter starts from a unit quaternion of four numbers")
        if v.shape != (3,) or not np.all(np.isfinite(v)):
            raise InputError("a filter starts from three finite velocities: east, north, up")
        if not step > 0.0:
            raise InputError(f"the step of the covariance must be a positive time, got {step} s")
        self._state = np.zeros(kernel.STATE_SIZE)
        self._state[kernel.QUAT_NB : kernel.QUAT_NB + 4] = q / np.linalg.norm(q)
        self._state[kernel.QUAT_START : kernel.QUAT_START + 4] = q / np.linalg.norm(q)
        self._state[kernel.V_N : kernel.V_N + 3] = v
        self._state[kernel.QUAT_NE : kernel.QUAT_NE + 4] = frame_quaternion(
            site.latitude, site.longitude
        )
        self._state[kernel.HEIGHT] = site.height
        self._survey = np.zeros(strapdown.STATE_SIZE)
        self._est, self._x = np.zeros(size), np.zeros(size)
        self._x[:n] = error_state
        for name, value in parameters.items():
            self._est[layout[name]] = value
        self._p = np.zeros((size, size))
        self._p[:n, :n] = 0.5 * (p + p.T)
        self._parts = self._split(p) if budget else np.zeros((0, size, size))
        self._cfg = np.zeros(kernel.CFG_SIZE)
        self._cfg[kernel.FIXED_PLACE] = fixed_place
        self._cfg[kernel.EARTH : kernel.EARTH + 3] = (
            site.earth_rate if earth_rate is None else earth_rate
        )
        self._cfg[kernel.GRAVITY] = site.gravity
        self._cfg[kernel.FORCE_AT_REST] = force_at_rest
        self._cfg[kernel.VERTICAL] = not vertical
        self._cfg[kernel.STEP], self._cfg[kernel.FEEDBACK] = step, feedback
        options = StrapdownOptions.zeros()
        options.gravity_model = strapdown.SOMIGLIANA
        options.vertical_mode = strapdown.FREE if vertical else strapdown.OFF
        self._options = options.data
        place = self._state[kernel.QUAT_NE : kernel.QUAT_NE + 4].copy()
        self._start = (self.quat_nb, self.v_n, place, site.height)

    def _split(self, p: Array) -> Array:
        """Return the covariance at the start by source."""
        layout, sources = self.layout, self.noise.sources
        owner = np.zeros(layout.padded, np.int64)
        for name in layout:
            source = next((s for begin, s in _SOURCES.items() if name.startswith(begin)), "start")
            owner[layout[name]] = sources.index(source)
        parts = np.zeros((len(sources), layout.padded, layout.padded))
        n = layout.size
        for k in range(len(sources)):
            own = owner[:n] == k
            parts[k, :n, :n] = np.where(np.outer(own, own), p, 0.0)
        if not np.allclose(parts.sum(axis=0)[:n, :n], p, rtol=1e-9, atol=0.0):
            raise InputError("a covariance between states of different sources has no budget")
        return parts

    def _view(self, index: int) -> State:
        from schuler.attitude import quat_to_matrix

        s = self._state
        frame = quat_to_matrix(s[kernel.QUAT_NE : kernel.QUAT_NE + 4])
        up = frame[:, 2]
        lat, lon = np.arctan2(up[2], np.hypot(up[0], up[1])), np.arctan2(up[1], up[0])
        x, y, _ = frame.T @ [-np.sin(lon), np.cos(lon), 0.0]
        return State(
            self.time, self.quat_nb, self.v_n, s[kernel.RATE_B : kernel.RATE_B + 3].copy(),
            float(lat), float(lon), float(s[kernel.HEIGHT]), float(np.arctan2(y, x)),
            {name: self.parameter(name) for name in self._parameters()}, self.layout, index,
        )  # fmt: skip

    def _parameters(self) -> list[str]:
        return [name for name in self.layout if name not in ("phi", "velocity", "position")]

    @property
    def feedback(self) -> bool:
        """Whether the navigation is corrected after each epoch; may be changed between chunks."""
        return bool(self._cfg[kernel.FEEDBACK])

    @feedback.setter
    def feedback(self, on: bool) -> None:
        self._cfg[kernel.FEEDBACK] = on

    @property
    def frame(self) -> Array:
        """Position as the quaternion from n to the Earth's axes, (4,), without the known error."""
        return self._state[kernel.QUAT_NE : kernel.QUAT_NE + 4].copy()

    @property
    def height(self) -> float:
        """Height, m, without the known error."""
        return float(self._state[kernel.HEIGHT])

    @property
    def samples(self) -> int:
        """Samples taken so far."""
        return int(self._state[kernel.SAMPLES])

    @property
    def time(self) -> float:
        """Time of the last sample, s."""
        return float(self._state[kernel.TIME])

    @property
    def quat_nb(self) -> Array:
        """Attitude now, without the error that is known, (4,)."""
        from schuler.attitude import multiply, rotvec_to_quat

        q = self._state[kernel.QUAT_NB : kernel.QUAT_NB + 4]
        return np.asarray(multiply(rotvec_to_quat(self._x[:3]), q))

    @property
    def v_n(self) -> Array:
        """Velocity now, m/s, (3,)."""
        return self._state[kernel.V_N : kernel.V_N + 3] - self._x[self.layout["velocity"]]

    @property
    def error_state(self) -> Array:
        """Error estimates that were not fed back, (n,)."""
        return self._x[: self.layout.size].copy()

    @property
    def covariance(self) -> Array:
        """Of the error states, (n, n)."""
        return self._p[: self.layout.size, : self.layout.size].copy()

    def parameter(self, group: str) -> Array:
        """Return the estimate of a group of parameters now."""
        place = self.layout[group]
        sign = np.where(self.layout.sign[place] < 0.0, -1.0, 1.0)
        return np.asarray(self._est[place] + sign * self._x[place])

    @property
    def budget(self) -> dict[str, Array]:
        """Covariance of the error states by source, (n, n) each; empty without a budget."""
        n = self.layout.size
        return {
            name: part[:n, :n].copy()
            for name, part in zip(self.noise.sources, self._parts, strict=False)
        }

    @property
    def refused(self) -> int:
        """Scalar measurements that a gate or a robust rule refused."""
        return int(self._state[kernel.REFUSED])

    @property
    def weighed(self) -> int:
        """Scalar measurements that a robust rule weighed down."""
        return int(self._state[kernel.WEIGHED])

    @property
    def resets(self) -> int:
        """Times that the covariance was widened because measurements were refused for long."""
        return int(self._state[kernel.RESETS])

    @property
    def settings(self) -> tuple[Array, Array]:
        """Settings of the navigation as its kernels take them: cfg and those of the strapdown."""
        return self._cfg.copy(), self._options.copy()

    @property
    def start(self) -> tuple[Array, Array, Array, float]:
        """Attitude, velocity, q_n^e and height at the start."""
        return self._start
