"""`AidedNavigation`: path, what was estimated, innovations, refused fixes and scores of outages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler._result import Result
from schuler.aiding import GnssFixes
from schuler.errors import InputError
from schuler.ins import EpochStates, ErrorStateFilter, Measurement
from schuler.kernels.states import ErrorStates
from schuler.navigation.aid_estimates import WITHHELD, estimate_rows, estimates, levers
from schuler.navigation.aided_paths import (
    error_variances,
    in_level_axes,
    path_in_level_axes,
    smoothed_path,
)
from schuler.navigation.lever import at_lever, rates
from schuler.navigation.outage_scores import outage_scores
from schuler.navigation.outages import Outages
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec
from schuler.trajectory import Trajectory

if TYPE_CHECKING:
    pass

__all__ = ["AidedNavigation", "finished"]

Array = NDArray[np.float64]

OUTPUT = "output_epoch"
"""Name of the epochs at which nothing is measured."""

_REFUSED_SHARE, _RATIO = 0.3, 3.0
"""Share of refused fixes, and mean squared normalised innovation over a minute, that contradict."""


@dataclass(frozen=True, eq=False)
class AidedNavigation(Result):
    """An aided navigation.

    Parameters
    ----------
    path : Trajectory
        At the epochs of the filter; smoothed where that was asked for.
    forward : Trajectory
        By the filter alone.
    estimated : dict
        Values and 1-sigma by kind, as in the JSON schema `schuler.navigation/3`.
    used, refused : dict of str to int
        Measurements by aid.
    innovations : dict of str to tuple
        Times (k,), innovations and their sigma (k, 3), weights (k,) by aid.
    outages : dict or None
        Scores forward and smoothed.
    warnings, contradictions : tuple of str
    gaps : tuple of (float, float)
        Spans of more than five seconds without a fix that was used.
    spec : ImuSpec
    epochs : EpochStates
        From which `at_samples` follows.
    covariances : (n, 9, 9) float64 or None
        Of attitude, velocity and position, East-North-Up, at each row of `path`, where it was
        smoothed.
    levers : dict of str to array
        Lever arm (3,) of each aid of a point of the body, estimated where it was, m.
    """

    path: Trajectory
    forward: Trajectory
    estimated: dict[str, Any]
    used: dict[str, int]
    refused: dict[str, int]
    innovations: dict[str, tuple[Array, Array, Array, Array]] = field(repr=False)
    outages: dict[str, Any] | None
    warnings: tuple[str, ...]
    contradictions: tuple[str, ...]
    gaps: tuple[tuple[float, float], ...]
    spec: ImuSpec = field(repr=False)
    epochs: EpochStates = field(repr=False)
    covariances: Array | None = field(default=None, repr=False)
    levers: dict[str, Array] = field(default_factory=dict, repr=False)

    def at_samples(self, record: ImuRecord, every: int = 1) -> Trajectory:
        """Return the path at the samples of the record that was navigated.

        Between epochs it is inertial navigation with what was estimated; a smoothed one joins the
        next epoch without a step. Variances are interpolated.

        Parameters
        ----------
        record : ImuRecord
        every : int
            Samples to a row.

        Raises
        ------
        InputError
            If the record ends before the navigation starts, or `every` is not positive.
        """
        if every < 1:
            raise InputError(f"samples to a row must be at least 1, got {every}")
        last = float(self.path.time[-1])
        if record.end < last - 1e-6:
            raise InputError(
                f"{record.name}: the record ends at t = {record.end:.9g} s, and the navigation at "
                f"{last:.9g} s: give the record that was navigated"
            )
        s = self.epochs.at_samples(record.between(None, float(self.path.time[-1])))
        rows = slice((len(s.time) - 1) % every, None, every)
        time, at = s.time[rows], self.path.time
        known = self.path.known("variances")
        variances = np.column_stack([np.interp(time, at, column) for column in known.T])
        return path_in_level_axes(
            time, s.quat_nb[rows], s.v_n[rows], s.quat_ne[rows], s.height[rows], variances, None,
            record.name,
        )  # fmt: skip

    def antenna(self, name: str = "gnss") -> Array:
        """Return the lever arm to an antenna (3,), estimated where it was, body axes, m.

        Raises
        ------
        InputError
            If there is no aid of that name.
        """
        if name not in self.levers:
            raise InputError(
                f"there is no aid '{name}' with a lever arm; there is {', '.join(self.levers)}"
            )
        return np.array(self.levers[name])

    def at_point(self, record: ImuRecord, lever: ArrayLike, every: int | None = None) -> Trajectory:
        """Return the path of another point of the body: an antenna, the rear axle.

        Its velocity is that of the IMU and w x l, with the body's rate from the attitudes at the
        samples. It has variances where the navigation was smoothed; between epochs covariances
        are interpolated.

        Parameters
        ----------
        record : ImuRecord
            That was navigated.
        lever : (3,) array_like
            From the IMU, body axes, m; `antenna` has that of the fixes.
        every : int, optional
            Samples to a row; the rows are those of `path` when not given.

        Raises
        ------
        InputError
            As of `at_samples` and `at_lever`.
        """
        if every is not None and every < 1:
            raise InputError(f"samples to a row must be at least 1, got {every}")
        whole = self.at_samples(record)
        rate_n = rates(whole)
        if every is None:
            at = self.path.time
            between = np.column_stack([np.interp(at, whole.time, column) for column in rate_n.T])
            return at_lever(self.path, lever, between, self.covariances)
        rows = slice((len(whole) - 1) % every, None, every)
        part = whole.rows(rows)
        return at_lever(part, lever, rate_n[rows], self._covariances_at(part.time))

    def _covariances_at(self, time: Array) -> Array | None:
        if self.covariances is None:
            return None
        at = self.path.time
        columns = self.covariances.reshape(len(at), -1).T
        table = np.column_stack([np.interp(time, at, column) for column in columns])
        return table.reshape(len(time), *self.covariances.shape[1:])

    @property
    def consistent(self) -> bool:
        """Whether nothing contradicts the result."""
        return not self.contradictions

    def to_dict(self) -> dict[str, Any]:
        """Return what the JSON schema `schuler.navigation/3` has of an aided navigation."""
        return {
            "start": self.path.rows(slice(0, 1)).final, "final": self.path.final,
            "sigma": self.path.sigma, "estimated": self.estimated, "used": self.used,
            "refused": self.refused, "outages": self.outages, "consistent": self.consistent,
            "contradictions": list(self.contradictions), "warnings": list(self.warnings),
            "gaps": [list(gap) for gap in self.gaps],
        }  # fmt: skip

    def columns(self) -> dict[str, Any]:
        """Return the path, a row to each epoch."""
        return dict(self.path.columns())

    def __str__(self) -> str:
        t = self.path.time
        first = f"INCONSISTENT: {'; '.join(self.contradictions)}; " if self.contradictions else ""
        said = " + ".join(f"{n} {name}" for name, n in self.used.items())
        lines = [f"{first}{t[-1] - t[0]:.6g} s by aided navigation ({said})", str(self.path)]
        for aid, count in self.refused.items():
            if count:
                lines.append(f"refused   {count} of {aid}")
        lines += [f"estimated {name}: {told}" for name, told in estimate_rows(self.estimated)]
        if self.outages is not None:
            o = self.outages
            for way in ("forward", "smoothed"):
                if o[way] is not None:
                    lines.append(
                        f"outages   {o['count']} of {o['length_s']:g} s, {way}: worst error "
                        f"{o[way]['rms_horizontal_m']:.3g} m rms horizontally (median "
                        f"{o[way]['median_horizontal_m']:.3g} m), "
                        f"{o[way]['rms_height_m']:.3g} m in height; "
                        f"{o[way]['normalised_rms']:.2f} of its sigma rms"
                    )
        return "\n".join(lines)


def finished(
    flt: ErrorStateFilter, record: ImuRecord, gnss: GnssFixes, used: GnssFixes,
    withheld: GnssFixes | None, measured: Sequence[Measurement], spec: ImuSpec,
    outages: Outages | None, delays: Mapping[str, float],
) -> AidedNavigation:  # fmt: skip
    """Return the result of a filter that has taken its record.

    `delays` were taken off the times of fixes by the aid's name: estimates are what is left.
    """
    history = flt.history()
    forward = path_in_level_axes(
        history.time, history.quat_nb, history.v_n, history.quat_ne, history.height,
        error_variances(flt, lambda name: history.sigma(name) ** 2), None, record.name,
        flt.covariance[: ErrorStates.size, : ErrorStates.size],
    )  # fmt: skip
    path, smoothed, covariances = forward, None, None
    if flt.smooths:
        smoothed = flt.smoothed()
        path = smoothed_path(flt, smoothed, record.name)
        covariances = in_level_axes(smoothed.covariance[1:, :9, :9], history.quat_ne)
    innovations = {}
    counts: dict[str, int] = {}
    refused: dict[str, int] = {}
    names = [aid.label if isinstance(aid, Measurement) else aid.name for aid in flt.aids]
    for name in names:
        each = flt.innovations(name)
        if name != OUTPUT:
            innovations[name] = each
        if name in (WITHHELD, OUTPUT):
            continue
        counts[name] = int(np.sum(each[3] > 0.0))
        refused[name] = int(np.sum(each[3] == 0.0))
    score = None
    if withheld is not None and outages is not None:
        score = outage_scores(
            outages,
            withheld,
            innovations[WITHHELD],
            flt,
            smoothed,
            forward,
            path,
            record,
            delays[used.name],
        )
    taken = innovations[used.name]
    gaps = _gaps(taken[0][taken[3] > 0.0], record)
    contradictions = [*gnss.contradictions(), *_contradictions(used, refused, counts, taken)]
    warnings = _warnings(gnss, flt, gaps, outages)
    return AidedNavigation(
        path, forward, estimates(flt, measured, delays), counts, refused, innovations, score,
        tuple(warnings), tuple(contradictions), gaps, spec,
        EpochStates.of(flt, record.start, smoothed), covariances, levers(flt, measured),
    )  # fmt: skip


def _gaps(times: Array, record: ImuRecord) -> tuple[tuple[float, float], ...]:
    """Return spans of more than five seconds without a fix."""
    edges = np.concatenate([[record.start], times, [record.end]])
    long = np.flatnonzero(np.diff(edges) > 5.0)
    return tuple((float(edges[k]), float(edges[k + 1])) for k in long)


def _contradictions(
    used: GnssFixes, refused: Mapping[str, int], counts: Mapping[str, int],
    taken: tuple[Array, Array, Array, Array],
) -> list[str]:  # fmt: skip
    """Return what says that the filter and its fixes do not agree."""
    out = []
    total = counts[used.name] + refused[used.name]
    if total and refused[used.name] > _REFUSED_SHARE * total:
        out.append(
            f"{refused[used.name]} of {total} fixes of {used.name} were refused: the record, its "
            "axes and units, or the fixes' sigma are not what they are said to be"
        )
    time, z, sigma, weight = taken
    good = weight > 0.0
    if good.sum() > 20:
        square = np.mean((z[good] / np.maximum(sigma[good], 1e-12)) ** 2, axis=1)
        minute = np.floor((time[good] - time[0]) / 60.0).astype(int)
        means = [square[minute == m].mean() for m in np.unique(minute) if np.sum(minute == m) > 20]
        if means and max(means) > _RATIO:
            m = int(np.argmax(means))
            out.append(
                f"the fixes of {used.name} differ from the prediction by "
                f"{np.sqrt(max(means)):.2g} sigma rms in the minute after t = "
                f"{time[0] + 60.0 * m:.6g} s: their sigma, the delay, the lever arm or the "
                "instrument's noise are not what they are said to be"
            )
    return out


def _warnings(
    gnss: GnssFixes, flt: ErrorStateFilter, gaps: Sequence[tuple[float, float]],
    outages: Outages | None,
) -> list[str]:  # fmt: skip
    out = list(gnss.notes)
    if gnss.height_above == "geoid":
        out.append(f"heights are above the geoid, as those of {gnss.name}, and not the ellipsoid")
    if gnss.dropped:
        said = ", ".join(f"{count} with {reason}" for reason, count in gnss.dropped.items())
        out.append(f"rows of {gnss.name} were left out: {said}")
    if flt.resets:
        out.append(
            f"{flt.resets} times the covariance was widened because fixes were refused for long"
        )
    if gaps and outages is None:
        longest = max(end - begin for begin, end in gaps)
        out.append(f"{len(gaps)} spans without a fix, the longest {longest:.4g} s")
    return out
