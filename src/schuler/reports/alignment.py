"""The report of an alignment: a page that a person would rather look at than read."""

from __future__ import annotations

from dataclasses import replace
from html import escape

import numpy as np

from schuler.alignment import (
    Alignment,
    LatitudeFix,
    MovingAlignment,
    MovingWindows,
    Windows,
    convergence,
    residual,
)
from schuler.alignment.transfer import TransferAlignment
from schuler.constants import ARCMIN
from schuler.reports import figures
from schuler.reports.moving import moving_sections, windows_section
from schuler.reports.page import Drawing, Page, Section, contradiction_box, definition_table
from schuler.reports.transfer import transfer_sections
from schuler.units import significant

__all__ = ["alignment_page", "latitude_page", "windows_page"]

_RESIDUAL_BLOCKS = 1024


def alignment_page(fix: Alignment, windows: Windows | None = None) -> Page:
    """Return the page of an alignment, at rest or in motion.

    Parameters
    ----------
    fix : Alignment
    windows : Windows, optional
        Whose whole span it is.
    """
    name = fix.inputs.get("record", "record")
    if isinstance(fix, MovingAlignment):
        sections = moving_sections(fix)
        if isinstance(fix, TransferAlignment):
            sections += transfer_sections(fix)
        if isinstance(windows, MovingWindows):
            sections.insert(1, windows_section(windows))
        sections += [_budget(fix), _tables(fix)]
    else:
        sections = [_convergence(fix)]
        if windows is not None:
            sections.append(_windows(windows))
        sections += [_budget(fix), _raw(fix), _residuals(fix), _tables(fix)]
    return Page(f"Alignment of {name}: {fix.headline()}", _headline(fix, name), sections)


def windows_page(windows: Windows) -> Page:
    """Return the page of an alignment with its windows."""
    return alignment_page(windows.whole, windows)


def latitude_page(found: LatitudeFix) -> Page:
    """Return the page of an alignment that found its latitude too."""
    return alignment_page(found.alignment)


def _headline(fix: Alignment, name: str) -> str:
    sigma = fix.sigma_arcmin
    bound = fix.limit_arcmin
    # What contradicts the record stands above the heading, in a box of its own.
    told = replace(fix, contradictions=()).headline()
    value, degrees, rest = told.removeprefix("heading ").partition(" deg ")
    spread = rest.partition(" (")[0]
    if not told.startswith("heading ") or not degrees or "±" not in rest:
        value, degrees, spread = told, "", ""
    facts = [
        (f"{fix.pitch_deg:.4f}°", "pitch"),
        (f"{fix.roll_deg:.4f}°", "roll"),
        (
            f"{significant(sigma[0], 2)}′ · {significant(sigma[1], 2)}′",
            "tilt, 1 sigma east · north",
        ),
        (
            f"{significant(bound[2], 2)}′" if bound is not None else "no spec",
            "limit of the heading",
        ),
        (f"{fix.duration:.6g} s", f"{fix.samples} samples"),
    ]
    warned = "".join(f"<li>{escape(text)}</li>" for text in fix.warnings)
    items = "".join(
        f"<li><b>{escape(value)}</b><span>{escape(label)}</span></li>" for value, label in facts
    )
    return (
        f"<h1>Alignment · {escape(name)}</h1>"
        + contradiction_box(fix.contradictions)
        + f'<p class="value">{escape(value)}{"°" if degrees else ""} <span class="pm">'
        f"{escape(spread.replace(chr(39), '′'))}</span></p>"
        f'<p class="sub">Heading clockwise from true north ± 1 sigma, at the {escape(fix.at)} '
        f"of the span (t = {fix.time:.9g} s), {escape(str(fix.method))}</p>"
        f'<ul class="facts">{items}</ul>'
        + (f'<ul class="warnings" aria-label="Warnings">{warned}</ul>' if warned else "")
    )


def _convergence(fix: Alignment) -> Section:
    c = convergence(fix)
    return Section(
        "Convergence",
        drawings=[
            Drawing(
                "convergence",
                figures.convergence(c),
                "Heading if the record had ended earlier, with the sigma that would have been "
                "stated then.",
                f"Heading against time used, ending at {c.heading_deg[-1]:.3f} degrees.",
            )
        ],
    )


