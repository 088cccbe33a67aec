"""A figure's description: what is empty, and how logarithmic axes are marked."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.reports.figure import Figure, scatter


def of(values: list[float]) -> Figure:
    axis = {"title": {"text": "y"}, "type": "log"}
    trace = scatter(x=[1.0, 2.0], y=np.array(values), mode="lines", name="a")
    return Figure([trace], {"height": 300, "xaxis": {"title": {"text": "x"}}, "yaxis": axis})


def test_a_figure_without_a_number_is_empty() -> None:
    assert of([np.nan, np.nan]).empty
    assert not of([np.nan, 1.0]).empty


@pytest.mark.parametrize(
    ("values", "kind", "tick"),
    [([4.1e-3, 4.9e-3], "linear", None), ([1.0, 80.0], "log", "D2"), ([1.0, 1e5], "log", None)],
)
def test_a_logarithmic_axis_has_marks(values: list[float], kind: str, tick: str | None) -> None:
    pytest.importorskip("plotly")
    figure = of(values).to_plotly()
    assert figure.layout.yaxis.type == kind
    assert figure.layout.yaxis.dtick == tick
