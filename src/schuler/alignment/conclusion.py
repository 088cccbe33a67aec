"""From an estimate to a result: held against its record, with sigma, bound and warnings."""

from __future__ import annotations

from logging import getLogger
from typing import TYPE_CHECKING

import numpy as np

from schuler.alignment.assessment import assess, capped, notices
from schuler.alignment.bound import limit, position_limit
from schuler.alignment.debias import without_gyro_bias
from schuler.alignment.gravity_uncertainty import with_gravity_uncertainty
from schuler.alignment.history import History
from schuler.alignment.method import Estimate
from schuler.alignment.result import Alignment
from schuler.attitude import nearest_quat
from schuler.constants import ARCMIN
from schuler.earth import Site
from schuler.record import Summary

if TYPE_CHECKING:
    from schuler.alignment.aligner import Aligner

__all__ = ["conclude"]

log = getLogger("schuler.alignment")


def conclude(
    aligner: Aligner, h: History, summary: Summary, found: Estimate, hints: list[str], end: float
) -> Alignment:
    """Return the alignment of what an aligner has taken.

    Parameters
    ----------
    aligner : Aligner
        For its method, site, specification and what was said of its samples.
    h : History
    summary : Summary
    found : Estimate
        By the aligner's method, of that history.
    hints : list of str
        Of the summary.
    end : float
        Time of the last sample, s.

    Raises
    ------
    InputError
        If the record's values fix no attitude that could be tested.
    """
    assessed = assess(
        h, summary, aligner.site, aligner.spec, found, aligner.estimate, aligner.latitude_known
    )  # fmt: skip
    found = assessed.estimate

    def at_site(site: Site) -> Estimate:
        about = None if found.best is None else found.best.about
        removed = about is not None and about.gyro_bias.any()
        left = without_gyro_bias(h, about.gyro_bias) if about and removed else h
        return aligner.estimate(left, found.spec, about, site)

    found = with_gravity_uncertainty(found, aligner.site, at_site)
    budget = capped(found.budget)
    covariance = np.asarray(sum(budget.values(), np.zeros((3, 3))))
    contradictions = tuple(each.text for each in assessed.contradictions)
    if found.positions or assessed.contradictions:
        # A unit that is turned on purpose does not read Earth rate on average; and what a
        # contradiction says is not said twice.
        hints = [text for text in hints if not text.startswith(("the mean |w|", "the angle"))]
    warnings = [*aligner.said, *hints, *assessed.notes]
    bound = None
    if aligner.spec is not None:
        used = found.spec or aligner.spec
        if found.positions:
            bound = position_limit(used, aligner.site, found.positions, summary.interval).phi
        else:
            bound = limit(used, aligner.site, h.duration, summary.interval)
    sigma = float(np.sqrt(covariance[2, 2])) / ARCMIN
    warnings += notices(found, aligner.spec, h, sigma, bool(contradictions))
    log.debug("%s over %.6g s: heading sigma %.4g'", aligner.method, h.duration, sigma)
    return Alignment(
        method=found.method,
        site=aligner.site,
        start=h.start,
        end=end,
        samples=aligner.samples,
        at=aligner.at,
        quat_nb=nearest_quat(found.attitude),
        covariance=covariance,
        budget=budget,
        contradictions=contradictions,
        bound=bound,
        warnings=tuple(warnings),
        spec=found.spec,
        orthonormality=found.orthonormality,
        gyro_bias=None if found.biases is None else found.biases[:3],
        accel_bias=None if found.biases is None else found.biases[3:],
        bias_covariance=found.bias_covariance,
        history=h,
        summary=summary,
        why=found.why,
        filter_history=found.filter_history,
        inputs={"record": aligner.name},
    )
