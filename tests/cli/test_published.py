"""``schuler published`` from the command line: list, run, JSON, page, and what it refuses."""

from __future__ import annotations

import json

import pytest

from schuler.published import EXPERIMENTS
from tests.test_docs import schema


def test_list(run):
    done = run("published", "list")
    assert done.code == 0
    for name in EXPERIMENTS:
        assert any(line.startswith(name) for line in done.out.splitlines())


def test_run_writes_table_json_and_page(run, tmp_path):
    page, data = tmp_path / "p.html", tmp_path / "p.json"
    done = run("published", "run", "du2016", "--report", page, "--json", data)
    assert (done.code, done.err) == (0, f"wrote {data}\nwrote {page}\n")
    assert "printed   document       best      limit" in done.out
    found = json.loads(data.read_text(encoding="utf-8"))
    schema("published").validate(found)
    text = page.read_text(encoding="utf-8")
    assert "du2016" in text
    # A drawing of the headings, and for each unit one of positive figures, one of others.
    keys = ("printed", "document_method", "best", "limit")
    kinds = set()
    for row in found["experiments"]["du2016"]["rows"]:
        values = [row[key] for key in keys if row[key] is not None]
        if values:
            kinds.add((row["unit"], min(values) > 0.0))
    assert len(kinds) == 6
    assert text.count("<figure ") == 1 + len(kinds)
    assert "psi, counter-clockwise from north, deg" in text


def test_conditions_are_listed_and_set(run):
    listed = run("published", "conditions", "du2016")
    assert listed.code == 0
    assert "site.lat" in listed.out
    done = run("published", "run", "du2016", "--set", "site.lat=10", "--set",
               "headings.psi=[90.0]", "--set", "headings.all_psi_step=180.0")  # fmt: skip
    assert done.code == 0
    assert "latitude 10, psi 90" in done.out
    assert "Changed conditions: site.lat = 10, headings.psi = [90.0]" in done.out


def test_json_alone_on_standard_output(run):
    done = run("published", "run", "du2016", "--json", "-")
    found = json.loads(done.out)
    schema("published").validate(found)
    assert list(found["experiments"]) == ["du2016"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("gou2015",), "'gou2015' (did you mean 'guo2015'?) is no published experiment"),
        (("du2016", "--runs", "1"), "two runs"),
        (("du2016", "--workers", "0"), "from 1 to 1000, got 0"),
        (("du2016", "--json", "nowhere/a.json"), "nowhere"),
        (("du2016", "--set", "site.latitude=3"), "no condition 'site.latitude'"),
        (("du2016", "--set", "site.lat"), "expected key=value"),
        (("all", "--set", "filter.stop=0.3"), "guo2015 has no condition 'filter.stop'"),
    ],
)
def test_refused(run, arguments, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run("published", "run", *arguments)
    assert done.code == 2
    assert says in done.err
    assert done.out == ""
    assert done.err.count("\n") == 1
