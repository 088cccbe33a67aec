"""Errors over the hours: their ends are those of the comparison, their data are whole."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from schuler.errors import InputError
from schuler.modulation import RotationCase, end_errors, rotation_history, turned
from schuler.motion import Limits, named_scheme
from tests.conftest import ROOT
from tests.test_docs import schema

CASE = ROOT / "examples" / "rotation" / "four_gyro.toml"


@pytest.fixture(scope="module")
def case():
    return RotationCase.from_toml(CASE)


@pytest.fixture(scope="module")
def history(case):
    return rotation_history(case)


def test_its_end_is_the_comparison_s(case, history):
    for name, scheme in (("single_axis", case.single), ("two_axis", case.double)):
        end = end_errors(turned(scheme, case.duration), case.errors, [case.site.lat],
                         [case.heading])[0, 0]  # fmt: skip
        table = history.series[name]
        np.testing.assert_allclose([table["east_m"][-1], table["north_m"][-1]], end, atol=1e-3)
    assert history.reduction("single_axis") == pytest.approx(31.9, abs=0.1)
    assert history.reduction("two_axis") > 95.0


def test_velocity_is_the_slope_of_position_and_tilt_swings_in_schuler_s_time(history):
    t, fixed = history.time, history.series["fixed"]
    slope = np.gradient(fixed["east_m"], t)
    assert np.abs(slope - fixed["v_east_m_s"])[1:-1].max() < 2e-3
    swings = np.flatnonzero(np.diff(np.sign(fixed["v_east_m_s"] - fixed["v_east_m_s"].mean())))
    # 84.4 minutes to a swing, two zeros each, in eight hours; Foucault's beat adds or takes one.
    assert 9 <= len(swings) <= 13


def test_json_and_tables_hold_all_curves(history, tmp_path):
    data = json.loads(json.dumps(history.to_dict(), allow_nan=False))
    schema("rotation-history").validate(data)
    assert data["time_s"][-1] == history.time[-1] == 28800.0
    assert len(data["time_s"]) < 1000
    table = history.to_pandas()
    for suffix in (".csv", ".parquet"):
        history.write_table(tmp_path / f"h{suffix}")
    rows = np.loadtxt(tmp_path / "h.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(rows[:, 1:], table.to_numpy(), rtol=1e-6, atol=1e-9)
    with pytest.raises(InputError, match="csv or"):
        history.write_table(tmp_path / "h.txt")


@pytest.mark.parametrize(("clockwise", "percent"), [(True, 36.3), (False, 27.3)])
def test_the_start_that_the_document_describes(case, clockwise, percent):
    scheme = named_scheme("reciprocating-from-end", limits=Limits(2.0), clockwise=clockwise)
    assert rotation_history(replace(case, single=scheme)).reduction("single_axis") == pytest.approx(
        percent, abs=0.1
    )


def test_first_turn_and_start_are_data(case, tmp_path):
    text = CASE.read_text(encoding="utf-8").replace(
        'rate = "2 deg/s"', 'rate = "2 deg/s"\nstart = "end"\nfirst_turn = "clockwise"', 1
    )
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    single = RotationCase.from_toml(path).single
    assert [step.angle for step in single.steps] == [-360.0, 360.0]
    for old, new, said in (
        ('"clockwise"', '"left"', "first_turn"), ('"end"', '"now"', "start"),
        ('scheme = "reciprocating"', 'scheme = "four-position"', "start"),
    ):  # fmt: skip
        path.write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(InputError, match=said):
            RotationCase.from_toml(path)


def test_without_errors_there_is_nothing_to_compare(case):
    with pytest.raises(InputError, match="nothing to compare"):
        rotation_history(
            replace(case, gyro_bias=np.zeros(4), gyro_scale=np.zeros(4), accel_bias=np.zeros(3))
        )


def test_page_and_pictures_are_drawn(history, tmp_path):
    pytest.importorskip("plotly")
    from schuler.reports import report
    from schuler.reports.results import write_plot

    report(history, tmp_path / "h.html")
    page = (tmp_path / "h.html").read_text(encoding="utf-8")
    assert "less by one axis" in page
    with pytest.raises(InputError, match="png or"):
        write_plot(history, tmp_path / "h.gif")
    pytest.importorskip("matplotlib")
    for suffix, mark in ((".png", b"\x89PNG"), (".svg", b"<?xml")):
        write_plot(history, tmp_path / f"h{suffix}")
        assert (tmp_path / f"h{suffix}").read_bytes().startswith(mark)
