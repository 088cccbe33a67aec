"""`EpochStates`: a navigation at its epochs, from which it follows at every sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError
from schuler.ins.filter import ErrorStateFilter
from schuler.ins.layout import Layout
from schuler.ins.smoother import Smoothed
from schuler.kernels import ins_layout as kernel
from schuler.record import ImuRecord

__all__ = ["EpochStates", "SampleStates"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SampleStates:
    """A navigation at samples, in the wander frame.

    Parameters
    ----------
    time, height : (n,) float64
    quat_nb, quat_ne : (n, 4) float64
    v_n : (n, 3) float64
    """

    time: Array
    quat_nb: Array
    v_n: Array
    quat_ne: Array
    height: Array


@dataclass(frozen=True, eq=False)
class EpochStates:
    """The start and all epochs of a filter, as it left them or smoothed.

    Parameters
    ----------
    layout : Layout
    rows : (k, 13) float64
        Time, q_b^n, velocity, q_n^e and height.
    estimates : (k, size) float64
        Parameters, in the places of their error states.
    settings : (array, array)
        Of the filter.
    smoothed : bool

    Examples
    --------
    >>> states = aided.epochs.at_samples(drive)
    >>> bool(np.all(np.isin(drive.time[100:200], states.time)))
    True
    """

    layout: Layout
    rows: Array
    estimates: Array
    settings: tuple[Array, Array]
    smoothed: bool

    @classmethod
    def of(cls, flt: ErrorStateFilter, begin: float, smoothed: Smoothed | None) -> EpochStates:
        """Return the states of a filter that has taken its record, which began at `begin`."""
        from schuler.kernels.between_epochs import E_SIZE
        from schuler.kernels.nominal_steps import move_position

        history, layout = flt.history(), flt.layout
        quat, v_n, quat_ne, height = flt.start
        k = len(history)
        rows = np.empty((k + 1, E_SIZE))
        rows[0] = np.concatenate([[begin], quat, v_n, quat_ne, [height]])
        rows[1:] = np.column_stack(
            [history.time, history.quat_nb, history.v_n, history.quat_ne, history.height]
        )
        estimates = np.zeros((k + 1, layout.padded))
        for name in layout:
            if name not in ("phi", "velocity", "position"):
                estimates[1:, layout[name]] = history[name]
        if k:
            estimates[0] = estimates[1]
        if smoothed is not None:
            rows[:, 1:5], rows[:, 5:8] = smoothed.quat_nb, smoothed.v_n
            for name in layout:
                place = layout[name]
                if name in ("phi", "velocity", "position"):
                    continue
                sign = np.where(layout.sign[place] < 0.0, -1.0, 1.0)
                estimates[1:, place] += sign * smoothed.error[1:, place]
            estimates[0] = estimates[min(1, k)]
            state = np.zeros(kernel.STATE_SIZE)
            for row, error in zip(rows, smoothed.error[:, layout["position"]], strict=True):
                state[kernel.QUAT_NE : kernel.QUAT_NE + 4] = row[8:12]
                state[kernel.HEIGHT] = row[12]
                move_position(state, (-error[0], -error[1], -error[2]))
                row[8:12] = state[kernel.QUAT_NE : kernel.QUAT_NE + 4]
                row[12] = state[kernel.HEIGHT]
        return cls(layout, rows, estimates, flt.settings, smoothed is not None)

    def at_samples(self, record: ImuRecord) -> SampleStates:
        """Return the navigation at the samples of the record that the filter has taken.

        From each epoch on it is inertial navigation with the estimates of that epoch; a smoothed
        one joins the next epoch without a step.

        Raises
        ------
        InputError
            If the record has no sample after the start.
        """
        from schuler.kernels import strapdown
        from schuler.kernels.between_epochs import P_SIZE, fill_path

        first = int(np.searchsorted(record.time, self.rows[0, 0] + 1e-9))
        if first >= len(record):
            raise InputError(
                f"the record ends at t = {record.end:.9g} s, before the navigation starts at "
                f"t = {self.rows[0, 0]:.9g} s"
            )
        out = np.zeros((len(record) - first, P_SIZE))
        cfg, options = self.settings
        fill_path(
            self.rows, self.estimates, self.smoothed, np.zeros(kernel.STATE_SIZE),
            np.zeros(strapdown.STATE_SIZE), self.layout.at, cfg, options, record.time[first:],
            record.dt[first:], record.dtheta[first:], record.dvel[first:], out,
        )  # fmt: skip
        return SampleStates(
            record.time[first:], out[:, 0:4], out[:, 4:7], out[:, 7:11], out[:, 11].copy()
        )
