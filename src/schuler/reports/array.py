"""The page of ``schuler array``: variance with every set of sensors, and reliability."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from schuler.reports.figures import BLUE, GREEN, GREY, ORANGE, figure_of, line_of, plot_layout
from schuler.reports.page import Drawing, Section, definition_table, graph_objects, write_page
from schuler.sensors import Reliability, SensorArray, isolable, named_array

__all__ = ["array_report"]

_MOST_BARS = 12


def array_report(array: SensorArray, reliability: Reliability, path: str | Path) -> None:
    """Write the page.

    Parameters
    ----------
    array : SensorArray
    reliability : Reliability
        Of this array.
    path : str or Path
        The HTML file.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    life, n = reliability.life, len(array)
    triad = Reliability(named_array("triad"), life, reliability.coverage)
    double = Reliability(named_array("triad-plus-one"), life, reliability.coverage)
    figures = array.figures()
    ratio = reliability.mtbf / triad.mtbf
    head = (
        f"<h1>Array · {escape(array.name)}</h1>"
        f'<p class="value">{ratio:.3g} times <span class="pm">the life of three</span></p>'
        f'<p class="sub">{n} sensors, {reliability.mtbf:.1f} h mean time to failure '
        f"(one sensor {life.mtbf:g} h); total variance {figures['total_variance']:.4g}, at best "
        f"{9 / n:.4g}.</p>"
    )
    told = (
        "the parity tells which sensor is wrong" if n > 3 and isolable(array)
        else "the parity sees that a sensor is wrong, not which" if n > 3
        else "there is no redundancy: a wrong sensor is not seen"
    )  # fmt: skip
    rows = [
        *(
            (f"direction {k}", ", ".join(f"{v:.6f}" for v in row))
            for k, row in enumerate(array.h)
        ),
        ("optimal (H^T H = n/3 I)", "yes" if figures["optimal"] else "no"),
        ("condition of H^T H", f"{figures['condition']:.4g}"),
        ("faults", told),
        ("coverage", f"{reliability.coverage:g}"),
        ("Weibull shape", f"{life.shape:g}"),
        ("MTBF against an orthogonal triad", f"{ratio:.4g}"),
        ("MTBF against a triad with one axis doubled", f"{reliability.mtbf / double.mtbf:.4g}"),
    ]  # fmt: skip
    write_page(
        path,
        f"Array: {array.name}",
        head,
        [
            Section("Variance of each axis", drawings=[_variances(array)]),
            Section("Reliability", drawings=[_curves(array, reliability, triad, double)]),
            Section("Figures", html=definition_table(rows, "Directions in body axes, and figures")),
        ],
    )


def _variances(array: SensorArray) -> Drawing:
    go = graph_objects()
    n = len(array)
    sets: list[tuple[int, ...]] = [
        s for s in array.subsets() if len(s) >= n - 1
    ][:_MOST_BARS]  # fmt: skip
    labels = ["all" if len(s) == n else f"without {(set(range(n)) - set(s)).pop()}" for s in sets]
    v = np.array([array.variance(s) for s in sets])
    traces: list[Any] = [
        go.Bar(x=labels, y=v[:, j], name=name, marker={"color": colour},
               hovertemplate="%{y:.4f}")
        for j, (name, colour) in enumerate((("x", BLUE), ("y", ORANGE), ("z", GREEN)))
    ]  # fmt: skip
    text = "Variance of each fused axis, for sensors of unit variance; bars stand for one failure."
    layout = plot_layout(340, "sensors in use", "variance", barmode="group")
    return Drawing(figure_of(traces, layout), text, text)


def _curves(
    array: SensorArray, mine: Reliability, triad: Reliability, double: Reliability
) -> Drawing:
    t = np.linspace(0.0, 2.0 * mine.life.mtbf, 201)
    traces = [
        line_of(t, r.at(t), name, colour, hovertemplate="%{y:.4f}")
        for r, name, colour in (
            (mine, array.name, BLUE), (double, "triad, one axis doubled", ORANGE),
            (triad, "triad", GREY),
        )
    ]  # fmt: skip
    text = "Chance that the array still measures all three axes, against time."
    return Drawing(figure_of(traces, plot_layout(340, "time, h", "reliability")), text, text)
