"""An attitude to start from: the coarse alignment of a span, for a gyro of any grade.

The series are linear in the gyro bias and in the delay of the fixes: where these turn out large,
the series are made again without them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.aiding import BodySpeed, GnssFixes
from schuler.constants import STAMP_ROUNDING
from schuler.earth import Site
from schuler.errors import InputError
from schuler.in_motion.body import body_rows
from schuler.in_motion.coarse import ENOUGH, CoarseAlignment, coarse, missing
from schuler.in_motion.series import Series, body_velocity_series, position_series, velocity_series
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec

__all__ = ["Leader", "Span"]

Array = NDArray[np.float64]

Leader = GnssFixes | BodySpeed
"""Aids that a coarse alignment can be made with."""

_PASSES = 4
"""Over a body velocity, whose path is not known at first."""

_AGREES = 1.3
"""Residuals beside their sigma, rms, up to which the noise is what it was said to be."""

_LAPS, _LINEAR = 4, 0.1
"""Series that are made, and the turn by the gyro bias (rad) from which on there is another."""


@dataclass(frozen=True, eq=False)
class Span:
    """A span of a record, and the aid that its attitude is found with.

    Parameters
    ----------
    record : ImuRecord
    leader : GnssFixes or BodySpeed
    spec : ImuSpec
        Its prior of the gyro bias is that of what is left beside `bias`.
    bias : (3,) float64
        Gyro bias that rest before showed, rad/s.
    site : Site
        Where the vehicle is at the start.

    Examples
    --------
    >>> span = Span(drive, gnss, spec, np.zeros(3), sc.Site(48.1, 11.6, 500.0))
    >>> aid, found = span.coarse()
    >>> bool(found.heading_sigma < 0.1)
    True
    """

    record: ImuRecord
    leader: Leader
    spec: ImuSpec
    bias: Array
    site: Site

    def coarse(self, enough: float = ENOUGH) -> tuple[Leader, CoarseAlignment]:
        """Return the leader's measurements in the span, and the attitude at its start.

        Parameters
        ----------
        enough : float
            1-sigma of a heading that is none, rad.

        Raises
        ------
        InputError
            If there are too few measurements, or they show no heading.
        """
        late = isinstance(self.leader, GnssFixes) and "delay" in self.leader.estimate
        here = self
        for lap in range(_LAPS):
            series, cut = here._series()
            found = here._solved(series, cut, late, here.bias - self.bias)
            far = float(np.linalg.norm(found.gyro_bias)) * (self.record.end - self.record.start)
            if (far < _LINEAR or lap == _LAPS - 1) and (lap > 0 or not late):
                break
            if late:
                assert isinstance(here.leader, GnssFixes)
                here = replace(
                    here, leader=replace(here.leader, delay=here.leader.delay + found.delay)
                )
            if far >= _LINEAR:
                here = replace(here, bias=here.bias + found.gyro_bias)
        found = replace(found, gyro_bias=found.gyro_bias + here.bias - self.bias)
        # A comparison that is false for what is not a number, too.
        if not found.heading_sigma <= enough:
            raise InputError(f"{self.leader.name}: {missing(found, series)}")
        return cut, found

    def _series(self) -> tuple[Series, Leader]:
        """Return the series of the leader, and its measurements within the span."""
        turned = self.record.dtheta - self.bias * self.record.dt[:, None]
        record = replace(self.record, dtheta=turned)
        leader = self.leader
        delay = leader.delay if isinstance(leader, GnssFixes) else 0.0
        due = np.asarray(leader.time) - delay
        inside = (due >= record.start - STAMP_ROUNDING) & (due <= record.end + STAMP_ROUNDING)
        if isinstance(leader, GnssFixes):
            cut: Leader = leader.rows(inside)
        else:
            value = np.asarray(leader.value)[inside]
            cut = replace(leader, time=np.asarray(leader.time)[inside], value=value)
        rows = body_rows(record, due[inside])
        if isinstance(cut, BodySpeed):
            return body_velocity_series(rows, cut, self.site), cut
        make = position_series if cut.v_n is None else velocity_series
        return make(rows, cut), cut

    def _solved(
        self, series: Series, cut: Leader, late: bool, removed: Array
    ) -> CoarseAlignment:  # fmt: skip
        """Return the attitude at the start; residuals beyond their sigma widen it.

        `removed` (3,) is what was taken off the gyros beside the bias at rest, rad/s.
        """
        place = (self.site.latitude, self.site.longitude)
        none = np.eye(3), np.zeros((3, 3))
        noise = 1.0

        def solve(series: Series) -> CoarseAlignment:
            return coarse(
                series, self.spec, place, self.record.start, *none, estimate_delay=late,
                noise=noise, removed=removed,
            )  # fmt: skip

        found = solve(series)
        for _ in range(2):
            if isinstance(cut, BodySpeed):
                for _ in range(_PASSES - 1):
                    series = body_velocity_series(series.rows, cut, self.site, found.mat_i0_ib0)
                    found = solve(series)
            if found.ratio < _AGREES or noise != 1.0:
                break
            noise = found.ratio
            found = solve(series)
        return found
