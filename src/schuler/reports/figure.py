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

_MOST_DECADES = 7
"""Powers of ten that are marked on a wider one."""

_PLAIN_EXPONENT = 6
"""Numbers of an axis below this power of ten are written out: 70500, not 70.5k."""


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
        plain = {"exponentformat": "power", "minexponent": _PLAIN_EXPONENT}
        for name in ("xaxis", "yaxis", "yaxis2"):
            if name in layout or name != "yaxis2":
                layout[name] = {**plain, **layout.get(name, {})}
        for letter in "xy":
            axis = layout[f"{letter}axis"]
            if axis.get("type") == "log" and "dtick" not in axis:
                axis.update(_log_ticks(*_limits(self.data, letter, axis), "range" in axis))
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


def _limits(data: list[Trace], letter: str, axis: dict[str, Any]) -> tuple[float, float]:
    """Return the limits of a logarithmic axis: said, or the least and largest positive number."""
    if "range" in axis:
        low, high = axis["range"]
        return 10.0**low, 10.0**high
    numbers = [
        float(v) for trace in data for v in trace[letter] if isinstance(v, float | int | np.number)
    ]
    positive = [v for v in numbers if v > 0.0 and np.isfinite(v)]
    return (min(positive), max(positive)) if positive else (1.0, 1.0)


def _log_ticks(low: float, high: float, said: bool) -> dict[str, Any]:
    """Return the marks of a logarithmic axis: 1, 2 and 5 written out, or powers of ten."""
    if high / low < _SAME_DECADE and not said:
        return {"type": "linear"}
    if high / low >= _NARROW:
        decades = float(np.log10(high / low))
        return {"dtick": float(np.ceil(decades / _MOST_DECADES))}
    # Plotly's own marks between powers of ten are a 2 and a 5 alone, of which decade nobody sees.
    powers = range(int(np.floor(np.log10(low))) - 1, int(np.ceil(np.log10(high))) + 1)
    values = [float(f"{m}e{p}") for p in powers for m in (1, 2, 5)]
    values = [v for v in values if 0.5 * low <= v <= 2.0 * high]
    return {"tickmode": "array", "tickvals": values, "ticktext": [_number(v) for v in values]}


def _number(value: float) -> str:
    """Return a number of one digit without an exponent, where it is not far from 1."""
    if 1e-4 <= value < 10.0**_PLAIN_EXPONENT:
        return np.format_float_positional(value, trim="-")
    power = int(np.floor(np.log10(value) + 1e-9))
    digit = round(value / 10.0**power)
    return f"10<sup>{power}</sup>" if digit == 1 else f"{digit}·10<sup>{power}</sup>"


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
