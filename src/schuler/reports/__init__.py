"""Results as self-contained interactive pages and as pictures; Plotly and Matplotlib live here."""

from __future__ import annotations

from schuler.reports.results import report, save_figures

__all__ = ["report", "save_figures"]
