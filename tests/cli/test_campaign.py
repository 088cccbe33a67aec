"""The command ``schuler campaign``: table, JSON, report, and what it refuses."""

from __future__ import annotations

import json
import re

import pytest

from tests.test_docs import schema

SCENE = """duration = "20 s"
rate = "20 Hz"
seed = 3
instrument = "navigation-fog"
[site]
lat = 40.0
[motion]
kind = "static"
heading = 30
"""


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "base.toml"
    path.write_text(SCENE)
    return path


def test_table_json_and_report(run, scene, tmp_path):
    done = run("campaign", scene, "--runs", 6, "--sweep", "duration=20s,30s", "--method", "centred",
               "--method", "analytic", "--workers", 0, "--json", "s.json", "--report",
               "r.html")  # fmt: skip
    assert (done.code, done.err) == (0, "wrote s.json\nwrote r.html\n")
    assert done.out.count("duration = 30s") == 2
    assert (tmp_path / "base.campaign" / "results.parquet").exists()
    data = json.loads((tmp_path / "s.json").read_text())
    schema("campaign").validate(data)
    assert [p["sweep"] for p in data["points"]] == [{"duration": "20s"}] * 2 + [
        {"duration": "30s"}
    ] * 2
    assert all(p["runs"] == 6 and p["rms_arcmin"] > 0 for p in data["points"])
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    # One figure across the sweep, and two for each place and method.
    assert len(re.findall(r'<div class="plot"', page)) == 1 + 2 * 4
    assert "duration = 30s · analytic" in page
    # A second start finds all done, and says the same.
    again = run("campaign", scene, "--runs", 6, "--sweep", "duration=20s,30s", "--method",
                "centred", "--method", "analytic", "--workers", 0)  # fmt: skip
    assert again.out == done.out


def test_json_to_standard_output_stands_alone(run, scene):
    done = run("campaign", scene, "--runs", 1, "--workers", 0, "--json", "-", "--seed", 5)
    data = json.loads(done.out)
    schema("campaign").validate(data)
    assert data["seed"] == 5
    assert data["points"][0]["std_arcmin"] is None


def test_without_an_instrument_there_is_no_limit(run, scene):
    scene.write_text(SCENE.replace('instrument = "navigation-fog"\n', ""))
    done = run("campaign", scene, "--runs", 2, "--workers", 0, "--report", "r.html", "--json",
               "s.json")  # fmt: skip
    schema("campaign").validate(json.loads((scene.parent / "s.json").read_text()))
    assert done.code == 0, done.err
    assert re.search(r"centred .* -  +-", done.out)


def test_text_of_a_scenario_is_escaped_in_the_report(run, scene, tmp_path):
    scene.write_text('name = "</script><b>x"\n' + SCENE)
    assert run("campaign", scene, "--runs", 2, "--workers", 0, "--out", "o", "--report",
               "r.html").code == 0  # fmt: skip
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "<b>x" not in page
    assert "&lt;b&gt;x" in page


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--runs", "0"], "from 1 to 10000000, got 0"),
        (["--sweep", "duration"], "expected key=value"),
        (["--sweep", "duration=20s,,30s"], "value between the commas is missing"),
        (["--sweep", "duration=20s,30"], "base with duration = 30: duration: expected time"),
        (["--sweep", "motion.yaw=1,2"], "base with motion.yaw = 1: motion.yaw: unknown key"),
        (["--method", "north"], "unknown method 'north'"),
        (["--workers", "-2"], "from 0 to 1000, got -2"),
        (["--workers", "2", "--scheduler", "tcp://127.0.0.1:9"], "give one of them"),
        (["--out", "base.toml"], "base.toml: cannot be made"),
        (["--report", "no/x.html"], "no/x.html"),
        (["--set", "site.lat=89.9"], "within 1 deg of a pole"),
    ],
)
def test_what_is_wrong_is_one_sentence(run, scene, arguments, words):
    more = [] if "--workers" in arguments else ["--workers", "0"]
    done = run("campaign", scene, "--runs", "1", *more, *arguments)
    assert done.code == 2
    assert words in done.err
    assert done.err.count("\n") == 1
    assert "Traceback" not in done.err


def test_a_folder_with_another_campaign_is_refused(run, scene):
    assert run("campaign", scene, "--runs", 1, "--workers", 0).code == 0
    done = run("campaign", scene, "--runs", 2, "--workers", 0)
    assert done.code == 2
    assert "base.campaign: has another campaign in it (runs: 1 there, 2 here)" in done.err


def test_help_imports_nothing_heavy(run_python):
    code = (
        "import sys; from schuler.cli import cli\n"
        "try: cli.main(['--help'], standalone_mode=False)\n"
        "except SystemExit: pass\n"
        "print(sorted({'numpy', 'pydantic', 'dask', 'pyarrow'} & set(sys.modules)))"
    )
    assert run_python(code).splitlines()[-1] == "[]"
