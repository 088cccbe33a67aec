"""Where a result is from stands in its JSON, and ``--again`` makes it anew."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.conftest import Ran
from tests.test_docs import schema

Run = Callable[..., Ran]


@pytest.fixture
def folder(csv: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of a record, and work there."""
    monkeypatch.chdir(csv.parent)
    return csv.parent


@pytest.fixture
def made(run: Run, folder: Path) -> Path:
    """Return the result of an alignment whose record needs its units and axes said."""
    done = run("align", "truck.csv", "--lat", "40", "--gyro", "rad/s", "--accel", "m/s^2",
               "--windows", "20s", "--at", "start", "--spec", "navigation-fog",
               "--json", "r.json")  # fmt: skip
    assert done.code == 0, done.err
    return folder / "r.json"


def test_it_says_command_options_mapping_and_files(made: Path) -> None:
    data = json.loads(made.read_text())
    schema("alignment").validate(data)
    found = data["provenance"]
    assert found["command"] == ["align"]
    assert found["options"]["windows"] == 20.0
    assert found["options"]["spec"] == "navigation-fog"
    assert "json_to" not in found["options"]
    assert found["mapping"] == {"gyro": "rad/s", "accel": "m/s^2"}
    record = (made.parent / "truck.csv").read_bytes()
    assert found["inputs"] == [
        {"file": "truck.csv", "bytes": len(record), "sha256": hashlib.sha256(record).hexdigest()}
    ]


def test_again_gives_the_same_bytes_and_options_win(run: Run, made: Path) -> None:
    done = run("align", "--again", "r.json", "--json", "again.json")
    assert done.code == 0, done.err
    assert (made.parent / "again.json").read_bytes() == made.read_bytes()
    run("align", "--again", "r.json", "--windows", "30s", "--json", "other.json")
    other = json.loads((made.parent / "other.json").read_text())
    assert len(other["windows"]) == 1
    assert other["provenance"]["options"]["at"] == "start"


def test_again_finds_the_record_beside_the_result(
    run: Run, made: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    assert run("align", "--again", made).code == 0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda p: (p / "truck.csv").write_text("t\n"), "truck.csv: has changed since"),
        (lambda p: (p / "truck.csv").unlink(), "truck.csv: is not there any more"),
        (lambda p: (p / "r.json").write_text("{}"), "r.json: says not how it was made"),
        (lambda p: (p / "r.json").write_text("no"), "r.json: is no JSON"),
        (lambda p: (p / "r.json").write_text("[" * 200_000), "r.json: is no JSON"),
        (
            lambda p: (p / "r.json").write_text(
                '{"provenance": {"command": ["align"], "options": [1], "inputs": []}}'
            ),
            "r.json: says not how it was made",
        ),
        (
            lambda p: (p / "r.json").write_text(
                '{"provenance": {"command": ["align"], "options": {}, "inputs": [{"file": 3}]}}'
            ),
            "r.json: says not how it was made",
        ),
        (lambda p: (p / "r.json").unlink(), "r.json: cannot be read"),
    ],
)
def test_what_cannot_be_repeated_is_said(
    run: Run, made: Path, change: Callable[[Path], object], said: str
) -> None:
    change(made.parent)
    done = run("align", "--again", "r.json")
    assert (done.code, done.out) == (2, "")
    assert said in done.err
    assert done.err.count("\n") == 1


def test_a_result_of_another_command_is_refused(run: Run, made: Path) -> None:
    done = run("allan", "--again", "r.json")
    assert done.code == 2
    assert "was made by schuler align, and not by schuler allan" in done.err


def test_the_result_that_is_repeated_is_not_overwritten(run: Run, made: Path) -> None:
    before = made.read_bytes()
    done = run("align", "--again", "r.json", "--json", "r.json")
    assert done.code == 2
    assert "is the file of --again" in done.err
    assert made.read_bytes() == before
