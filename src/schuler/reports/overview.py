"""One table of many records: what each gave, which could not be used, what contradicts itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import PurePath
from typing import Any

import numpy as np

from schuler._result import Result, table_of_rows
from schuler.errors import printable
from schuler.reports.figure import Trace, scatter
from schuler.reports.figures import BLUE, ORANGE, figure_of, plot_layout
from schuler.reports.page import Drawing, Page, Section

__all__ = ["COMMANDS", "Overview", "overview_page"]

_MOST_ROWS = 500
"""Rows of the report's table; files have all."""

_FEW_RECORDS = 20
"""Records that are marked one by one."""

#: ends of columns' names, the longest first, and the units that they say
_UNITS = {
    "_ug_sqrt_hz": "ug/sqrt(Hz)", "_deg_sqrt_h": "deg/sqrt(h)", "_m_s2": "m/s^2",
    "_arcmin": "arcmin", "_deg_h": "deg/h", "_deg": "deg", "_hz": "Hz", "_ug": "ug", "_s": "s",
}  # fmt: skip

Row = dict[str, Any]


@dataclass(frozen=True)
class _Kind:
    """How a command's documents become rows, and which columns are drawn.

    Parameters
    ----------
    row : callable
        From a document to its columns.
    forms : dict of str to str
        Formats of the columns, in their order.
    drawn : tuple of (str, str or None)
        A column to a figure, with that of its 1-sigma.
    """

    row: Callable[[Mapping[str, Any]], Row]
    forms: dict[str, str]
    drawn: tuple[tuple[str, str | None], ...]


def _align(d: Mapping[str, Any]) -> Row:
    limit = d.get("limit_arcmin")
    return {
        "duration_s": d["time"]["duration_s"], "heading_deg": d["heading_deg"],
        "heading_sigma_arcmin": d["heading_sigma_arcmin"],
        "limit_arcmin": None if limit is None else limit["up"],
        "pitch_deg": d["pitch_deg"], "roll_deg": d["roll_deg"], "method": d["method"]["name"],
    }  # fmt: skip


def _info(d: Mapping[str, Any]) -> Row:
    return {
        "duration_s": d["time"]["duration_s"], "rate_hz": d["time"]["rate_hz"],
        "mean_rate_deg_h": d["mean_rate_norm_deg_h"],
        "mean_force_m_s2": d["norm_of_mean_force_m_s2"],
        "gyro_deg_sqrt_h": d["noise"]["gyro_deg_sqrt_h"],
        "accelerometer_ug_sqrt_hz": d["noise"]["accelerometer_ug_sqrt_hz"],
        "quiet_s": d["quiet_s"], "gaps": d["gaps"],
    }  # fmt: skip


def _allan(d: Mapping[str, Any]) -> Row:
    def rms(part: str, term: str) -> float | None:
        fits = [c["fit"] for name, c in d["channels"].items() if name.startswith(part)]
        values = [fit[term]["value"] for fit in fits if fit is not None]
        # A term that no axis shows is 0 in the document.
        return float(np.sqrt(np.mean(np.square(values)))) if any(values) else None

    return {
        "longest_tau_s": d["tau_s"][-1],
        "angle_random_walk_deg_sqrt_h": rms("gyro", "angle_random_walk"),
        "gyro_bias_instability_deg_h": rms("gyro", "bias_instability"),
        "velocity_random_walk_ug_sqrt_hz": rms("accel", "velocity_random_walk"),
        "accelerometer_bias_instability_ug": rms("accel", "bias_instability"),
    }


