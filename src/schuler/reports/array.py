"""The page of ``schuler array``: variance with every set of sensors, and reliability."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np

from schuler.reports.figure import bar, scatter
from schuler.reports.figures import BLUE, GREEN, GREY, ORANGE, figure_of, line_of, plot_layout
from schuler.reports.page import Drawing, Page, Section, definition_table
from schuler.sensors import ArrayFigures, FaultScan, Reliability, SensorArray, isolable, named_array

__all__ = ["array_page", "faults_page"]

_MOST_BARS = 12
_MOST_MODES = 24


def array_page(found: ArrayFigures) -> Page:
    """Return the page of an array and its reliability."""
    array, reliability = found.array, found.reliability
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
        "the parity isolates the faulty sensor" if n > 3 and isolable(array)
        else "the parity sees that a sensor is wrong, not which" if n > 3
        else "there is no redundancy: a wrong sensor is not seen"
    )  # fmt: skip
    rows = [
        *(
            (f"direction {k}", ", ".join(f"{v:.6f}" for v in row))
            for k, row in enumerate(array.h)
        ),
        *(
            (f"|det|, working {key}", f"{value:.4f}")
            for key, value in list(array.subset_determinant().items())[:_MOST_MODES]
        ),
        ("optimal (H^T H = n/3 I)", "yes" if figures["optimal"] else "no"),
        ("condition of H^T H", f"{figures['condition']:.4g}"),
        ("faults", told),
        ("coverage", f"{reliability.coverage:g}"),
        ("Weibull shape", f"{life.shape:g}"),
        ("MTBF against an orthogonal triad", f"{ratio:.4g}"),
        ("MTBF against a triad with one axis doubled", f"{reliability.mtbf / double.mtbf:.4g}"),
    ]  # fmt: skip
    return Page(
        f"Array: {array.name}",
        head,
        [
            Section("Variance of each axis", drawings=[_variances(array)]),
            Section("Reliability", drawings=[_curves(array, reliability, triad, double)]),
            Section("Figures", html=definition_table(rows, "Directions in body axes, and figures")),
        ],
    )


def faults_page(found: FaultScan) -> Page:
    """Return the page of a parity test over a record.

    Parameters
    ----------
    found : FaultScan
    """
    data = found.to_dict()
    alarms = [e for e in found.events if e.action != "taken back"]
    word = "fault" if len(alarms) == 1 else "faults"
    head = (
        f"<h1>Faults · {escape(data['array'])}</h1>"
        f'<p class="value">{len(alarms)} <span class="pm">{word}</span></p>'
        f'<p class="sub">In {data["windows"]} windows of {data["window_s"]:g} s; false alarms '
        f"{data['false_alarm_rate']:g} a window, {data['false_alarms_per_hour']:.3g} an hour. In "
        f"use at the end: {', '.join(map(str, found.working))} of {len(found.test.array)}.</p>"
    )
    layout = plot_layout(380, "time, s", "parity, chi-square", hovermode="closest")
    layout["yaxis"]["type"] = "log"
    threshold = found.test.threshold
    traces: list[Any] = [
        line_of(found.time, np.maximum(found.statistic, 1e-3), "all gyros", BLUE,
                hovertemplate="%{x:.1f} s: %{y:.3g}"),
        line_of(found.time[[0, -1]], np.full(2, threshold), "threshold", GREY,
                hovertemplate="%{y:.3g}"),
    ]  # fmt: skip
    if found.events:
        traces.append(
            scatter(
                x=[e.time for e in found.events], y=[threshold] * len(found.events),
                mode="markers", name="events", marker={"color": ORANGE, "size": 11},
                text=[f"{e.action}: gyro {e.gyro or 'unknown'}" for e in found.events],
                hovertemplate="%{x:.2f} s: %{text}<extra></extra>",
            )
        )  # fmt: skip
    text = "Squared parity of all gyros in each window, against what it exceeds by chance."
    events = definition_table(
        [
            (
                f"{e.time:.3f} s",
                f"{'one gyro' if e.gyro is None else f'gyro {e.gyro}'} {e.action}: {e.reason}"
                + ("" if e.onset is None else f"; since {e.onset:g} s, delay {e.delay:.3g} s"),
            )
            for e in found.events
        ],
        "Events",
    )
    rates = definition_table(
        [
            (
                f"gyro {each['gyro']}",
                "not in the parity" if each["smallest_fault_deg_h"] is None
                else f"a step of {each['smallest_fault_deg_h']:.3g} deg/h is missed in 1 of 100 "
                f"windows, found after {each['mean_delay_s']:.3g} s on the mean",
            )
            for each in data["gyros"]
        ],
        "What the test finds",
    )  # fmt: skip
    return Page(
        f"Faults: {data['array']}",
        head,
        [
            Section("The test", html=events,
                    drawings=[Drawing("parity", figure_of(traces, layout), text)]),
            Section("Rates", html=rates),
        ],
    )  # fmt: skip


def _variances(array: SensorArray) -> Drawing:
    n = len(array)
    sets: list[tuple[int, ...]] = [
        s for s in array.subsets() if len(s) >= n - 1
    ][:_MOST_BARS]  # fmt: skip
    labels = ["none" if len(s) == n else str((set(range(n)) - set(s)).pop()) for s in sets]
    v = np.array([array.variance(s) for s in sets])
    traces: list[Any] = [
        bar(x=labels, y=v[:, j], name=name, marker={"color": colour},
               hovertemplate="%{y:.4f}")
        for j, (name, colour) in enumerate((("x", BLUE), ("y", ORANGE), ("z", GREEN)))
    ]  # fmt: skip
    text = "Variance of each fused axis, for sensors of unit variance; bars stand for one failure."
    layout = plot_layout(340, "failed sensor", "variance", barmode="group")
    # The numbers of sensors are names, not places on an axis.
    layout["xaxis"]["type"] = "category"
    return Drawing("variance", figure_of(traces, layout), text)


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
    return Drawing(
        "reliability", figure_of(traces, plot_layout(340, "time, h", "reliability")), text, text
    )