def _windows(w: Windows) -> Section:
    return Section(
        "Repeatability",
        drawings=[
            Drawing(
                "windows",
                figures.windows(w),
                f"{len(w.each)} windows of {w.length:g} s that share no sample. Bars are the "
                "sigma that each window states of itself; the band is the spread that was found.",
                f"Headings of {len(w.each)} windows around their mean of "
                f"{w.mean_heading_deg:.4f} degrees.",
            )
        ],
    )


def _budget(fix: Alignment) -> Section:
    spec = "" if fix.spec else " No specification was given: bias is not in it."
    return Section(
        "Where the uncertainty comes from",
        drawings=[
            Drawing(
                "budget",
                figures.budget(fix),
                "Each source's part of the heading's sigma; the total is the root sum square"
                + (", and the limit is the Cramér-Rao bound." if fix.spec else "." + spec),
                f"Bar chart of the heading's error budget, total {fix.sigma_arcmin[2]:.3g} arcmin.",
            )
        ],
    )


def _raw(fix: Alignment) -> Section:
    force, rate = figures.raw(fix.summary, fix.site.gravity)
    s = fix.summary
    quiet = f"{s.quiet_seconds:.6g} s of {s.duration:.6g} s are quiet"
    return Section(
        "What the record shows",
        html=f"<p>{escape(quiet)}; disturbed stretches are shaded.</p>",
        drawings=[
            Drawing("specific force", force,
                    "How far the length of the specific force is from local gravity: the largest "
                    "sample, the rms and the mean vector of each second.",
                    "Departure of the specific force from gravity over time."),
            Drawing("angular rate", rate,
                    "Length of the angular rate: the largest sample, the rms and the mean vector "
                    "of each second. The Earth turns at 0.00418 deg/s.",
                    "Angular rate over time."),
        ],
    )  # fmt: skip


def _residuals(fix: Alignment) -> Section:
    r = residual(fix.history, fix.site, _RESIDUAL_BLOCKS)
    e, n, u = (significant(1e3 * v, 3) for v in r.rms)
    bent = ", ".join(
        f"{name} {significant(1e3 * float(np.ptp(values)), 2)}"
        for name, values in zip(("east", "north", "up"), figures.parabola(r).T, strict=True)
    )
    return Section(
        "Residuals",
        html=f"<p>Residual velocity rms: east {e}, north {n}, up {u} mm/s, from "
        f"means over {float(r.dt.mean()):.3g} s. The disturbance part of sigma comes from its "
        "low frequencies.</p>",
        drawings=[
            Drawing("residuals", figures.residuals(r, fix.start),
                    f"Residual of the velocity integral, less a parabola ({bent} mm/s from its "
                    "least to its largest). One east is a constant drift of the gyros about "
                    "north: it does not turn the heading, and is not counted as disturbance.",
                    "Residual velocity east, north and up over time."),
            Drawing("spectrum", figures.spectrum(r),
                    "Its amplitude spectral density, likewise less that parabola.",
                    "Spectrum of the residual velocity."),
        ],
    )  # fmt: skip


def _tables(fix: Alignment) -> Section:
    q = ", ".join(f"{v:.12g}" for v in fix.quat_nb)
    cov = fix.covariance / ARCMIN**2
    rows = [
        ("quaternion (w, x, y, z)", q),
        ("sigma east, north, up", ", ".join(f"{v:.4g}'" for v in fix.sigma_arcmin)),
        *(
            (f"covariance {axis} (arcmin²)", ", ".join(f"{v:.5g}" for v in row))
            for axis, row in zip(("east", "north", "up"), cov, strict=True)
        ),
    ]
    if fix.orthonormality is not None:
        rows.append(("orthonormality error", f"{fix.orthonormality / ARCMIN:.4g}'"))
    return Section(
        "To do it again",
        html=definition_table(rows, "Result") + definition_table(fix.inputs.items(), "Inputs"),
    )
