"""One command on many records: a table, JSON lines that are gone on with, a report."""

from __future__ import annotations

import json
from collections.abc import Callable
from concurrent.futures import Executor, Future
from pathlib import Path

import pytest

from schuler.cli import many
from tests.cli.conftest import Ran
from tests.test_docs import schema

Run = Callable[..., Ran]

PLACE = ("--lat", "40", "--spec", "navigation-fog", "--jobs", "1")


@pytest.fixture
def folder(csv: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with three records, one of them empty, and files that are none."""
    there = csv.parent / "day"
    there.mkdir()
    text = csv.read_text()
    (there / "b.csv").write_text(text)
    (there / "a.csv").write_text(text)
    (there / "c.csv").write_text("t,gx,gy,gz,ax,ay,az\n")
    (there / "notes.md").write_text("no record")
    (there / "a.csv.toml").write_text('gyro = "rad/s"\naccel = "m/s^2"\n')
    monkeypatch.chdir(csv.parent)
    return there


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the records that were computed, as they are."""
    done: list[str] = []
    one = many.run_one

    def count(command: str, path: str, options: dict[str, object]) -> many.Line:
        done.append(path)
        return one(command, path, options)

    monkeypatch.setattr(many, "run_one", count)
    return done


def lines(path: Path) -> list[dict[str, object]]:
    return [json.loads(row) for row in path.read_text().splitlines()]


def test_a_folder_is_a_table_and_one_bad_file_does_not_stop_the_rest(run: Run, folder: Path):
    done = run("align", "day", *PLACE, "--json", "o.jsonl", "--report", "o.html")
    assert done.code == many.SOME_FAILED
    rows = done.out.splitlines()
    assert [row.split()[0] for row in rows[1:4]] == ["day/a.csv", "day/b.csv", "day/c.csv"]
    assert rows[3].endswith("has a header but no data rows")
    assert rows[-1] == "2 of 3 records have a result"
    found = lines(folder.parent / "o.jsonl")
    assert [line["file"] for line in found] == ["day/a.csv", "day/b.csv", "day/c.csv"]
    for line in found[:2]:
        schema("alignment").validate(line["document"])
        assert line["error"] is None
    assert found[2]["document"] is None
    assert "no data rows" in str(found[2]["error"])
    page = (folder.parent / "o.html").read_text(encoding="utf-8")
    assert '2 <span class="pm">of 3 records have a result</span>' in page
    assert '<p class="sub">Heading ' in page
    assert page.count('class="plot"') == 1


def test_the_truth_beside_a_record_is_no_record(tmp_path: Path):
    for name in ("a.csv", "a.truth.parquet", "b.truth.parquet"):
        (tmp_path / name).write_text("")
    assert many.records_of((str(tmp_path),)) == [
        str(tmp_path / "a.csv"), str(tmp_path / "b.truth.parquet"),
    ]  # fmt: skip


def test_each_document_is_that_of_the_record_alone(run: Run, folder: Path):
    run("align", "day/a.csv", "day/b.csv", *PLACE, "--windows", "20s", "--json", "o.jsonl")
    alone = json.loads(
        run("align", "day/b.csv", "--lat", "40", "--spec", "navigation-fog", "--windows", "20s",
            "--json", "-").out
    )  # fmt: skip
    assert lines(folder.parent / "o.jsonl")[1]["document"] == alone


def test_what_is_done_is_not_done_again(run: Run, folder: Path, counted: list[str]):
    arguments = ("align", "day", *PLACE, "--json", "o.jsonl")
    run(*arguments)
    assert counted == ["day/a.csv", "day/b.csv", "day/c.csv"]
    first = (folder.parent / "o.jsonl").read_bytes()
    counted.clear()
    run(*arguments)
    assert counted == ["day/c.csv"]  # errors are tried again
    assert (folder.parent / "o.jsonl").read_bytes() == first
    # Lines that are nobody's, and ones nested too deep, are passed over.
    odd = b'[]\n{"document": {"provenance": {"options": 3}}}\n' + b"[" * 200_000 + b"\n"
    (folder.parent / "o.jsonl").write_bytes(odd + first)
    counted.clear()
    run(*arguments)
    assert counted == ["day/c.csv"]
    assert (folder.parent / "o.jsonl").read_bytes() == first
    # A run that was stopped while it wrote a line.
    (folder.parent / "o.jsonl").write_bytes(first[: first.index(b"\n") + 100])
    counted.clear()
    run(*arguments)
    assert counted == ["day/b.csv", "day/c.csv"]
    assert (folder.parent / "o.jsonl").read_bytes() == first


def test_a_record_or_an_option_that_has_changed_is_computed_anew(
    run: Run, folder: Path, counted: list[str]
):
    run("align", "day", *PLACE, "--json", "o.jsonl")
    counted.clear()
    text = (folder / "b.csv").read_text()
    (folder / "b.csv").write_text(text[: text.rindex("\n", 0, -1) + 1])
    run("align", "day", *PLACE, "--json", "o.jsonl")
    assert counted == ["day/b.csv", "day/c.csv"]
    counted.clear()
    run("align", "day", *PLACE, "--at", "start", "--json", "o.jsonl")
    assert counted == ["day/a.csv", "day/b.csv", "day/c.csv"]


def test_info_and_allan_have_their_own_columns(run: Run, folder: Path):
    done = run("info", "day/a.csv", "day/b.csv", "--jobs", "1", "--json", "-")
    assert done.code == 0
    assert [json.loads(row)["document"]["schema"] for row in done.out.splitlines()] == [
        "schuler.info/1"
    ] * 2
    assert "2 of 2 records have a result" in done.err
    done = run("allan", "day/a.csv", "day/b.csv", "--jobs", "1")
    assert "angle random walk, deg/sqrt(h)" in done.out.splitlines()[0]


@pytest.mark.slow
def test_processes_give_the_same_lines(run: Run, folder: Path):
    run("align", "day", *PLACE, "--json", "one.jsonl")
    run("align", "day", *PLACE[:-1], "2", "--json", "two.jsonl")
    assert lines(folder.parent / "one.jsonl") == lines(folder.parent / "two.jsonl")


def test_a_cluster_gets_full_names_and_the_table_has_those_that_were_said(
    run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch
):
    from schuler.campaigns import execute

    class Here(Executor):
        """A cluster of this process alone."""

        def submit(self, function, *arguments):  # type: ignore[no-untyped-def]
            assert Path(arguments[1]).is_absolute()
            future: Future[object] = Future()
            future.set_result(function(*arguments))
            return future

    named: list[str] = []

    def cluster(scheduler: str) -> Here:
        named.append(scheduler)
        return Here()

    monkeypatch.setattr(execute, "cluster_executor", cluster)
    done = run("align", "day", *PLACE[:-2], "--scheduler", "tcp://host:8786")
    assert named == ["tcp://host:8786"]
    assert done.code == many.SOME_FAILED
    assert [row.split()[0] for row in done.out.splitlines()[1:4]] == [
        "day/a.csv", "day/b.csv", "day/c.csv"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("day", "--json", "o.json"), "several records give JSON lines: name a .jsonl file"),
        (("day", "--follow"), "--follow is for one record"),
        (("day/a.csv", "-"), "standard input is one record"),
        (("nothing",), "nothing: holds no record (.asc, .bag"),
    ],
)
def test_what_cannot_be_asked_of_several_is_said(
    run: Run, folder: Path, arguments: tuple[str, ...], said: str
):
    (folder.parent / "nothing").mkdir()
    done = run("align", *arguments, *PLACE)
    assert (done.code, done.out) == (2, "")
    assert said in done.err


def test_where_no_record_has_a_result_the_exit_code_is_that_of_an_error(run: Run, folder: Path):
    done = run("align", "day/c.csv", "day/d.csv", *PLACE)
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith("schuler: none of the 2 records has a result: day/c.csv")
