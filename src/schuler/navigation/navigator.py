"""`Navigator`: chunks in, a path out; `navigate` is one update."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.earth import radii
from schuler.errors import InputError
from schuler.kernels.states import (
    ErrorNoise,
    ErrorStates,
    LocalRow,
    PathRow,
    StrapdownOptions,
)
from schuler.navigation.options import Gravity, Vertical, parse_gravity, parse_vertical
from schuler.navigation.start import Start
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec, SensorArray, load_array, load_spec
from schuler.trajectory import Trajectory

__all__ = ["Navigator"]

Array = NDArray[np.float64]


class Navigator:
    """Navigate a stream: `update` with chunks, `path` whenever it is wanted.

    Any chunking gives the same bits. The navigation frame wanders, so that a path may cross the
    poles and the date line.

    Parameters
    ----------
    start : Start
    gravity : Gravity or str, optional
        Somigliana with second-order height by default.
    vertical : Vertical or str, optional
        Free (pure inertial) by default.
    every : int
        Updates to a row of the path.
    spec : ImuSpec or str, optional
        The instrument: with it the error covariance is propagated beside the path.
    subsamples : int, optional
        Samples to an update, 1 to 4; by the rate when not given.
    covariance_step : float
        s.
    array : SensorArray or str, optional
        Geometry of redundant gyros: records then have a column for each.

    Raises
    ------
    InputError
        For an option that cannot be meant.

    Examples
    --------
    >>> start = sc.Start.from_angles(site, heading=30.0)
    >>> path = sc.Navigator(start, every=20).update(record).path()
    >>> len(path.time)
    61
    """

    def __init__(
        self,
        start: Start,
        *,
        gravity: Gravity | str | None = None,
        vertical: Vertical | str | None = None,
        every: int = 1,
        spec: ImuSpec | str | None = None,
        subsamples: int | None = None,
        covariance_step: float = 1.0,
        array: SensorArray | str | None = None,
    ) -> None:
        from schuler.kernels import strapdown

        if every < 1:
            raise InputError(f"every must be 1 update or more, got {every}")
        if subsamples is not None and not 1 <= subsamples <= 4:
            raise InputError(f"samples to an update must be 1 to 4, got {subsamples}")
        if not covariance_step > 0:
            raise InputError(f"the covariance's step must be positive, got {covariance_step} s")
        self.start = start
        self.gravity, self.vertical = parse_gravity(gravity), parse_vertical(vertical)
        self.spec = load_spec(spec)
        self.array = None if array is None else load_array(array)
        self._kernel = strapdown
        self._state = start.state()
        if self.vertical.mode == "off":
            self._state.v_n[2] = 0.0
        self._options = self._numbers()
        self._every = every
        self._wanted = subsamples
        self._subsamples = 0
        self._flags = (1.0, 1.0)
        self._rows: list[Array] = []
        self._variances: list[Array] = []
        self._name = "record"
        self._last = -np.inf
        self._drained = False
        self._work, self._noise = np.empty((0, ErrorStates.size)), np.zeros(0)
        if self.spec is not None:
            self._work, self._noise = self._uncertainty(self.spec, covariance_step)

    def _numbers(self) -> Array:
        from schuler.navigation.options import GRAVITY_MODELS, VERTICAL_MODES

        site, g = self.start.site, self.gravity
        held = self.vertical.height
        told = StrapdownOptions.zeros()
        told.gravity_model = GRAVITY_MODELS.index(g.model)
        told.gravity_value = site.gravity if g.value is None else g.value
        told.vertical_mode = VERTICAL_MODES.index(self.vertical.mode)
        told.damping_gains = np.array(self.vertical.gains)
        told.held_height = site.height if held is None else held
        return told.data

    def _uncertainty(self, spec: ImuSpec, step: float) -> tuple[Array, Array]:
        n = ErrorStates.size
        work = np.zeros((3 * n, n))
        phi_to_position = slice(0, ErrorStates.gyro_bias.start)
        if self.start.covariance is not None:
            given = np.asarray(self.start.covariance, np.float64)
            if given.shape != (9, 9):
                raise InputError(f"a start's covariance has 9 by 9 numbers, got {given.shape}")
            work[phi_to_position, phi_to_position] = given
        if self.vertical.mode == "off":
            for k in (ErrorStates.velocity.start + 2, ErrorStates.position.start + 2):
                work[k] = 0.0
                work[:n, k] = 0.0
        g, a = spec.gyro, spec.accelerometer
        variances = ErrorStates(np.diag(work[:n]).copy())
        variances.gyro_bias, variances.accel_bias = g.by_axis("bias") ** 2, a.by_axis("bias") ** 2
        np.fill_diagonal(work[:n], variances.data)
        noise = ErrorNoise.zeros()
        noise.gyro_white, noise.accel_white = g.white**2, a.white**2
        noise.gyro_walk, noise.accel_walk = g.drift**2, a.drift**2
        noise.step = step
        return work, noise.data

    def update(self, chunk: ImuRecord, height: Array | None = None) -> Navigator:
        """Take a chunk that follows the last one; return self.

        Parameters
        ----------
        chunk : ImuRecord
        height : (n,) float64, optional
            Height at each sample to damp to, m, in the place of one for all.

        Raises
        ------
        InputError
            If the chunk has not three gyros and three accelerometers, or does not follow.
        """
        n = len(chunk)
        if not n:
            return self
        if self.array is not None:
            chunk = self.array.fuse(chunk)
        if chunk.dtheta.shape[1] != 3 or chunk.dvel.shape[1] != 3:
            raise InputError(
                "a navigation needs three gyros and three accelerometers, got "
                f"{chunk.dtheta.shape[1]} and {chunk.dvel.shape[1]}: name the array's geometry"
            )
        if height is not None and self.vertical.mode != "damped":
            raise InputError("heights are for a damped vertical channel: say vertical='damped'")
        aid = np.empty(0) if height is None else np.ascontiguousarray(height, np.float64)
        if height is not None and aid.shape != (n,):
            raise InputError(f"expected {n} heights, got an array of shape {aid.shape}")
        if not self._subsamples:
            self._open(chunk)
        elif chunk.time[0] <= self._last:
            raise InputError(
                f"a chunk starts at t = {chunk.time[0]:.9g} s, not after the last sample "
                f"({self._last:.9g} s)"
            )
        self._last = float(chunk.time[-1])
        capacity = n // (self._subsamples * self._every) + 2
        out = np.empty((capacity, self._kernel.ROW))
        variances = np.empty((capacity if self.spec is not None else 0, ErrorStates.size))
        used = self._kernel.navigate(
            self._state.data, self._subsamples, *self._flags, self._options,
            chunk.time, chunk.dt, chunk.dtheta, chunk.dvel, aid, self._every, out,
            self._work, self._noise, variances,
        )  # fmt: skip
        self._rows.append(out[:used])
        if self.spec is not None:
            self._variances.append(variances[:used])
        return self

    def _open(self, chunk: ImuRecord) -> None:
        self._name = chunk.name
        self._flags = (float(not chunk.coning_corrected), float(not chunk.sculling_corrected))
        self._subsamples = 1 if self._wanted is None else self._wanted
        self._state.time = chunk.start
        self._state.since_row = self._every
        self._rows.append(self._row())
        if self.spec is not None:
            self._variances.append(self._variance_row())

    def _row(self) -> Array:
        return self._state.row().data[None]

    def _variance_row(self) -> Array:
        return np.diag(self._work[: ErrorStates.size])[None].copy()

    def drain(self) -> Trajectory | None:
        """Return the rows that came since the last call and forget them; None where none did.

        With it memory is constant for any length; `path` then has the rows that are left, or the
        last update alone.

        Examples
        --------
        >>> navigator = sc.Navigator(sc.Start.from_alignment(site, fix)).update(record)
        >>> len(navigator.drain())
        1201
        """
        rows, variances = self._rows, self._variances
        self._rows, self._variances = [], []
        if not any(map(len, rows)):
            return None
        self._drained = True
        return self._trajectory(
            np.concatenate(rows), np.concatenate(variances) if variances else None, None
        )

    def path(self) -> Trajectory:
        """Return where it went so far; the last row is the last update, whatever `every` is.

        Raises
        ------
        InputError
            If there has been no sample.
        """
        if not (self._rows or self._drained):
            raise InputError("the record has no samples to navigate")
        rows = [part for part in self._rows if len(part)]
        variances = [part for part in self._variances if len(part)]
        if not rows or PathRow(rows[-1]).time[-1] != self._state.time:
            rows = [*rows, self._row()]
            variances = [*variances, self._variance_row()] if self.spec is not None else []
        covariance = self._work[: ErrorStates.size] if self.spec is not None else None
        return self._trajectory(
            np.concatenate(rows), np.concatenate(variances) if variances else None, covariance
        )

    def _trajectory(
        self, rows: Array, variances: Array | None, covariance: Array | None
    ) -> Trajectory:
        here = local_rows(rows)
        if covariance is not None:
            covariance = _to_enu(covariance, LocalRow(here.data[-1]))
        return Trajectory(
            here.time, here.lat, here.lon, here.height, here.v_n, here.quat_nb, variances,
            covariance, self._name,
        )  # fmt: skip


def local_rows(rows: Array) -> LocalRow:
    """Return rows of a path, `PathRow` by `PathRow` in the wander frame, in East-North-Up."""
    from schuler.kernels.strapdown import local

    out = LocalRow.zeros(len(rows))
    local(np.ascontiguousarray(rows), out.data)
    return out


def _to_enu(covariance: Array, here: LocalRow) -> Array:
    """Return a covariance of the error states (15, 15) in East-North-Up, from the wander frame."""
    c, s = np.cos(here.wander), np.sin(here.wander)
    rotation = np.eye(ErrorStates.size)
    phi, velocity, position = (
        f.start for f in (ErrorStates.phi, ErrorStates.velocity, ErrorStates.position)
    )
    for k in (phi, velocity, position):
        rotation[k : k + 2, k : k + 2] = [[c, -s], [s, c]]
    # North turns with the place: an error of position to the east is one of heading.
    slip = np.tan(here.lat) / (float(radii(here.lat)[1]) + here.height)
    slipped = np.eye(ErrorStates.size)
    slipped[phi + 2, position] += slip
    slipped[velocity, position] += slip * here.v_n[1]
    slipped[velocity + 1, position] -= slip * here.v_n[0]
    rotation = slipped @ rotation
    return np.asarray(rotation @ covariance @ rotation.T)