#: commands that take many records
COMMANDS = {
    "align": _Kind(
        _align,
        {"duration_s": ".6g", "heading_deg": ".4f", "heading_sigma_arcmin": ".3g",
         "limit_arcmin": ".3g", "pitch_deg": ".4f", "roll_deg": ".4f", "method": "s"},
        (("heading_deg", "heading_sigma_arcmin"),),
    ),
    "info": _Kind(
        _info,
        {"duration_s": ".6g", "rate_hz": ".5g", "mean_rate_deg_h": ".4g",
         "mean_force_m_s2": ".5f", "gyro_deg_sqrt_h": ".3g", "accelerometer_ug_sqrt_hz": ".3g",
         "quiet_s": ".4g", "gaps": "d"},
        (("gyro_deg_sqrt_h", None), ("accelerometer_ug_sqrt_hz", None)),
    ),
    "allan": _Kind(
        _allan,
        {"longest_tau_s": ".4g", "angle_random_walk_deg_sqrt_h": ".4g",
         "gyro_bias_instability_deg_h": ".4g", "velocity_random_walk_ug_sqrt_hz": ".4g",
         "accelerometer_bias_instability_ug": ".4g"},
        (("angle_random_walk_deg_sqrt_h", None), ("velocity_random_walk_ug_sqrt_hz", None)),
    ),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Overview(Result):
    """What a command gave of many records.

    Parameters
    ----------
    command : {"align", "info", "allan"}
    records : tuple of mapping
        In the order of the files: ``file``, ``document`` (as the command's ``--json`` writes it;
        None where there is none), ``error`` (a sentence, or None) and ``warnings``.
    """

    command: str
    records: tuple[Mapping[str, Any], ...] = field(repr=False)

    @property
    def failed(self) -> int:
        """Records that could not be used."""
        return sum(record["document"] is None for record in self.records)

    @property
    def contradicted(self) -> int:
        """Records that contradict their result."""
        return sum(bool(_contradictions(record)) for record in self.records)

    def rows(self) -> list[Row]:
        """Return a row to each record; what one without a result has is None."""
        kind = COMMANDS[self.command]
        out = []
        for record in self.records:
            document = record["document"]
            said = _contradictions(record)
            found = dict.fromkeys(kind.forms) if document is None else kind.row(document)
            warned = [text.removeprefix("warning: ") for text in record["warnings"]]
            note = record["error"] or "; ".join(said) or "; ".join(warned[:1])
            out.append({"file": record["file"], **found, "consistent": not said, "note": note})
            if document is None:
                out[-1]["consistent"] = None
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return all rows with the counts of what could not be used and what contradicts itself."""
        return {
            "schema": "schuler.records/1", "command": self.command, "records": len(self.records),
            "failed": self.failed, "contradicted": self.contradicted, "rows": self.rows(),
        }  # fmt: skip

    def columns(self) -> dict[str, Any]:
        """Return a row to each record."""
        return table_of_rows(self.rows())

    def __str__(self) -> str:
        forms = COMMANDS[self.command].forms
        rows = self.rows()
        names = [_short(row["file"]) for row in rows]
        wide = min(40, max([6, *map(len, names)]))
        cells = [[_cell(row[key], form) for key, form in forms.items()] for row in rows]
        heads = [_words(key) for key in forms]
        widths = [max(len(head), *(len(c[k]) for c in cells)) for k, head in enumerate(heads)]
        lines = [f"{'record':<{wide}}  " + "  ".join(map(str.rjust, heads, widths))]
        for name, row, line in zip(names, rows, cells, strict=True):
            told = "  ".join(map(str.rjust, line, widths))
            lines.append(
                f"{name:<{wide}}  {told}" + (f"  {printable(row['note'])}" if row["note"] else "")
            )
        lines.append(self.headline())
        return "\n".join(line.rstrip() for line in lines)

    def headline(self) -> str:
        """Return in a sentence how many records gave a result."""
        done = len(self.records) - self.failed
        told = f"{done} of {len(self.records)} records have a result"
        if self.contradicted:
            told += f", {self.contradicted} of them contradicted by the record"
        return told


def _contradictions(record: Mapping[str, Any]) -> list[str]:
    document = record["document"]
    return [] if document is None else list(document.get("contradictions") or ())


def _short(name: str) -> str:
    path = PurePath(name)
    return printable(name if len(name) <= 40 else path.name[-40:])


def _cell(value: Any, form: str) -> str:
    return "-" if value is None else format(value, form)


def overview_page(found: Overview) -> Page:
    """Return the page of many records."""
    kind = COMMANDS[found.command]
    rows = found.rows()
    drawings = [_drawing(rows, name, sigma) for name, sigma in kind.drawn]
    sections = [Section("Records", drawings=[d for d in drawings if d is not None])]
    heads = ["record", *map(_words, kind.forms), "note"]
    body = "".join(
        f'<tr><th scope="row">{escape(_short(row["file"]))}</th>'
        + "".join(f"<td>{escape(_cell(row[key], form))}</td>" for key, form in kind.forms.items())
        + f'<td class="words">{escape(row["note"])}</td></tr>'
        for row in rows[:_MOST_ROWS]
    )
    more = len(rows) - _MOST_ROWS
    after = f"<p>{more} more are in the JSON lines alone.</p>" if more > 0 else ""
    table = (
        "<table><caption>A row to each record</caption><thead><tr>"
        + "".join(f'<th scope="col">{escape(head)}</th>' for head in heads)
        + f"</tr></thead><tbody>{body}</tbody></table>{after}"
    )
    head = (
        f"<h1>{escape(found.command)} of many records</h1>"
        f'<p class="value">{len(rows) - found.failed} <span class="pm">of {len(rows)} records have '
        f'a result</span></p><p class="sub">{escape(_ranges(rows, kind, found.contradicted))}</p>'
    )
    return Page(
        f"{found.command} of {len(rows)} records", head, [*sections, Section("Table", html=table)]
    )


def _drawing(rows: Sequence[Row], name: str, sigma: str | None) -> Drawing | None:
    """Draw a column over the records, with its 1-sigma where it has one."""
    known = [(k, row) for k, row in enumerate(rows, 1) if row[name] is not None]
    if not known:
        return None
    words = _words(name)
    traces: list[Trace] = []
    for good, label, colour in ((True, "consistent", BLUE), (False, "contradicted", ORANGE)):
        own = [(k, row) for k, row in known if row["consistent"] is good]
        if not own:
            continue
        trace = scatter(
            x=[k for k, _ in own], y=[row[name] for _, row in own], mode="markers", name=label,
            marker={"color": colour, "size": 7},
            text=[_short(row["file"]) for _, row in own],
            hovertemplate="%{text}: %{y:.5g}<extra></extra>",
        )  # fmt: skip
        if sigma is not None:
            spread = [row[sigma] / 60.0 for _, row in own]
            trace["error_y"] = {"type": "data", "array": spread, "color": colour, "thickness": 1.2}
        traces.append(trace)
    what, _, unit = words.partition(", ")
    text = f"{what.capitalize()} of each record, {unit}" + (", with 1 sigma." if sigma else ".")
    layout = plot_layout(360, "record, in the order of the files", words, hovermode="closest")
    if len(rows) <= _FEW_RECORDS:
        # Nothing lies between two records.
        layout["xaxis"].update(dtick=1)
    return Drawing(words, figure_of(traces, layout), text)


def _words(key: str) -> str:
    """Return a column's name in words, its unit behind a comma: ``heading, deg``.

    Examples
    --------
    >>> _words("gyro_bias_instability_deg_h"), _words("method")
    ('gyro bias instability, deg/h', 'method')
    """
    for end, unit in _UNITS.items():
        if key.endswith(end):
            return f"{key.removesuffix(end).replace('_', ' ')}, {unit}"
    return key.replace("_", " ")


def _ranges(rows: Sequence[Row], kind: _Kind, contradicted: int) -> str:
    """Return in a sentence between which values the drawn columns lie."""
    told = [f"{contradicted} contradicted by the record"] if contradicted else []
    for name, sigma in kind.drawn:
        for key in (name, sigma):
            values = [row[key] for row in rows if key is not None and row[key] is not None]
            if values and key is not None:
                low, high = (format(v, kind.forms[key]) for v in (min(values), max(values)))
                words, _, unit = _words(key).partition(", ")
                told.append(f"{words} from {low} to {high} {unit}" if low != high
                            else f"{words} {low} {unit}")  # fmt: skip
    text = "; ".join(told) or "see the notes in the table"
    return f"{text[0].upper()}{text[1:]}."
