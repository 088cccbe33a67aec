"""Draw the figures of the reports by Matplotlib: the same description, without a browser.

Covers what the reports use of Plotly: lines, points, bands, bars, error bars, heat maps,
logarithmic and categorical axes, shapes and annotations. Matplotlib is imported only here.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from schuler._files import replacing
from schuler.errors import InputError, installed
from schuler.reports.figure import Figure, Trace

__all__ = ["KINDS", "draw_all", "draw_one", "write_picture"]

KINDS = ("svg", "png", "pdf")

_COLUMNS = 2
_WIDTH, _DOTS = 7.5, 100.0
"""Width of a column, inch, and pixels of a page to an inch."""

_MARKERS = {
    "circle": "o", "circle-open": "o", "square": "s", "diamond": "D", "x": "x",
    "line-ns-open": "|", "line-ew-open": "_",
}  # fmt: skip
_DASHES = {"solid": "-", "dash": "--", "dot": ":"}


def _figure_class() -> Any:
    with installed("plots need Matplotlib", "plot"):
        from matplotlib.figure import Figure as Canvas
    return Canvas


def draw_all(figures: Sequence[tuple[str, Figure]], *, shown: bool = True) -> Any:
    """Return a Matplotlib figure with all figures, two to a row.

    Parameters
    ----------
    figures : sequence of (str, Figure)
    shown : bool
        Whether pyplot is to know of it, so that notebooks and ``plt.show()`` show it.

    Raises
    ------
    SchulerError
        If Matplotlib is not installed.
    """
    canvas = _figure_class()
    columns = min(_COLUMNS, len(figures))
    rows = -(-len(figures) // columns)
    heights = [
        max(figure.layout["height"] for _, figure in figures[k * columns : (k + 1) * columns])
        for k in range(rows)
    ]
    size = (_WIDTH * columns, sum(heights) / _DOTS + 0.4 * rows)
    if shown:
        from matplotlib import pyplot as plt

        out = plt.figure(figsize=size, layout="constrained")
    else:
        out = canvas(figsize=size, layout="constrained")
    axes = out.subplots(rows, columns, squeeze=False, height_ratios=heights).ravel()
    for ax, (name, figure) in zip(axes, figures, strict=False):
        _draw(figure, ax)
        if len(figures) > 1:
            ax.set_title(name, fontsize="medium", loc="left")
    for ax in axes[len(figures) :]:
        ax.remove()
    return out


def draw_one(figure: Figure, ax: Any = None) -> Any:
    """Draw one figure into axes, or into a figure of its own; return the Matplotlib figure.

    Raises
    ------
    SchulerError
        If Matplotlib is not installed.
    """
    if ax is None:
        return draw_all([("", figure)])
    _draw(figure, ax)
    return ax.figure


def write_picture(figures: Sequence[tuple[str, Figure]], path: str | Path) -> None:
    """Write figures as one picture, whole or not at all: .svg, .png or .pdf.

    Raises
    ------
    InputError
        If the suffix is another, or the file cannot be written.
    SchulerError
        If Matplotlib is not installed.
    """
    path = Path(path)
    kind = path.suffix[1:]
    if kind not in KINDS:
        raise InputError(f"{path}: a picture is written as {' or '.join('.' + k for k in KINDS)}")
    drawn = draw_all(figures, shown=False)
    # The same picture for the same figures: no date in it.
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    with replacing(path) as part:
        drawn.savefig(part, format=kind, metadata=metadata)


def _plain(text: str) -> str:
    """Return text without the marks of HTML; Matplotlib reads a pair of dollars as a formula."""
    return re.sub(r"<br ?/?>", "\n", re.sub(r"</?[bi]>", "", text)).replace("$", r"\$")


def _colour(value: Any) -> Any:
    """Return a colour of Plotly (#rrggbb, rgba(...), or a list of these) as Matplotlib takes it."""
    if isinstance(value, list | tuple):
        return [_colour(v) for v in value]
    found = re.fullmatch(r"rgba\((\d+), ?(\d+), ?(\d+), ?([\d.]+)\)", str(value))
    if found:
        red, green, blue, alpha = found.groups()
        return (int(red) / 255, int(green) / 255, int(blue) / 255, float(alpha))
    return value


def _draw(figure: Figure, ax: Any) -> None:
    layout = figure.layout
    right = None
    if "yaxis2" in layout:
        right = ax.twinx()
        right.set_ylabel(_plain(layout["yaxis2"]["title"]["text"]))
    for letter in "xy":
        if "categoryarray" in layout[f"{letter}axis"]:
            # Words stand in this order, whichever comes first in a trace.
            getattr(ax, f"{letter}axis").update_units(
                list(layout[f"{letter}axis"]["categoryarray"])
            )
    bars = [trace for trace in figure.data if trace["type"] == "bar"]
    for trace in figure.data:
        target = right if right is not None and trace.get("yaxis") == "y2" else ax
        if trace["type"] == "bar":
            _bars(trace, target, bars, layout.get("barmode") == "group")
        elif trace["type"] == "heatmap":
            _heatmap(trace, target)
        else:
            _line(trace, target)
    _axes(layout, ax)
    _shapes(layout, ax)
    if right is not None and layout["yaxis2"].get("rangemode") == "tozero":
        right.set_ylim(bottom=0.0)
    named = [trace for trace in figure.data if trace.get("name") and trace["type"] != "heatmap"]
    if layout.get("showlegend", True) and named:
        handles, labels = ax.get_legend_handles_labels()
        if right is not None:
            more = right.get_legend_handles_labels()
            handles, labels = handles + more[0], labels + more[1]
        if handles:
            ax.legend(handles, labels, fontsize="small", framealpha=0.6)


def _values(values: Any) -> Any:
    """Return numbers as an array, words as a list."""
    items = list(values)
    if items and isinstance(items[0], str):
        return items
    return np.array([np.nan if v is None else v for v in items], dtype=float)


def _line(trace: Trace, ax: Any) -> None:
    x, y = _values(trace["x"]), _values(trace["y"])
    line, marker = trace.get("line", {}), trace.get("marker", {})
    name = trace.get("name") if trace.get("showlegend", True) else None
    label = _plain(name) if name else "_nolegend_"
    if trace.get("fill") == "toself":
        ax.fill(x, y, color=_colour(trace["fillcolor"]), linewidth=0, label=label)
        return
    mode = trace.get("mode", "lines")
    symbol = marker.get("symbol", "circle")
    colour = _colour(line.get("color", marker.get("color")))
    style: dict[str, Any] = {
        "color": colour,
        "linestyle": _DASHES[line.get("dash", "solid")] if "lines" in mode else "none",
        "linewidth": line.get("width", 1.6),
        "label": label,
        "drawstyle": "steps-post" if line.get("shape") == "hv" else "default",
    }
    if "markers" in mode:
        style |= {"marker": _MARKERS[symbol], "markersize": 0.75 * marker.get("size", 6)}
        if symbol.endswith("-open"):
            style["markerfacecolor"] = "none"
    errors = {
        key: _values(trace[f"error_{axis}"]["array"])
        for axis, key in (("x", "xerr"), ("y", "yerr"))
        if f"error_{axis}" in trace
    }
    if errors:
        ax.errorbar(x, y, elinewidth=1.2, capsize=2.5, **errors, **style)
    else:
        ax.plot(x, y, **style)


def _bars(trace: Trace, ax: Any, bars: list[Trace], grouped: bool) -> None:
    marker = trace.get("marker", {})
    style = {
        "color": _colour(marker.get("color")), "alpha": marker.get("opacity", 1.0),
        "label": _plain(trace["name"]) if trace.get("name") else "_nolegend_",
    }  # fmt: skip
    if trace.get("orientation") == "h":
        drawn = ax.barh(list(trace["y"]), list(trace["x"]), **style)
        if "text" in trace:
            ax.bar_label(drawn, [_plain(text) for text in trace["text"]], padding=3, fontsize=9)
        return
    x = list(trace["x"])
    words = bool(x) and isinstance(x[0], str)
    place = np.arange(len(x), dtype=float) if words else np.asarray(x, float)
    width = float(trace.get("width", 0.8 * (np.min(np.diff(place)) if len(place) > 1 else 1.0)))
    if grouped:
        at = next(k for k, other in enumerate(bars) if other is trace)
        width /= len(bars)
        place = place + (at - 0.5 * (len(bars) - 1)) * width
    ax.bar(place, list(trace["y"]), width, **style)
    if words:
        ax.set_xticks(np.arange(len(x)), x)


def _heatmap(trace: Trace, ax: Any) -> None:
    from matplotlib.colors import LinearSegmentedColormap

    scale = trace["colorscale"]
    if not isinstance(scale, str):
        scale = LinearSegmentedColormap.from_list("scale", [(at, colour) for at, colour in scale])
    x, y = list(trace["x"]), list(trace["y"])
    words = isinstance(x[0], str)
    across = np.arange(len(x)) if words else np.asarray(x, float)
    upward = np.arange(len(y)) if words else np.asarray(y, float)
    mesh = ax.pcolormesh(
        across, upward, np.asarray(trace["z"], float), cmap=scale, vmin=trace["zmin"],
        vmax=trace["zmax"], shading="nearest", rasterized=True,
    )  # fmt: skip
    if words:
        ax.set_xticks(across, [_plain(text) for text in x], rotation=90, fontsize=6)
        ax.set_yticks(upward, [_plain(text) for text in y], fontsize=6)
    legend = trace.get("colorbar", {})
    title = legend.get("title", "")
    bar = ax.figure.colorbar(mesh, ax=ax)
    bar.set_label(_plain(title["text"] if isinstance(title, dict) else title))
    if "tickvals" in legend:
        bar.set_ticks(legend["tickvals"], labels=legend["ticktext"])


def _axes(layout: dict[str, Any], ax: Any) -> None:
    for letter in "xy":
        axis = layout[f"{letter}axis"]
        getattr(ax, f"set_{letter}label")(_plain(axis["title"]["text"]))
        log = axis.get("type") == "log"
        if log:
            getattr(ax, f"set_{letter}scale")("log")
        if "range" in axis:
            low, high = (10.0**v if log else v for v in axis["range"])
            getattr(ax, f"set_{letter}lim")(low, high)
        if axis.get("rangemode") == "tozero" and "range" not in axis:
            getattr(ax, f"set_{letter}lim")(0.0)
        if axis.get("autorange") == "reversed":
            getattr(ax, f"invert_{letter}axis")()
        if "tickangle" in axis and letter == "x":
            ax.tick_params("x", labelrotation=abs(axis["tickangle"]))
        if "tickfont" in axis:
            ax.tick_params(letter, labelsize=0.75 * axis["tickfont"]["size"])
        if log:
            _ticks(getattr(ax, f"{letter}axis"))
    if "scaleanchor" in layout["yaxis"]:
        ax.set_aspect("equal", adjustable="datalim")
    if not any(layout[f"{letter}axis"].get("showgrid") is False for letter in "xy"):
        ax.grid(alpha=0.3)


def _ticks(axis: Any) -> None:
    """Mark 1, 2 and 5 of each decade where there are few, and say them without powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = sorted(axis.get_view_interval())
    if not (low > 0.0 and high / low < 300.0):
        return
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.4g}"))
    axis.set_minor_formatter(NullFormatter())


def _shapes(layout: dict[str, Any], ax: Any) -> None:
    for shape in layout.get("shapes", ()):
        # A shape spans the whole of the axis that it measures in parts of the paper.
        if shape["type"] == "rect":
            ax.axvspan(shape["x0"], shape["x1"], color=_colour(shape["fillcolor"]), linewidth=0)
            continue
        line = shape["line"]
        style = {"color": line["color"], "linestyle": _DASHES[line.get("dash", "solid")]}
        if shape.get("xref") == "paper":
            ax.axhline(shape["y0"], **style)
        else:
            ax.axvline(shape["x0"], **style)
    for note in layout.get("annotations", ()):
        logs = [layout[f"{letter}axis"].get("type") == "log" for letter in "xy"]
        x, y = (10.0 ** note[k] if log else note[k] for k, log in zip("xy", logs, strict=True))
        where = ax.get_xaxis_transform() if note.get("yref") == "paper" else ax.transData
        ax.text(
            x, y, _plain(note["text"]), transform=where, fontsize=9,
            color=note.get("font", {}).get("color"), ha=note.get("xanchor", "center"),
            va={"bottom": "bottom", "top": "top"}.get(note.get("yanchor", ""), "center"),
        )  # fmt: skip
