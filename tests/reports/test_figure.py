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
    ("values", "kind", "ticks", "tick"),
    [
        ([4.1e-3, 4.9e-3], "linear", None, None),
        ([0.03, 4.0], "log", ("0.02", "0.05", "0.1", "0.2", "0.5", "1", "2", "5"), None),
        ([1.0, 1e5], "log", None, 1.0), ([1e-9, 1e5], "log", None, 2.0),
    ],
)  # fmt: skip
def test_a_logarithmic_axis_has_marks(
    values: list[float], kind: str, ticks: tuple[str, ...] | None, tick: float | None
) -> None:
    pytest.importorskip("plotly")
    axis = of(values).to_plotly().layout.yaxis
    assert axis.type == kind
    assert axis.dtick == tick
    assert axis.ticktext == ticks
    if ticks is not None:
        np.testing.assert_allclose(axis.tickvals, [float(text) for text in ticks], rtol=1e-12)


def test_marks_far_from_one_are_powers_of_ten() -> None:
    pytest.importorskip("plotly")
    axis = of([1e-7, 4e-7]).to_plotly().layout.yaxis
    assert axis.ticktext[:2] == ("5·10<sup>-8</sup>", "10<sup>-7</sup>")
