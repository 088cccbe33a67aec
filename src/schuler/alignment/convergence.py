"""How an alignment came about: heading and sigma if the record had ended earlier."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.alignment.gravity_uncertainty import deflection_covariance
from schuler.alignment.history import History
from schuler.alignment.method import Problem
from schuler.alignment.result import Alignment
from schuler.alignment.stationary.inertial import MINIMUM_ROWS
from schuler.alignment.stationary.kalman import FilterHistory
from schuler.attitude import nearest_quat, psi_to_heading, quat_to_euler
from schuler.constants import ARCMIN, DEG
from schuler.errors import InputError
from schuler.record import ImuRecord

__all__ = ["Convergence", "convergence", "heading_history"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Convergence:
    """Heading against the time used.

    Parameters
    ----------
    t : (k,) float64
        Time used, s.
    heading_deg, sigma_arcmin : (k,) float64
        Heading (unwrapped: no jump at 360) and its 1-sigma.
    """

    t: Array
    heading_deg: Array
    sigma_arcmin: Array


def convergence(fix: Alignment, points: int = 60) -> Convergence:
    """Return heading and sigma of an alignment from ever longer parts of its record.

    Parameters
    ----------
    fix : Alignment
    points : int
        At most so many, spaced evenly in the logarithm of time from a hundredth of the span.

    Examples
    --------
    >>> from schuler.alignment import convergence
    >>> curve = convergence(sc.align(record, site, spec=spec))
    >>> bool(curve.sigma_arcmin[0] > curve.sigma_arcmin[-1])
    True
    """
    if fix.filter_history is not None:
        return _of_filter(fix, fix.filter_history, points)
    method = fix.method.with_prefilter(None)
    found: list[tuple[float, float, float]] = []
    for problem in _ever_longer(fix, points):
        part = problem.history
        try:
            e = method.solve(problem)
        except InputError:
            # The first instants may not fix an attitude yet; the curve starts where they do.
            continue
        psi = quat_to_euler(nearest_quat(e.attitude))[0]
        covariance = e.covariance + deflection_covariance(fix.site)
        sigma = float(np.sqrt(covariance[2, 2])) / ARCMIN
        found.append((part.duration, float(psi_to_heading(psi)) / DEG, sigma))
    t, heading, sigma_arcmin = (np.array(c) for c in zip(*found, strict=True))
    # Unwrap towards the final value, which is the one in [0, 360).
    heading = heading[-1] + (heading - heading[-1] + 180.0) % 360.0 - 180.0
    return Convergence(t, heading, sigma_arcmin)


Parts = dict[tuple[History, int], History]
"""Beginnings of histories, by the history and the number of its last instant."""


def heading_history(
    fix: Alignment, points: int = 60, parts: Parts | None = None
) -> tuple[Array, Array]:
    """Return time used (k,), s, and heading (k,), deg, if the record had ended then.

    Without the uncertainties, which cost more than the headings. A filter is run on each part anew:
    on its way through the whole record it knows from the start what the whole record gave it to
    begin with. Methods that are given the same `parts` share what is found of each part.
    """
    method = fix.method.with_prefilter(None)
    found: list[tuple[float, float]] = []
    for problem in _ever_longer(fix, points, parts):
        try:
            attitude = method.attitude(problem)
        except InputError:
            continue
        psi = quat_to_euler(nearest_quat(attitude))[0]
        found.append((problem.history.duration, float(psi_to_heading(psi)) / DEG))
    t, heading = (np.array(c) for c in zip(*found, strict=True))
    heading = heading[-1] + (heading - heading[-1] + 180.0) % 360.0 - 180.0
    return t, heading


def _ever_longer(fix: Alignment, points: int, parts: Parts | None = None) -> list[Problem]:
    """Return the problems of ever longer parts of the record, the last of the whole."""
    h = fix.history
    parts = {} if parts is None else parts
    wanted = np.geomspace(0.01 * h.duration, h.duration, points)
    rows = np.unique(np.clip(np.searchsorted(h.t, wanted - 1e-9), MINIMUM_ROWS, len(h) - 1))
    at_end = fix.at == "end"
    out = []
    for row in (int(row) for row in rows):
        part = h if row == len(h) - 1 else parts.setdefault((h, row), h.until(row))
        out.append(Problem(part, fix.site, fix.spec, at_end, None, _no_samples))
    return out


def _no_samples() -> ImuRecord:
    raise InputError("a method that needs the samples has its own filter history")


def _of_filter(fix: Alignment, filter_history: FilterHistory, points: int) -> Convergence:
    """Return what a filter said on its way."""
    last = len(filter_history.t) - 1
    rows = np.unique(np.round(np.geomspace(1, last + 1, points)).astype(np.int64)) - 1
    heading = psi_to_heading(quat_to_euler(filter_history.quaternion[rows])[:, 0]) / DEG
    heading = heading[-1] + (heading - heading[-1] + 180.0) % 360.0 - 180.0
    deflection = float(np.sqrt(deflection_covariance(fix.site)[2, 2]))
    sigma = np.hypot(filter_history.sigma[rows, 2], deflection)
    return Convergence(filter_history.t[rows], heading, sigma / ARCMIN)
