"""Results as self-contained interactive pages; Plotly lives only here."""

from __future__ import annotations

from schuler._face import callable_room
from schuler.report.alignment import report

__all__ = ["report"]

callable_room(__name__)
