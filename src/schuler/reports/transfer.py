"""What the page of a transfer alignment has of its own: the mounting, and the slave alone."""

from __future__ import annotations

import numpy as np

from schuler.alignment.transfer import FreeRun, TransferAlignment
from schuler.constants import ARCMIN
from schuler.reports.figures import BLUE, GREY, ORANGE, POINTS, figure_of, line_of, plot_layout
from schuler.reports.page import Drawing, Section, definition_table
from schuler.units import percent

__all__ = ["transfer_sections"]

_COLOURS = (BLUE, ORANGE, GREY)


def transfer_sections(fix: TransferAlignment) -> list[Section]:
    """Return the sections of what was seen, and of the slave alone where it was let go."""
    rows = [
        (name, percent(left) + (" (not observable)" if name in fix.not_observable else ""))
        for name, left in fix.remaining.items()
    ]
    table = definition_table(rows, "What is left of each state's 1-sigma")
    out = [Section("What the span showed", html=table, drawings=_mounting(fix))]
    if fix.free is not None:
        out.append(Section("Alone", drawings=_alone(fix.free)))
    return out


def _mounting(fix: TransferAlignment) -> list[Drawing]:
    epochs = fix.epochs
    if "transfer.mounting" not in epochs.layout:
        return []
    k = np.unique(np.linspace(0, len(epochs) - 1, min(len(epochs), POINTS)).astype(np.int64))
    sigma = epochs.sigma("transfer.mounting")[k] / ARCMIN
    names = zip(("about right", "about forward", "about up"), _COLOURS, strict=True)
    traces = [
        line_of(epochs.time[k] - fix.start, sigma[:, axis], name, colour)
        for axis, (name, colour) in enumerate(names)
    ]
    layout = plot_layout(300, "time since the start of the span, s", "sigma, arcmin")
    layout["yaxis"]["type"] = "log"
    text = "1 sigma of the mounting after each row of the master, about the slave's axes."
    return [Drawing("mounting sigma", figure_of(traces, layout), text)]


def _alone(free: FreeRun) -> list[Drawing]:
    out = []
    for values, unit, what in (
        (free.attitude / ARCMIN, "arcmin", "attitude"), (free.velocity, "m/s", "velocity"),
        (free.position, "m", "position"),
    ):  # fmt: skip
        names = zip(("east", "north", "up"), _COLOURS, strict=True)
        traces = [
            line_of(free.time - free.begin, values[:, axis], name, colour)
            for axis, (name, colour) in enumerate(names)
        ]
        layout = plot_layout(240, "time since the slave was alone, s", f"{what}, {unit}")
        text = f"The slave's {what} less its master's, by the mounting and lever arm found."
        out.append(Drawing(f"{what} alone", figure_of(traces, layout), text))
    return out
