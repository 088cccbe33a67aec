"""What the page of a live alignment shows: one state, made of each solution, as JSON.

A browser is sent the whole state each time, its convergence included, so that one that connects
late or misses an event shows the same as all others. The number of points is bounded.
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from schuler.alignment.result import NO_HEADING, Alignment
from schuler.alignment.session import SpanFix
from schuler.io.gnss.nmea_stream import REASONS as FIX_REASONS
from schuler.io.packets import REASONS as PACKET_REASONS
from schuler.io.streams import REASONS as STREAM_REASONS

__all__ = ["LivePage", "page_html"]

POINTS = 400
"""Most points of the convergence; from there on every second one is dropped."""

_NOTES = 5
"""Notes that are shown, the newest."""

_TOLD = {
    "aligned": "aligned",
    "lost": "lost on the way",
    "repeated": "repeated",
    "late": "too late",
    "held": "waiting for a sample before them",
    **{name: text.replace(" (--key-file)", "") for name, text in STREAM_REASONS.items()},
    **{name: text.replace(" (--key-file)", "") for name, text in PACKET_REASONS.items()},
}


_OF_FIXES = {"fixes": "taken", "off_clock": "off the clock of the samples", **FIX_REASONS}


class LivePage:
    """The state of a live alignment as its page shows it.

    Parameters
    ----------
    source : str
        Where samples come from, as ``udp:127.0.0.1:5005``.
    every : float
        Time between solutions, s: the page says when one is overdue.

    Examples
    --------
    >>> page = LivePage("udp:127.0.0.1:5005")
    >>> page.state["phase"], page.state["heading"]
    ('waiting', None)
    """

    def __init__(self, source: str, every: float = 1.0) -> None:
        self._points: list[list[float | None]] = []
        self._stride = 1
        self._seen = 0
        self._span = 0
        self._begun = 0.0
        self._notes: list[str] = []
        self.state: dict[str, Any] = {
            "phase": "waiting", "source": source, "every": every, "silent": None,
            "heading": None, "facts": [], "why": "", "span": 0, "spans": 0, "counts": [],
            "fixes": [], "contradictions": [], "warnings": [], "notes": [], "end": "",
            "points": [],
        }  # fmt: skip

    def update(
        self,
        found: SpanFix | None,
        counts: Mapping[str, int],
        spans: int = 0,
        *,
        silent: float | None = None,
        trouble: str | None = None,
        aid_counts: Mapping[str, int] | None = None,
    ) -> None:
        """Take a solution, or that there is none yet.

        Parameters
        ----------
        found : SpanFix or None
        counts : mapping of str to int
            What became of the packets, as `LiveSession.counts`.
        spans : int
            Spans so far.
        silent : float, optional
            Time since the last sample, s.
        trouble : str, optional
            Why there is no solution.
        aid_counts : mapping of str to int, optional
            What became of the fixes, of an alignment in motion.
        """
        self.state |= {
            "silent": silent, "spans": spans, "why": trouble or "",
            "counts": _counts(counts, _TOLD),
            "fixes": _counts(aid_counts or {}, _OF_FIXES),
            "contradictions": [], "warnings": [],
        }  # fmt: skip
        if found is None:
            return
        fix = found.alignment
        if found.span != self._span:
            # Times of another span have another beginning.
            self._span, self._points, self._stride, self._seen = found.span, [], 1, 0
            self._begun = fix.start
        self._add(fix)
        self.state |= {
            "phase": "aligning", "span": found.span, "heading": _heading(fix),
            "facts": _facts(fix), "contradictions": list(fix.contradictions),
            "warnings": list(fix.warnings), "points": self._points,
        }  # fmt: skip

    def note(self, text: str) -> None:
        """Take a sentence on what happened.

        Examples
        --------
        >>> page = LivePage("-")
        >>> page.note("the sender restarted")
        >>> page.state["notes"]
        ['the sender restarted']
        """
        self._notes = [*self._notes[1 - _NOTES :], text]
        self.state["notes"] = self._notes

    def finish(self, contradictions: Sequence[str] = (), error: str | None = None) -> None:
        """Say that the stream has ended: the last result stays.

        Parameters
        ----------
        contradictions : sequence of str
            Why the result is not to be trusted.
        error : str, optional
            Why there is no result.

        Examples
        --------
        >>> page = LivePage("-")
        >>> page.finish(error="no sample came")
        >>> page.state["phase"], page.state["end"]
        ('failed', 'The stream has ended without a result: no sample came.')
        """
        known = self.state["contradictions"]
        told = [text for text in contradictions if text not in known]
        self.state |= {"contradictions": [*known, *told], "silent": None, "why": ""}
        if error is None:
            self.state |= {"phase": "ended", "end": "The stream has ended: this is the result."}
        else:
            end = f"The stream has ended without a result: {error.rstrip('.')}."
            self.state |= {"phase": "failed", "end": end}

    def event(self) -> bytes:
        r"""Return the state as one server-sent event.

        Examples
        --------
        >>> LivePage("-").event()[:17]
        b'event: state\ndata'
        """
        return f"event: state\ndata: {json.dumps(self.state, allow_nan=False)}\n\n".encode()

    def _add(self, fix: Alignment) -> None:
        """Add a point of the convergence: time, heading, sigma and limit (arcmin).

        The time is that since the span began; the part of it that a stream in motion uses ends
        with it and may be shorter.
        """
        bound = fix.limit_arcmin
        point = [
            fix.end - self._begun, fix.heading_deg, fix.heading_sigma_arcmin,
            None if bound is None else float(bound[2]),
        ]  # fmt: skip
        point = [v if v is not None and math.isfinite(v) else None for v in point]
        if self._points and self._points[-1][0] == point[0]:
            return
        # The newest is always there; those before it are evenly apart.
        if self._points and (self._seen - 1) % self._stride:
            del self._points[-1]
        self._points = [*self._points, point]
        self._seen += 1
        if len(self._points) > POINTS:
            self._points, self._stride = self._points[::2], 2 * self._stride


def _counts(counts: Mapping[str, int], told: Mapping[str, str]) -> list[list[str | int]]:
    """Return how many packets and what became of them, those that are none left out."""
    return [
        [n, told.get(name, name.replace("_", " "))]
        for name, n in counts.items()
        # The sum of two others; and what counts even as none.
        if name != "damaged" and (n or name in ("aligned", "lost"))
    ]


def _digits(sigma: float) -> int:
    """Return the decimals of an angle in degrees that its sigma (arcmin) leaves meaningful."""
    if not math.isfinite(sigma):
        return 0
    return min(max(1 - math.floor(math.log10(max(sigma / 60.0, 1e-6))), 0), 5)


def _degrees(value: float, sigma: float) -> str:
    """Return an angle in degrees to the decimals that its sigma (arcmin) leaves meaningful."""
    digits = _digits(sigma)
    # A level that is rounded to nothing has no sign.
    return f"{round(value, digits) + 0.0:.{digits}f}°"


def _arcmin(value: float) -> str:
    """Return an angle in arcmin, or in degrees where it has many."""
    if not math.isfinite(value):
        return "not observable"
    return f"{value / 60.0:.0f}°" if value > 600.0 else f"{value:.2g}′"


def _heading(fix: Alignment) -> dict[str, str]:
    sigma = fix.heading_sigma_arcmin
    if sigma > 60.0 * NO_HEADING:
        return {"value": "no heading", "sigma": f"sigma {_arcmin(sigma)}"}
    digits = _digits(sigma)
    # Rounded before it is written: 359.999 is 0.00, and not 360.00.
    value = round(fix.heading_deg, digits) % 360.0
    return {"value": f"{value:.{digits}f}°", "sigma": f"± {_arcmin(sigma)}"}


def _facts(fix: Alignment) -> list[list[str]]:
    """Return values with what they are: level, sigma against its bound, time."""
    east, north, _ = map(float, fix.sigma_arcmin)
    up = fix.heading_sigma_arcmin
    bound = None if fix.limit_arcmin is None else float(fix.limit_arcmin[2])
    unknown = "give --spec" if fix.spec is None else "none stated"
    against = unknown if bound is None else f"{_arcmin(up)} / {_arcmin(bound)}"
    return [
        [_degrees(fix.pitch_deg, max(east, north)), "pitch"],
        [_degrees(fix.roll_deg, max(east, north)), "roll"],
        [f"{_arcmin(east)} · {_arcmin(north)}", "level, 1 sigma east · north"],
        [against, "heading: sigma / its lower bound"],
        [f"{fix.duration:.0f} s", f"{fix.samples} samples, {fix.method}"],
    ]


def page_html() -> tuple[str, str]:
    """Return the page, and the policy of its content: its own script and style, nothing else.

    Examples
    --------
    >>> html, policy = page_html()
    >>> html[:15], "default-src 'none'" in policy
    ('<!doctype html>', True)
    """
    assets = files("schuler.reports")
    style = assets.joinpath("live.css").read_text(encoding="utf-8")
    script = assets.joinpath("live.js").read_text(encoding="utf-8")
    html = assets.joinpath("live.html").read_text(encoding="utf-8")
    html = html.replace("{{style}}", style).replace("{{script}}", script)
    policy = (
        f"default-src 'none'; script-src {_digest(script)}; style-src {_digest(style)}; "
        "connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'"
    )
    return html, policy


def _digest(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
