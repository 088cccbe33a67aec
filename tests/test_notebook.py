"""What a notebook shows of records and results: well-formed, escaped, complete."""

from __future__ import annotations

from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

import schuler as sc
from schuler._notebook import Shown, bar, card
from schuler.alignment import align_windows, align_without_latitude
from schuler.alignment.compare import compare
from schuler.alignment.table_north import TableNorth
from schuler.centrifuge.plan import Plan
from schuler.motion import Static
from schuler.navigation import Evaluation, Start, navigate
from schuler.published.result import Experiment
from schuler.record import Summariser
from schuler.sensors import GRADES
from schuler.simulation import simulate

SITE = sc.Site(48.0)


class Checker(HTMLParser):
    """Count what is open; note what is said."""

    def __init__(self):
        super().__init__()
        self.open, self.text = [], ""

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def shown(thing) -> str:
    """Return the text of what a notebook shows, once its elements are found to be closed."""
    checker = Checker()
    checker.feed(thing._repr_html_())
    checker.close()
    assert checker.open == []
    return checker.text


@pytest.fixture(scope="module")
def record():
    rng = np.random.default_rng(4)
    made = simulate(Static(20.0), SITE, 120.0, 20.0, GRADES["navigation-fog"], rng)
    return replace(made.record, name="a<b>&truck")


def test_a_record(record):
    text = shown(record)
    assert "a<b>&truck" in text
    assert "2400, 0 to 120 s, 20 Hz" in text
    assert "9.80" in text
    assert shown(record.rows(0, 0)) == "a<b>&truck: no samples"
    four = replace(record, dtheta=np.zeros((len(record), 4)))
    assert "4 axes, not fused" in shown(four)


@pytest.mark.compiled
def test_an_alignment_with_its_budget(record):
    fix = sc.align(record, SITE, "kalman", "navigation-fog")
    text = shown(fix)
    assert fix.headline() in text
    for name in fix.budget:
        assert name.replace("_", " ") in text
    assert "gyro bias" in text
    warned = replace(fix, warnings=("units <look> wrong",))
    assert "units <look> wrong" in shown(warned)


def test_results_that_say_themselves(record):
    spec = "navigation-fog"
    results = [
        align_windows(record, SITE, 40.0, None, spec),
        align_without_latitude(record, spec),
        compare(record, SITE, spec, [("centred", "none"), ("analytic", "none")]),
        navigate(record, Start(SITE, [1.0, 0.0, 0.0, 0.0])),
    ]
    for result in results:
        for line in str(result).splitlines():
            assert line.strip() in shown(result)


def test_results_that_have_but_plain_values(record):
    summariser = Summariser()
    summariser.push(record)
    assert "2400" in shown(summariser.summary())
    for kind in (Plan, Evaluation, Experiment, TableNorth):
        assert issubclass(kind, Shown)


def test_pieces():
    assert 'aria-label="50 %"' in bar(0.5)
    assert bar(7.0) == bar(1.0)
    assert "<script>" not in card("<script>", [("<script>", "1")], ["<script>"])
