"""The page of ``schuler compare``: methods beside one another on one record."""

from __future__ import annotations

from html import escape

import numpy as np

from schuler.alignment import RecordComparison
from schuler.alignment.compare import Comparison
from schuler.reports.figure import scatter
from schuler.reports.figures import BLUE, figure_of, plot_layout
from schuler.reports.page import Drawing, Page, Section, contradiction_box, definition_table
from schuler.units import percent, significant

__all__ = ["comparison_page", "records_page"]


def _cell(value: float | None, form: str, unit: str = "") -> str:
    if value is None:
        return "–"
    # Thousands of arcminutes are no place for powers of ten.
    return f"{value:,.0f}{unit}" if form == ".3g" and value >= 1000 else f"{value:{form}}{unit}"


def _chance(probability: float) -> str:
    """Return a probability in per cent; of a tiny one, that it is small."""
    return percent(probability) if probability >= 1e-4 else "less than 0.01 %"


def _settled(found: Comparison) -> str:
    note = found.settled_note.replace("'", "′").replace(" deg;", "°;").replace("-:", "–:")
    return f"; {escape(note)}" if note else ""


def comparison_page(found: Comparison) -> Page:
    """Return the page.

    Parameters
    ----------
    found : Comparison
    """
    done = [row for row in found.rows if row.heading_deg is not None]
    best = min(done, key=lambda row: row.sigma_arcmin or np.inf) if done else None
    body = "".join(
        f'<tr><th scope="row">{escape(row.method)}</th><td>{escape(row.prefilter)}</td>'
        f"<td>{_cell(row.heading_deg, '.4f', '°')}</td>"
        f"<td>{_cell(row.sigma_arcmin, '.3g', '′')}</td>"
        f"<td>{_cell(row.settle_s, '.4g')}</td><td>{_cell(row.std_heading_arcmin, '.3g', '′')}</td>"
        f"<td>{row.seconds:.2f}</td><td>{escape(row.note)}</td></tr>"
        for row in found.rows
    )
    heads = ("method", "prefilter", "heading", "sigma", "settled, s", "std of windows", "cost, s",
             "note")  # fmt: skip
    table = (
        f"<table><caption>Every method on this record{_settled(found)}</caption><thead><tr>"
        + "".join(f'<th scope="col">{name}</th>' for name in heads)
        + f"</tr></thead><tbody>{body}</tbody></table>"
    )
    sections = []
    if done and best is not None:
        reference = best.heading_deg or 0.0
        off = [((row.heading_deg or 0.0) - reference + 180.0) % 360.0 - 180.0 for row in done]
        names = [
            row.method if row.prefilter == "none" else f"{row.method} · {row.prefilter}"
            for row in done
        ]
        # Methods that failed outright would squeeze all others into a line.
        reach = max(4.0 * (best.sigma_arcmin or 1.0), float(np.median(np.abs(off))) * 240.0)
        layout = plot_layout(
            max(320, 22 * len(done)), "heading less that of the least sigma, arcmin", ""
        )
        layout["yaxis"]["range"] = [len(done) - 0.5, -0.5]
        layout["xaxis"].update(range=[-reach, reach])
        figure = figure_of(
            [
                scatter(
                    x=np.array(off) * 60.0, y=names, mode="markers", name="heading",
                    marker={"color": BLUE, "size": 8},
                    error_x={"array": [row.sigma_arcmin for row in done], "color": BLUE},
                    hovertemplate="%{y}: %{x:.3g}'<extra></extra>",
                )
            ],
            layout,
        )  # fmt: skip
        text = "Heading of every method with its 1-sigma bar, against that of the least sigma."
        beyond = [name for name, value in zip(names, off, strict=True) if abs(value) * 60.0 > reach]
        if beyond:
            text += f" Farther off than the figure reaches: {', '.join(beyond)}."
        sections.append(Section("Headings", drawings=[Drawing("headings", figure, text)]))
    window = "" if found.window is None else f" · windows of {found.window:g} s"
    limit = "" if found.limit_arcmin is None else f" · limit {found.limit_arcmin:.3g}′"
    value = "no method found north" if best is None else (
        f"{best.heading_deg:.3f}° <span class=\"pm\">± {best.sigma_arcmin:.2g}′</span>"
    )  # fmt: skip
    head = (
        f"<h1>Methods compared · {escape(found.name)}</h1>"
        + contradiction_box(found.contradictions)
        + f'<p class="value">{value}</p>'
        f'<p class="sub">{"" if best is None else "least sigma: " + escape(best.method) + " · "}'
        f"{found.duration:.6g} s{window}{limit}</p>"
    )
    return Page(f"Methods compared: {found.name}", head,
               [*sections, Section("Table", html=table)])  # fmt: skip


def records_page(found: RecordComparison) -> Page:
    """Return the page of two records held against each other."""
    rows = found.rows()
    names = [f"about {row['axis']}" for row in rows]
    layout = plot_layout(240, "second less first, arcmin", "", hovermode="closest")
    layout["yaxis"].update(autorange="reversed")
    trace = scatter(
        x=[row["difference_arcmin"] for row in rows], y=names, mode="markers",
        name="difference, ± 1 sigma", marker={"color": BLUE, "size": 9},
        error_x={"type": "data", "array": [row["sigma_arcmin"] for row in rows], "color": BLUE},
        hovertemplate="%{y}: %{x:.3g}'<extra></extra>",
    )  # fmt: skip
    text = "Attitude of the second record less that of the first, with the sigma of both together."
    table = definition_table(
        [
            (name, f"heading {fix.heading_deg:.4f} ± {fix.heading_sigma_arcmin / 60.0:.2g} deg, "
             f"pitch {fix.pitch_deg:.4f}, roll {fix.roll_deg:.4f} deg")
            for name, fix in zip(found.names, (found.first, found.second), strict=True)
        ],
        "Each alone",
    )  # fmt: skip
    value = "no difference shows" if found.equal else "the poses differ"
    head = (
        "<h1>Two records of one pose</h1>"
        + contradiction_box(found.contradictions)
        + f'<p class="value">{value}</p><p class="sub">chi-square '
        f"{significant(found.chi_square, 3)} of three degrees of freedom: as large by chance in "
        f"{_chance(found.probability)} where the poses are the same</p>"
    )
    return Page(
        f"Two records: {found.names[0]}, {found.names[1]}", head,
        [Section("Difference", html=table,
                 drawings=[Drawing("difference", figure_of([trace], layout), text)])],
    )  # fmt: skip
