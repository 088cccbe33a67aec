"""A figure as plain data, in the words of Plotly's JSON, which pages and Matplotlib both draw.

Each figure is described once, by a list of traces and a layout. `Figure.to_plotly` makes of it
what a page shows; `schuler.reports.matplotlib_figures` draws the same description without a
browser.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from schuler.errors import installed

__all__ = ["Figure", "bar", "graph_objects", "heatmap", "scatter"]

Trace = dict[str, Any]

_SAME_DECADE, _NARROW = 4.0, 300.0
"""Ratios below which a logarithmic axis is a linear one, and is marked at 1, 2 and 5."""


@dataclass(frozen=True)
class Figure:
    """Traces and a layout, with the keys of Plotly's JSON.

    Parameters
    ----------
    data : list of dict
        Traces: ``scatter``, ``bar`` and ``heatmap``.
    layout : dict
        Axes, shapes, annotations.
    """

    data: list[Trace]
    layout: dict[str, Any]

    @property
    def empty(self) -> bool:
        """Whether no trace has a point to show."""
        return not any(_finite(trace.get("z", trace["y"])) for trace in self.data)

    def to_plotly(self) -> Any:
        """Return a `plotly.graph_objects.Figure`.

        Raises
        ------
        SchulerError
            If Plotly is not installed.
        """
        # The default template repeats itself in every figure: 7 kB that the page's style replaces.
        layout = {"template": "none", **self.layout}
        for letter in "xy":
            axis = layout.get(f"{letter}axis", {})
            if axis.get("type") != "log" or "dtick" in axis or "range" in axis:
                continue
            span = _ratio(self.data, letter)
            if span < _SAME_DECADE:
                layout[f"{letter}axis"] = {**axis, "type": "linear"}
            elif span < _NARROW:
                # Powers of ten alone are too few marks: 1, 2 and 5 of each.
                layout[f"{letter}axis"] = {**axis, "dtick": "D2"}
        return graph_objects().Figure(self.data, layout)

    def to_csv(self) -> str:
        """Return what is drawn as a table: a row to each point, with the name of its trace."""
        axes = [_title(self.layout, axis) or axis for axis in "xy"]
        lines = [",".join(_cell(text) for text in ("trace", *axes, "value"))]
        for k, trace in enumerate(self.data, 1):
            name = _cell(trace.get("name") or f"trace {k}")
            lines += [
                ",".join((name, *(_cell(value) for value in point))) for point in _points(trace)
            ]
        return "\n".join(lines) + "\n"


def _finite(values: Any) -> bool:
    """Say whether a row or a matrix has a number or a word."""
    array = np.asarray(values, dtype=object).ravel()
    return any(v is not None and not (isinstance(v, float) and np.isnan(v)) for v in array)


def _ratio(data: list[Trace], letter: str) -> float:
    """Return the largest over the smallest positive number along an axis, 1 where there is none."""
    numbers = [
        float(v) for trace in data for v in trace[letter] if isinstance(v, float | int | np.number)
    ]
    positive = [v for v in numbers if v > 0.0 and np.isfinite(v)]
    return max(positive) / min(positive) if positive else 1.0


def _title(layout: dict[str, Any], axis: str) -> str:
    return str(layout.get(f"{axis}axis", {}).get("title", {}).get("text", ""))


def _points(trace: Trace) -> Iterator[tuple[Any, Any, Any]]:
    """Give x, y and value (of a heat map alone) of each point."""
    if trace["type"] != "heatmap":
        for x, y in zip(trace["x"], trace["y"], strict=True):
            yield x, y, ""
        return
    for y, row in zip(trace["y"], trace["z"], strict=True):
        for x, z in zip(trace["x"], row, strict=True):
            yield x, y, z


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float | np.floating) and np.isnan(value)):
        return ""
    if isinstance(value, float | np.floating):
        return f"{float(value):.10g}"
    text = str(value)
    if any(mark in text for mark in ',"\n\r'):
        return '"' + text.replace('"', '""') + '"'
    return text


def scatter(**more: Any) -> Trace:
    """Return a trace of points or a line."""
    return {"type": "scatter", **more}


def bar(**more: Any) -> Trace:
    """Return a trace of bars."""
    return {"type": "bar", **more}


def heatmap(**more: Any) -> Trace:
    """Return a trace of coloured cells."""
    return {"type": "heatmap", **more}


def graph_objects() -> Any:
    """Return Plotly's module of figures and traces.

    Raises
    ------
    SchulerError
        If Plotly is not installed.
    """
    with installed("reports need Plotly", "report"):
        import plotly.graph_objects
    return plotly.graph_objects
