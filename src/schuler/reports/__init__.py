"""Results as self-contained interactive pages; Plotly lives only here."""

from __future__ import annotations

from schuler.reports.alignment import report

__all__ = ["report"]
