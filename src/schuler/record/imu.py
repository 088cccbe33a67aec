"""`ImuRecord`: increments of angle and velocity over intervals, in body axes (RFU), SI."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler._notebook import Shown, card
from schuler.errors import InputError

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from schuler.record.quality import Quality

__all__ = ["ImuRecord"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ImuRecord(Shown):
    """A stretch of IMU samples; each is an increment over ``(time - dt, time]``.

    Parameters
    ----------
    time : (n,) float64
        End of each sample's interval, s, strictly increasing.
    dt : (n,) float64
        Length of each interval, s, positive.
    dtheta : (n, m) float64
        Angle increments, rad: plain integrals of body rate, or rotation vectors where
        `coning_corrected` says so. m is 3 but for redundant arrays.
    dvel : (n, k) float64
        Velocity increments, m/s: plain integrals of specific force in moving body axes, or
        resolved at the interval's start where `sculling_corrected` says so.
    coning_corrected, sculling_corrected : bool
        What the instrument has already done inside each interval.
    name : str
        Where the record came from.
    quality : Quality or None
        What was found as rows were checked; None for records made in memory.

    Attributes
    ----------
    values : (n + 1, 6) float64 or None
        Of records made from instantaneous rates: the rates as they came (rad/s, m/s^2) at the
        start of the first interval and at the end of each. Noise is judged on them, since
        integrating colours it.

    Notes
    -----
    Body axes are x right, y forward, z up (`schuler` docstring). Rates, units and other axes
    are converted once, by the readers or by `from_rates`, `from_mean_rates` and
    `from_increments`.

    Examples
    --------
    >>> len(record), record.rate, record.duration
    (1200, 20.0, 60.0)
    >>> len(record.between(10.0, 20.0))
    200
    """

    time: Array
    dt: Array
    dtheta: Array
    dvel: Array
    coning_corrected: bool = False
    sculling_corrected: bool = False
    name: str = "record"
    quality: Quality | None = field(default=None, compare=False)
    # Not an argument: `replace` leaves it out, so that it cannot stay when increments change.
    values: Array | None = field(default=None, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        n = len(self.time)
        for label, array, ndim in (
            ("time", self.time, 1), ("dt", self.dt, 1),
            ("dtheta", self.dtheta, 2), ("dvel", self.dvel, 2),
        ):  # fmt: skip
            if array.ndim != ndim or len(array) != n:
                raise InputError(
                    f"ImuRecord: expected {label} with {ndim} dimension(s) and {n} rows, "
                    f"got shape {array.shape}"
                )

    def __len__(self) -> int:
        return len(self.time)

    # -- making ------------------------------------------------------------------------

    @classmethod
    def from_rates(
        cls, time: ArrayLike, gyro: ArrayLike, accel: ArrayLike, **options: object
    ) -> ImuRecord:
        """Make a record from instantaneous rates sampled at `time`.

        Integrates by the three-point Adams-Moulton formula on an even grid and by the
        trapezoid elsewhere. The first row only opens the first interval, so the record has
        one sample less than there are rows.

        Parameters
        ----------
        time : (n,) array_like
            s.
        gyro, accel : (n, 3) array_like
            rad/s and m/s^2 in body axes (RFU).
        **options
            `name`, `max_gap` as in `Intake`.

        Raises
        ------
        InputError
            For fewer than two rows, backward or repeated time, or a gap too long to bridge.

        Examples
        --------
        >>> time = 0.1 * np.arange(300)
        >>> accel = np.tile([0.0, 0.0, 9.81], (300, 1))
        >>> len(sc.ImuRecord.from_rates(time, np.zeros((300, 3)), accel))
        299
        """
        return cls._build("rates", time, gyro, accel, options)

    @classmethod
    def from_mean_rates(
        cls, time: ArrayLike, gyro: ArrayLike, accel: ArrayLike, **options: object
    ) -> ImuRecord:
        """Make a record from rates averaged over the interval that ends at each row's time.

        Rate times interval is the increment, exactly. The first interval is taken as the
        nominal one. Parameters and errors as in `from_rates`.

        Examples
        --------
        >>> time = 0.1 * np.arange(300)
        >>> accel = np.tile([0.0, 0.0, 9.81], (300, 1))
        >>> len(sc.ImuRecord.from_mean_rates(time, np.zeros((300, 3)), accel))
        300
        """
        return cls._build("mean-rates", time, gyro, accel, options)

    @classmethod
    def from_increments(
        cls, time: ArrayLike, dtheta: ArrayLike, dvel: ArrayLike, **options: object
    ) -> ImuRecord:
        """Make a record from increments (rad, m/s): plain integrals unless told otherwise.

        Parameters and errors as in `from_rates`; `coning_corrected` and `sculling_corrected`
        say what the instrument has already compensated.

        Examples
        --------
        >>> time = 0.1 * np.arange(300)
        >>> dvel = np.tile([0.0, 0.0, 0.981], (300, 1))
        >>> len(sc.ImuRecord.from_increments(time, np.zeros((300, 3)), dvel))
        300
        """
        return cls._build("increments", time, dtheta, dvel, options)

    @classmethod
    def _build(
        cls,
        kind: str,
        time: ArrayLike,
        gyro: ArrayLike,
        accel: ArrayLike,
        options: dict[str, object],
    ) -> ImuRecord:
        from schuler.record.intake import Intake

        intake = Intake(kind, **options)  # type: ignore[arg-type]
        t = np.asarray(time, dtype=np.float64)
        x = np.column_stack([np.asarray(gyro, np.float64), np.asarray(accel, np.float64)])
        parts = [intake.push(t, x), intake.close()]
        return cls.concatenate([p for p in parts if len(p)], quality=intake.quality())

    @classmethod
    def concatenate(cls, parts: list[ImuRecord], quality: Quality | None = None) -> ImuRecord:
        """Join consecutive chunks into one record.

        Raises
        ------
        InputError
            If there is nothing to join.

        Examples
        --------
        >>> len(sc.ImuRecord.concatenate([record.rows(0, 10), record.rows(10, 30)]))
        30
        """
        if not parts:
            raise InputError("the record has no samples")
        first = parts[0]
        if len(parts) == 1:
            return replace(first, quality=quality or first.quality).with_values(first.values)
        joined = replace(
            first,
            time=np.concatenate([p.time for p in parts]),
            dt=np.concatenate([p.dt for p in parts]),
            dtheta=np.concatenate([p.dtheta for p in parts]),
            dvel=np.concatenate([p.dvel for p in parts]),
            quality=quality or first.quality,
        )
        known = [p.values for p in parts if p.values is not None]
        if len(known) < len(parts):
            return joined
        return joined.with_values(np.concatenate([known[0][:1], *(v[1:] for v in known)]))

    def with_values(self, values: Array | None) -> ImuRecord:
        """Return the same record with the rates that it was made from, (n + 1, 6) or None.

        Raises
        ------
        InputError
            For another shape.

        Examples
        --------
        >>> record.with_values(None).values is None
        True
        """
        if values is not None and values.shape != (len(self) + 1, 6):
            raise InputError(
                f"ImuRecord: expected values of shape {(len(self) + 1, 6)}, got {values.shape}"
            )
        out = replace(self)
        object.__setattr__(out, "values", values)
        return out

    # -- looking -----------------------------------------------------------------------

    @property
    def start(self) -> float:
        """Start of the first interval, s."""
        start = float(self.time[0] - self.dt[0])
        # A clock that starts at zero says so, not 1e-17.
        return 0.0 if abs(start) < 1e-9 * float(self.dt[0]) else start

    @property
    def end(self) -> float:
        """End of the last interval, s."""
        return float(self.time[-1])

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return self.end - self.start

    @property
    def rate(self) -> float:
        """Samples a second, from the median interval, Hz."""
        return 1.0 / float(np.median(self.dt))

    @property
    def gyro(self) -> Array:
        """Mean angular rate over each interval, rad/s, (n, m)."""
        return self.dtheta / self.dt[:, None]

    @property
    def accel(self) -> Array:
        """Mean specific force over each interval, m/s^2, (n, k)."""
        return self.dvel / self.dt[:, None]

    def __repr__(self) -> str:
        if not len(self):
            return f"ImuRecord({self.name!r}, empty)"
        return (
            f"ImuRecord({self.name!r}, {len(self)} samples, {self.start:.3f} to {self.end:.3f} s, "
            f"{self.rate:.6g} Hz)"
        )

    def _repr_html_(self) -> str:
        if not len(self):
            return card(f"{self.name}: no samples", [])
        rows = [
            ("samples", f"{len(self)}, {self.start:.6g} to {self.end:.6g} s, {self.rate:.6g} Hz"),
            ("mean |f|", f"{np.linalg.norm(self.accel, axis=1).mean():.6f} m/s²"),
        ]
        if self.dtheta.shape[1] == 3:
            turn = np.rad2deg(np.linalg.norm(self.dtheta.sum(axis=0)) / self.duration) * 3600.0
            rows.append(("|mean ω|", f"{turn:.4f} °/h (the Earth turns at 15.0411)"))
        else:
            rows.append(("gyros", f"{self.dtheta.shape[1]} axes, not fused"))
        done = [
            name for name, flag in (("coning", self.coning_corrected),
                                    ("sculling", self.sculling_corrected)) if flag
        ]  # fmt: skip
        rows.append(("corrected for", ", ".join(done) or "nothing"))
        return card(self.name, rows, self.quality.warnings() if self.quality else ())

    # -- views ----------------------------------------------------------------------

    def to_pandas(self) -> pd.DataFrame:
        """Return the samples as a table: time as index, dt, and a column for each channel.

        Columns are ``dt``, ``dtheta_x`` ... ``dvel_z``; ``attrs`` holds units, axes and flags, so
        that `schuler.io.from_pandas` gives the same record back.

        Raises
        ------
        InputError
            If pandas is not installed.
        """
        from schuler.record.views import to_pandas

        return to_pandas(self)

    def to_xarray(self) -> xr.Dataset:
        """Return the samples as a dataset: ``dt``, ``dtheta`` and ``dvel`` over time and axis.

        Each variable has its unit in ``attrs``, the dataset axes and flags, so that
        `schuler.io.from_xarray` gives the same record back.

        Raises
        ------
        InputError
            If xarray is not installed.
        """
        from schuler.record.views import to_xarray

        return to_xarray(self)

    # -- cutting -----------------------------------------------------------------------

    def rows(self, start: int, stop: int) -> ImuRecord:
        """Return samples start to stop (as a Python slice) as a record; no copy."""
        s = slice(start, stop)
        part = replace(
            self, time=self.time[s], dt=self.dt[s], dtheta=self.dtheta[s], dvel=self.dvel[s]
        )
        if self.values is None:
            return part
        first, end, _ = s.indices(len(self))
        return part.with_values(self.values[first : max(end, first) + 1])

    def between(self, start: float | None = None, stop: float | None = None) -> ImuRecord:
        """Return the samples whose interval lies in (start, stop], in the record's own time.

        A sample belongs to the stretch in which its interval's middle lies, so that
        consecutive stretches share no sample and lose none.
        """
        middle = self.time - 0.5 * self.dt
        a = 0 if start is None else int(np.searchsorted(middle, start, side="right"))
        b = len(self) if stop is None else int(np.searchsorted(middle, stop, side="right"))
        return self.rows(a, b)

    def after(self, time: float) -> ImuRecord:
        """Return the samples after a time.

        Examples
        --------
        >>> len(record.after(30.0))
        600
        """
        return self.between(start=time)

    def chunks(self, size: int = 65536) -> Iterator[ImuRecord]:
        """Yield the record in pieces of at most `size` samples."""
        if size < 1:
            raise InputError(f"chunk size must be at least 1, got {size}")
        for i in range(0, len(self), size):
            yield self.rows(i, i + size)
