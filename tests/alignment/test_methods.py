"""Methods and prefilters as values: names, options, tables, texts, and a new one in two files."""

from __future__ import annotations

import importlib
import re
from importlib.metadata import EntryPoint

import numpy as np
import pytest

import schuler as sc
from schuler import _options
from schuler.alignment import METHODS, Inertial, KalmanAlignment, Method, parse_method
from schuler.alignment.methods import _presets
from schuler.config import parse_scenario
from schuler.errors import InputError
from schuler.prefilter import PREFILTERS, Chain, Gate, LowPass, parse_prefilter

SITE = sc.Site(50.0)

CHOICES = [
    *METHODS.values(),
    KalmanAlignment(12, "velocity", step=2.5, robust="igg3", adaptive=True, noise=1e-3),
    Inertial("optimal", 3, prefilter=LowPass(0.1) | Gate(0.01) | LowPass(zero_phase=True)),
    KalmanAlignment(motion_time=1.0 / 3.0, base=False, prefilter=Gate(gravity=9.81)),
]  # fmt: skip


@pytest.mark.parametrize("method", CHOICES, ids=str)
def test_options_go_to_tables_and_texts_and_back(method):
    assert parse_method(str(method)) == method
    table = method.to_table()
    assert parse_method(table) == method
    assert parse_method({"name": table["name"], **table["options"]}) == method


@pytest.mark.parametrize("name", list(METHODS))
def test_a_name_is_the_shortest_text(name):
    assert str(METHODS[name]) == name
    assert METHODS[name].to_table() == {"name": name, "options": {}}


def test_a_method_in_words_with_units():
    found = parse_method("kalman(12, velocity, step=500 ms, prefilter=lowpass(0.05 Hz) | gate)")
    assert found == KalmanAlignment(
        12, "velocity", step=0.5, prefilter=Chain((LowPass(0.05), Gate()))
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [("kalmann", "unknown method"), ("kalman(steps=3)", "no option 'steps'"),
     ("kalman(states=11)", "states must be one of"),
     ("kalman(12, states=12)", "given twice"), ("kalman(step=2 m)", "step"),
     ("kalman(base=perhaps)", "true or false"), ("kalman(states=twelve)", "must be int"),
     ("kalman(", "is no method"), ("gyrocompass(1,2,3,4)", "got more"),
     ("centred(prefilter=lowpas)", "unknown prefilter")],
)  # fmt: skip
def test_a_bad_text_is_one_sentence(text, said):
    with pytest.raises(InputError, match=said):
        parse_method(text)


@pytest.mark.parametrize("table", [{}, {"name": 3}, {"name": "kalman", "options": 3}])
def test_a_bad_table_is_one_sentence(table):
    with pytest.raises(InputError):
        parse_method(table)


def test_prefilters_form_chains_everywhere():
    chain = LowPass(0.05) | Gate(0.003)
    assert parse_prefilter("lowpass(0.05 Hz), gate(0.003)") == chain
    assert parse_prefilter(str(chain)) == chain
    assert parse_prefilter(chain.to_table()) == chain
    assert parse_prefilter([{"name": "lowpass", "cutoff": "0.05 Hz"}, "gate(0.003)"]) == chain
    assert (chain | LowPass(1.0)).filters == (LowPass(0.05), Gate(0.003), LowPass(1.0))
    with pytest.raises(InputError, match="no part of a chain"):
        parse_prefilter(["none", "gate"])


def test_a_chain_is_its_filters_in_order(rng):
    n = 2000
    dvel = np.array([0.0, 0.0, 0.098]) + 1e-4 * rng.standard_normal((n, 3))
    record = sc.ImuRecord(np.arange(1, n + 1) / 100, np.full(n, 0.01), np.zeros((n, 3)), dvel)
    low, gate = LowPass(1.0), Gate(0.01)
    fix = sc.align(record, SITE, Inertial("centred", prefilter=low | gate))
    by_hand = sc.align(gate.at(SITE.gravity)(low(record)), SITE, "centred")
    assert np.array_equal(fix.quat_nb, by_hand.quat_nb)
    assert fix.to_dict()["method"]["options"]["prefilter"][1] == {
        "name": "gate", "options": {"width": 0.01}
    }  # fmt: skip


