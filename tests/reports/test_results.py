"""What every result can do: one contract, held for each of them."""

from __future__ import annotations

import json
from importlib import import_module

import numpy as np
import pytest

from schuler._result import Result
from schuler.errors import InputError
from schuler.reports import save_figures
from schuler.reports.results import PAGES, page_of
from tests.reports.results import MAKERS, made

pytest.importorskip("matplotlib").use("Agg")


@pytest.fixture(params=MAKERS)
def result(request):
    found = made(request.param)
    assert type(found).__name__ == request.param
    return found


def subclasses(kind):
    return {kind} | {below for each in kind.__subclasses__() for below in subclasses(each)}


def test_every_result_is_in_this_test_and_has_its_page():
    known = {type(made(name)) for name in MAKERS}
    assert {c for c in subclasses(Result) if c.__module__.startswith("schuler.")} == known | {
        Result
    }
    for kind, maker in PAGES.items():
        module, _, name = kind.rpartition(".")
        assert issubclass(getattr(import_module(module), name), Result)
        module, _, name = maker.partition(".")
        assert callable(getattr(import_module(f"schuler.reports.{module}"), name))


def test_it_is_json_a_table_and_text(result):
    pandas = pytest.importorskip("pandas")
    data = result.to_dict()
    assert json.loads(result.to_json()) == json.loads(json.dumps(data, allow_nan=False))
    columns = result.columns()
    lengths = {len(values) for values in columns.values()}
    assert len(lengths) == 1
    frame = result.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert len(frame) == lengths.pop()
    assert set(columns) == set(frame.columns) | set(frame.index.names) - {None}
    shown = result._repr_html_()
    assert shown.startswith("<div>")
    assert shown.count("<div") == shown.count("</div>")


def test_plotly_and_matplotlib_draw_the_same_figures(result):
    go = pytest.importorskip("plotly.graph_objects")
    from matplotlib import pyplot as plt

    figures = result.figures()
    assert figures
    drawings = page_of(result).drawings
    assert [d.name for d in drawings] == list(figures)
    for figure in figures.values():
        # Plotly checks each key of a description that is given as a dictionary.
        assert isinstance(figure, go.Figure)
        assert figure.data
    drawn = result.plot()
    titled = [ax.get_title(loc="left") for ax in drawn.axes if ax.get_title(loc="left")]
    assert len(figures) == 1 or titled == list(figures)
    plt.close(drawn)
    name, figure = next(iter(figures.items()))
    _, ax = plt.subplots()
    assert result.plot(name, ax=ax) is ax.figure
    assert ax.get_xlabel().replace("\\$", "$") == figure.layout.xaxis.title.text
    plt.close(ax.figure)


def test_lines_of_a_plot_are_those_of_the_page():
    from matplotlib import pyplot as plt

    fix = made("Alignment")
    drawn = fix.plot("convergence")
    line = next(line for line in drawn.axes[0].lines if line.get_label() == "heading")
    trace = next(t for t in fix.figures()["convergence"].data if t.name == "heading")
    np.testing.assert_array_equal(line.get_xdata(), trace.x)
    np.testing.assert_array_equal(line.get_ydata(), trace.y)
    assert drawn.axes[0].get_xscale() == "log"
    plt.close(drawn)


def test_a_figure_that_is_not_there_is_said_with_those_that_are():
    with pytest.raises(InputError, match=r"no figure 'heading'.*'convergence'"):
        made("Alignment").plot("heading")


def test_figures_are_files_of_their_own(tmp_path):
    fix = made("Alignment")
    files = fix.save_figures(tmp_path / "figures")
    assert [path.name for path in files] == [
        "convergence.svg", "budget.svg", "specific-force.svg", "angular-rate.svg", "residuals.svg",
        "spectrum.svg",
    ]  # fmt: skip
    assert all(path.read_bytes().startswith(b"<?xml") for path in files)
    with pytest.raises(InputError, match=r"svg, png, pdf, not as 'gif'"):
        save_figures(fix, tmp_path, "gif")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file"):
        fix.save_figures(tmp_path / "file")


def test_a_figure_s_data_are_a_table():
    import csv
    from io import StringIO

    drawing = page_of(made("Comparison")).drawings[0]
    rows = list(csv.reader(StringIO(drawing.figure.to_csv())))
    assert rows[0][:2] == ["trace", "heading less that of the least sigma, arcmin"]
    assert [row[2] for row in rows[1:]] == ["optimal", "analytic"]
    matrix = next(d for d in page_of(made("CentrifugeTest")).drawings if d.name == "correlation")
    assert len(matrix.figure.to_csv().splitlines()) == 1 + 45**2


def test_what_is_no_result_is_said():
    with pytest.raises(InputError, match="got dict: give one of AidedNavigation, Alignment"):
        page_of({})