def test_a_scenario_s_methods_are_tables_or_texts():
    plain = {"site": {"lat": 50.0}, "motion": {"kind": "static", "heading": 10.0},
             "duration": "20 s", "rate": "50 Hz"}  # fmt: skip
    table = {"method": {"name": "kalman", "states": 12, "measurement": "velocity", "step": "2 s"}}
    chained = {"method": ["centred"], "prefilter": [{"name": "lowpass", "cutoff": "1 Hz"}, "gate"]}
    first = parse_scenario({**plain, "align": table})
    second = parse_scenario({**plain, "align": chained})
    assert parse_method(first.methods[0]) == KalmanAlignment(12, "velocity", step=2.0)
    assert parse_method(second.methods[0]) == Inertial("centred", prefilter=LowPass(1.0) | Gate())
    with pytest.raises(InputError, match="no option 'stats'"):
        parse_scenario({**plain, "align": {"method": {"name": "kalman", "stats": 12}}})


@pytest.fixture
def own_methods(monkeypatch):
    """Give the registry back as it was."""
    monkeypatch.setattr(METHODS, "_own", _presets())
    monkeypatch.setattr(METHODS, "_entries", {})
    return METHODS


def blocks(root):
    text = (root / "CONTRIBUTING.md").read_text(encoding="utf-8")
    return re.findall(r"<!-- test: (?:src|a line)[^\n]* -->\n```python\n(.*?)```", text, re.S)


def test_the_aligner_of_contributing_runs(root, own_methods, rng, tmp_path, monkeypatch):
    module, line = blocks(root)[:2]
    (tmp_path / "mean_force.py").write_text(module, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    written = importlib.import_module("mean_force")
    name, kind = re.fullmatch(r'"([\w-]+)": (\w+)\(\),\n', line).groups()
    own_methods.register(name, getattr(written, kind)())
    n = 1000
    turn = SITE.earth_rate * 0.01
    dvel = np.array([0.0, 0.0, SITE.gravity * 0.01]) + 1e-6 * rng.standard_normal((n, 3))
    record = sc.ImuRecord(
        np.arange(1, n + 1) / 100, np.full(n, 0.01), np.broadcast_to(turn, (n, 3)).copy(), dvel
    )
    fix = sc.align(record, SITE, "mean-force(1 arcmin)")
    assert min(fix.heading_deg, 360.0 - fix.heading_deg) < 0.01
    assert fix.sigma_arcmin[1] == pytest.approx(np.hypot(1.0, SITE.deflection_sigma / 60.0))
    assert fix.to_dict()["method"]["name"] == "mean-force"
    assert "mean-force" in list(METHODS)
    with pytest.raises(InputError, match="another method"):
        own_methods.register("mean-force", Inertial())


def test_a_plugin_is_found_by_its_entry_point(own_methods, monkeypatch):
    entry = EntryPoint("plugged", "schuler.alignment.methods:Analytic", "schuler.methods")
    broken = EntryPoint("broken", "schuler.alignment.methods:nothing", "schuler.methods")
    monkeypatch.setattr(METHODS, "_entries", {"plugged": entry, "broken": broken})
    assert "plugged" in list(METHODS)
    assert isinstance(METHODS["plugged"], Method)
    with pytest.raises(InputError, match="cannot be loaded"):
        parse_method("broken")


def test_a_plugin_may_not_take_a_name(monkeypatch):
    entry = EntryPoint("kalman", "x:y", "schuler.methods")
    monkeypatch.setattr(_options, "entry_points", lambda group: [entry])
    registry = _options.Registry("method", Method, "schuler.methods", _presets)
    with pytest.raises(InputError, match="a name that is taken"):
        list(registry)


def test_every_prefilter_goes_to_text_and_back():
    for name, each in PREFILTERS.items():
        assert str(each) == name
        assert PREFILTERS.parse(name) == each


def test_the_prefilter_of_contributing_runs(root, rng, tmp_path, monkeypatch):
    module, line = blocks(root)[2:]
    (tmp_path / "median_of_three.py").write_text(module, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    written = importlib.import_module("median_of_three")
    name, kind = re.fullmatch(r'"([\w-]+)": (\w+)\(\),\n', line).groups()
    monkeypatch.setattr(PREFILTERS, "_own", {**PREFILTERS._own})
    monkeypatch.setattr(PREFILTERS, "_entries", {})
    PREFILTERS.register(name, getattr(written, kind)())
    n = 1000
    dvel = np.array([0.0, 0.0, 0.098]) + 1e-6 * rng.standard_normal((n, 3))
    spoiled = dvel.copy()
    spoiled[500, 0] += 0.01
    record = sc.ImuRecord(np.arange(1, n + 1) / 100, np.full(n, 0.01), np.zeros((n, 3)), spoiled)
    chain = parse_prefilter("median(accel), lowpass(1 Hz)")
    assert str(chain).startswith("median")
    out = chain.filters[0](record)
    assert np.abs(out.dvel - dvel).max() < 1e-5
    assert np.array_equal(out.dtheta, record.dtheta)
