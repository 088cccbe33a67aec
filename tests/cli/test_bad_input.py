"""What a tired person feeds it: one clear sentence and exit code 2, or a stated warning.

Every case names the words that must be in the sentence. Nothing is drawn at random except the
record itself (seeded), so there are no false alarms.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from pyarrow import parquet
from scipy.io import savemat

from schuler.cli import main

from .conftest import NAMES, PLACE, Ran, as_text

Array = NDArray[np.float64]
Run = Callable[..., Ran]
#: makes the files, and gives what to write after ``schuler``
Make = Callable[[Path, Array], list[object]]

SPEC = """
[gyro]
bias = "0.01 deg/h"
[accelerometer]
bias = "50 ug"
"""


def content(data: str | bytes, name: str = "truck.csv", *more: object) -> Make:
    """Return a case whose file has this content."""

    def make(folder: Path, table: Array) -> list[object]:
        path = folder / name
        path.write_bytes(data if isinstance(data, bytes) else data.encode())
        return ["align", path, *PLACE, *more]

    return make


def spoilt(change: Callable[[Array], Array | None], *more: object, place: bool = True) -> Make:
    """Return a case whose table was changed."""

    def make(folder: Path, table: Array) -> list[object]:
        changed = change(table)
        path = folder / "truck.csv"
        path.write_text(as_text(table if changed is None else changed))
        return ["align", path, *(PLACE if place else ()), *more]

    return make


def said(*more: object, place: bool = True) -> Make:
    """Return a case whose file is good and whose options are not."""
    return spoilt(lambda x: None, *more, place=place)


def text(change: Callable[[list[str]], list[str]], *more: object) -> Make:
    """Return a case whose lines were changed."""

    def make(folder: Path, table: Array) -> list[object]:
        path = folder / "truck.csv"
        path.write_text("\n".join(change(as_text(table).splitlines())) + "\n")
        return ["align", path, *PLACE, *more]

    return make


def beside(option: str, data: str, name: str = "said.toml") -> Make:
    """Return a case with a second file, given with an option."""

    def make(folder: Path, table: Array) -> list[object]:
        (folder / name).write_text(data)
        arguments = said()(folder, table)
        return [*arguments, option, folder / name] if option else arguments

    return make


def cut_short(name: str, keep: float) -> Make:
    """Return a case with a good file of another format of which only the beginning is there."""

    def make(folder: Path, table: Array) -> list[object]:
        path = folder / name
        columns = dict(zip(NAMES, table.T, strict=True))
        if name.endswith(".parquet"):
            parquet.write_table(pa.table(columns), path)
        elif name.endswith(".npz"):
            np.savez(path, t=table[:, 0], gyro=table[:, 1:4], accel=table[:, 4:])
        elif name.endswith(".mat"):
            savemat(path, {"t": table[:, 0], "gyro": table[:, 1:4], "accel": table[:, 4:]})
        else:
            table.astype("<f8").tofile(path)
        whole = path.read_bytes()
        path.write_bytes(whole[: int(keep * len(whole))])
        return ["align", path, *PLACE]

    return make


def pickled(folder: Path, table: Array) -> list[object]:
    path = folder / "truck.npz"
    objects = np.array([{"a": 1}, None], dtype=object)
    np.savez(path, t=table[:, 0], gyro=objects, accel=table[:, 4:])
    return ["align", path, *PLACE]


def bomb(folder: Path, table: Array) -> list[object]:
    with zipfile.ZipFile(folder / "truck.npz", "w") as archive:
        archive.writestr("gyro.npy", b"this is no array")
    return ["align", folder / "truck.npz", *PLACE]


def words_in_parquet(folder: Path, table: Array) -> list[object]:
    columns = {name: list("abc") for name in NAMES}
    parquet.write_table(pa.table(columns), folder / "truck.parquet")
    return ["align", folder / "truck.parquet", *PLACE]


def a_folder(folder: Path, table: Array) -> list[object]:
    return ["align", folder, *PLACE]


def set_cell(row: int, column: int, cell: str) -> Callable[[list[str]], list[str]]:
    def change(lines: list[str]) -> list[str]:
        cells = lines[row].split(",")
        cells[column] = cell
        return [*lines[:row], ",".join(cells), *lines[row + 1 :]]

    return change


def put(where: object, value: object) -> Callable[[Array], None]:
    def change(x: Array) -> None:
        x[where] = value  # type: ignore[index]

    return change


def add(where: object, value: object) -> Callable[[Array], None]:
    def change(x: Array) -> None:
        x[where] += value  # type: ignore[index]

    return change


def scale(columns: slice, factor: float) -> Callable[[Array], None]:
    def change(x: Array) -> None:
        x[:, columns] *= factor

    return change


GYROS, FORCES, ALL = slice(1, 4), slice(4, 7), slice(1, 7)
N = 1200

ERRORS: dict[str, tuple[Make, str]] = {
    # files
    "missing file": (lambda f, x: ["align", f / "no.csv", *PLACE], "no.csv: there is no such file"),
    "missing file, info": (lambda f, x: ["info", f / "no.csv"], "there is no such file"),
    "folder": (a_folder, "holds no record"),
    "empty": (content(b""), "is empty"),
    "blank lines only": (content("\n\n \n"), "is empty"),
    "comments only": (content("# a\n# b\n"), "has no data rows"),
    "header only": (content(",".join(NAMES) + "\n"), "has a header but no data rows"),
    "one row": (spoilt(lambda x: x[:1]), "only one data row"),
    "two rows": (spoilt(lambda x: x[:2]), "too few to align"),
    "prose": (content("Call me Ishmael. Some years ago\nnever mind how long\n"), "not a row of"),
    "binary garbage": (content(bytes(range(256)) * 9, "truck.dat"), "neither text nor a known"),
    "binary garbage without NUL": (
        content(bytes(range(128, 256)) * 9, "truck.csv"), "no data rows|not a row|is no"),
    "UTF-16": (content("t,gx\n1,2\n".encode("utf-16")), "UTF-16"),
    "Macintosh line ends": (content("1,2,3,4,5,6,7\r2,2,3,4,5,6,7\r"), "Macintosh"),
    "truncated parquet": (cut_short("truck.parquet", 0.7), "truncated Parquet"),
    "text named parquet": (content("t,gx\n1,2\n", "truck.parquet"), "Parquet"),
    "words in parquet": (words_in_parquet, "not numbers"),
    "truncated npz": (cut_short("truck.npz", 0.7), "truncated"),
    "damaged npz": (bomb, "no array|damaged"),
    "pickle in npz": (pickled, "not loaded for safety"),
    "truncated mat": (cut_short("truck.mat", 0.7), "truncated|cut off|damaged"),
    "truncated bin": (cut_short("truck.bin", 0.7001), "truncated, or not 7 float64 columns"),
    "psins without header": (content("1 2 3 4 5 6\n", "truck.imu"), "no PSINS header"),
    "psins header cut": (content("% PSINS\n0 0 0 0 0 0\n", "truck.imu"), "1 of its 3 rows"),
    # rows
    "ragged row": (text(lambda s: [*s[:9], s[9] + ",1", *s[10:]]), "line 10 has 8 cells"),
    "short row": (text(lambda s: [*s[:9], "1,2", *s[10:]]), "line 10 has 2 cells"),
    "cell that is no number": (text(set_cell(20, 3, "0.1x")), "line 21, column 'gz': '0.1x'"),
    "decimal comma": (text(set_cell(20, 3, "0,1")), "line 21 has 8 cells"),
    "quotation mark": (text(set_cell(20, 3, '"0.1')), "line 21"),
    "time of the day": (text(set_cell(20, 0, "12:00:01")), "line 21, column 't'"),
    "NaN time": (spoilt(put((9, 0), np.nan)), "data row 10: the time is not a finite number"),
    "infinite time": (spoilt(put((9, 0), np.inf)), "data row 10: the time is not a finite"),
    "backward time": (spoilt(put((700, 0), 1.0)), r"data row 701 \(t = 1 s\): time goes back"),
    "repeated time": (
        spoilt(lambda x: np.insert(x, 50, x[50] + np.array([0, 1, 0, 0, 0, 0, 0]), axis=0)),
        r"data row 52 .*repeated with other values",
    ),
    "time stands still": (spoilt(put((slice(None), 0), 3.0)), "time"),
    "long gap": (spoilt(add((slice(800, None), 0), 30.0)), r"row 801 .*a gap of 30.05 s"),
    "all-NaN column": (
        spoilt(put((slice(None), 2), np.nan)),
        r"each of the 1200 data rows .*data row 1 \(t = 0.05 s\), gyro y",
    ),
    "all NaN": (spoilt(put((slice(None), ALL), np.nan)), "each of the 1200 data rows"),
    "zeros everywhere": (spoilt(put((slice(None), ALL), 0.0)), "read nothing"),
    "dead accelerometers": (spoilt(put((slice(None), FORCES), 0.0)), "accelerometers read nothing"),
    "huge values": (spoilt(put((300, 4), 1e200)), "data row 301"),
    "all huge": (spoilt(scale(ALL, 1e200)), "data row 1 "),
    "gyro beyond any": (spoilt(put((300, 1), -1e30)), r"data row 301 .*gyro x"),
    "saturated cell of FFFF": (spoilt(put((300, 4), 1.7e308)), "data row 301"),
    # units and columns
    "g read as m/s^2": (spoilt(scale(FORCES, 1 / 9.80665)), "fit .*were in g"),
    "mg read as m/s^2": (spoilt(scale(FORCES, 1e3 / 9.80665)), "fit .*were in mg"),
    "increments read as rates": (spoilt(scale(ALL, 0.05)), "fit .*increments over each interval"),
    "rates read as increments": (said("--gyro", "rad", "--accel", "m/s"), "fit .*rates, not inc"),
    "swapped triads": (spoilt(lambda x: x[:, [0, 4, 5, 6, 1, 2, 3]]), "mean .f. is"),
    "time taken for a gyro": (
        said("--columns", "2,1,3,4,5,6,7"), "time goes backward|does not advance|repeated"),
    "duplicate names": (text(lambda s: ["t,gx,gx,gz,ax,ay,az", *s[1:]]), "could both be gx"),
    "missing name": (text(lambda s: ["t,gx,foo,gz,ax,ay,az", *s[1:]]), "gy"),
    "header of too few": (text(lambda s: ["t,gx,gy,gz,ax", *s[1:]]), "header in line 1 names 5"),
    "six columns": (content("1,2,3,4,5,6\n2,2,3,4,5,6\n"), "column"),
    "column not there": (said("--columns", "t,gx,gy,gz,ax,ay,foo"), "'foo' is not in the file"),
    "column number not there": (said("--columns", "1,2,3,4,5,6,9"), "column 9 is not in the file"),
    "six names": (said("--columns", "gx,gy,gz,ax,ay,az"), "6 columns"),
    "column twice": (said("--columns", "t,gx,gx,gz,ax,ay,az"), "named twice"),
    "unknown unit": (said("--gyro", "furlong"), "unknown unit 'furlong'"),
    "unit of another kind": (said("--gyro", "m/s^2"), "is of acceleration"),
    "mixed kinds": (said("--gyro", "deg/s", "--accel", "m/s"), "both as rates|both as increments"),
    "mean rates of increments": (
        said("--gyro", "rad", "--accel", "m/s", "--mean-rates"), "mean rates are asked for"),
    "unknown time unit": (said("--time", "fortnight"), "unknown unit 'fortnight'"),
    "unknown axes": (said("--axes", "ABC"), "axes"),
    "left-handed axes": (said("--axes", "FRU"), "left-handed"),
    "axis twice": (said("--axes", "FFU"), "axes"),
    "rate of zero": (said("--rate", "0"), "rate: expected a positive"),
    "rate of words": (said("--rate", "fast"), "rate: expected a number"),
    "start time without rate": (said("--start-time", "3"), "start time needs a rate"),
    "bad delimiter": (said("--delimiter", "ab"), "delimiter"),
    "negative skip": (said("--skip-rows", "-1"), "skip_rows"),
    "variables of a text": (said("--variables", "gyro"), "variables"),
    "bad max-gap": (said("--max-gap", "0"), "longest gap must be a positive"),
    # place, span, method, instrument
    "latitude of 91": (said("--lat", "91", place=False), "from -90 to 90 deg"),
    "latitude of words": (said("--lat", "north", place=False), "--lat"),
    "latitude NaN": (said("--lat", "nan", place=False), "not a finite number"),
    "pole": (said("--lat", "90", place=False), "within 1 deg of a pole"),
    "height infinite": (said("--lat", "40", "--height", "inf", place=False), "height"),
    "height absurd": (said("--lat", "40", "--height", "-7e6", place=False), "height"),
    "no latitude": (said(place=False), "the latitude is needed"),
    "longitude only": (said("--lon", "116", place=False), "needs its latitude"),
    "start after stop": (said("--start", "30", "--stop", "10"), "must be before stop"),
    "start of words": (said("--start", "noon"), "--start"),
    "span outside": (said("--start", "1000", "--stop", "2000"), "no samples between"),
    "span before": (said("--stop", "-5"), "no samples between"),
    "span too short": (said("--start", "10", "--stop", "10.2"), "too few to align"),
    "bad window": (said("--windows", "abc"), "--windows"),
    "window of another kind": (said("--windows", "3 deg"), "is of angle, expected time"),
    "window of zero": (said("--windows", "0"), "a time above 0 s"),
    "window negative": (said("--windows", "-5"), "a time above 0 s"),
    "window NaN": (said("--windows", "nan"), "not a finite time"),
    "window longer than the record": (said("--windows", "1h"), "no window is full"),
    "window of one sample": (said("--windows", "0.05"), "too few to align"),
    "unknown method": (said("--method", "magic"), "unknown method 'magic'; the methods are"),
    "at the middle": (said("--at", "middle"), "--at"),
    "unknown grade": (said("--spec", "best"), "'best' is neither a grade"),
    "spec not there": (said("--spec", "no.toml"), "no.toml: cannot be read"),
    "spec no TOML": (beside("--spec", "= what"), "is not valid TOML"),
    "spec unknown key": (beside("--spec", SPEC + 'colour = "red"'), "accelerometer.colour"),
    "spec of another kind": (beside("--spec", SPEC.replace("deg/h", "ug")), "expected angular"),
    "spec without unit": (beside("--spec", SPEC.replace(" deg/h", "")), "has no unit"),
    "spec negative": (beside("--spec", SPEC.replace("0.01", "-0.01")), "is negative"),
    "spec without section": (beside("--spec", "[gyro]\n"), r"\[accelerometer\] is missing"),
    # outputs and options
    "folder of the output missing": (said("--json", "no/where/out.json"), "there is no folder"),
    "folder of the report missing": (said("--report", "no/r.html"), "there is no folder"),
    "output is a folder": (said("--json", "."), "is a folder"),
    "mapping not there": (said("--mapping", "no.toml"), "no.toml: cannot be read"),
    "mapping no TOML": (beside("--mapping", "gyro = "), "is not valid TOML"),
    "mapping unknown key": (beside("--mapping", "gyros = 'deg/s'"), "unknown key 'gyros'"),
    "mapping bad value": (beside("--mapping", "rate = 'fast'"), "rate: expected a number"),
    "bad sidecar": (beside("", "gyro = 3", "truck.csv.toml"), "truck.csv.toml: gyro"),
    "unknown option": (said("--colour"), "No such option.*--colour"),
    "unknown command": (lambda f, x: ["aline"], "No such command 'aline'"),
    "option without value": (said("--method"), "--method"),
    "no file": (lambda f, x: ["align", *PLACE], "FILE"),
    "idle without follow": (said("--idle", "3"), "--idle goes with --follow"),
    "idle negative": (said("--follow", "--idle", "-1"), "idle"),
    "follow with windows": (said("--follow", "--windows", "10"), "leave out --windows"),
    "follow a table that cannot grow": (
        lambda f, x: [*cut_short("truck.bin", 1.0)(f, x), "--follow"], "only text can"),
    "demo of no length": (lambda f, x: ["demo", "--out", f / "o", "--minutes", "0"], "--minutes"),
    "demo of negative seed": (lambda f, x: ["demo", "--out", f / "o", "--seed", "-1"], "--seed"),
    "demo onto a file": (
        lambda f, x: ["demo", "--out", content("x", "o")(f, x)[1], "--minutes", "0.2"], "made"),
}  # fmt: skip


def test_there_are_enough_kinds() -> None:
    assert len(ERRORS) >= 100


@pytest.mark.parametrize("kind", ERRORS)
def test_one_sentence(
    kind: str, run: Run, table: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    make, words = ERRORS[kind]
    arguments = make(tmp_path, table)
    before = sorted(tmp_path.rglob("*"))
    ran = run(*arguments)
    assert ran.code == 2, ran
    assert ran.err.count("\n") == 1, ran.err
    assert ran.err.startswith("schuler: ")
    assert len(ran.err) < 1200
    assert re.search(words, ran.err), ran.err
    assert "Traceback" not in ran.err
    assert ran.out == ""
    assert sorted(tmp_path.rglob("*")) == before


def at_its_limit(x: Array) -> None:
    x[200:220, 6] = x[:, 6].max() + 1.0


WARNINGS: dict[str, tuple[Make, str]] = {
    "a few NaN": (
        spoilt(put((slice(100, 103), 2), np.nan)),
        r"3 row\(s\) .*dropped, .*data row 101 .*gyro y"),
    "empty cells": (text(set_cell(20, 3, "")), r"1 row\(s\) .*data row 20 "),
    "infinity": (spoilt(put((30, 5), np.inf)), r"1 row\(s\) .*data row 31 .*accel y"),
    "repeated rows": (spoilt(lambda x: np.repeat(x, [1] * 99 + [2] + [1] * 1100, axis=0)),
                      r"1 row\(s\) that repeat"),
    "short gap": (spoilt(lambda x: np.delete(x, slice(400, 403), axis=0)), r"1 gap\(s\) bridged"),
    "saturation": (spoilt(at_its_limit), "accel z stays at its extreme .*saturated"),
    "stuck channel": (spoilt(put((slice(None), 2), 4e-5)), "gyro y is 4e-05 in every row"),
    "dead gyros": (spoilt(put((slice(None), GYROS), 0.0)), "gyro x is 0 in every row"),
    "deg/s read as rad/s": (spoilt(scale(GYROS, 57.29578)), "would fit .*were in deg/s"),
    "deg/h read as rad/s": (spoilt(scale(GYROS, 57.29578 * 3600)), "would fit .*in deg/h"),
    "accelerometers 2 % off": (spoilt(scale(FORCES, 1.02)), r"\+1.99 %"),
    "z down": (spoilt(lambda x: x * [1, 1, -1, -1, 1, -1, -1]), "points along -z"),
    "on its side": (spoilt(lambda x: x[:, [0, 3, 1, 2, 6, 4, 5]]), r"points along \+x"),
    "a clock that jitters": (
        spoilt(lambda x: x + np.outer(0.01 * (np.arange(N) % 3), np.eye(7)[0])), "jitter by"),
    "no specification": (said(), "no instrument specification was given"),
    "an instrument that cannot tell": (said("--spec", "industrial-mems"), "cannot tell north"),
}  # fmt: skip


@pytest.mark.parametrize("kind", WARNINGS)
def test_stated_warning(kind: str, run: Run, table: Array, tmp_path: Path) -> None:
    make, words = WARNINGS[kind]
    arguments = make(tmp_path, table)
    before = sorted(tmp_path.rglob("*"))
    ran = run(*arguments)
    assert ran.code in (0, 3), ran
    said = [line for line in ran.err.splitlines() if not line.startswith("note: assumed: ")]
    assert said == ran.warnings
    assert any(re.search(words, line) for line in ran.warnings), ran.err
    assert ran.out.startswith({0: ("heading ", "no heading "), 3: "INCONSISTENT: "}[ran.code])
    assert "warning" not in ran.out
    assert sorted(tmp_path.rglob("*")) == before


def test_a_note_for_a_cut_last_line(run: Run, table: Array, tmp_path: Path) -> None:
    path = tmp_path / "truck.csv"
    path.write_text(as_text(table)[:-60])
    ran = run("info", path)
    assert ran.code == 0
    assert "the last line is cut off and was dropped" in ran.out


def test_help_is_no_error(run: Run) -> None:
    assert run("--help").code == run("align", "--help").code == run("--version").code == 0


SMALL = as_text(
    np.column_stack(
        [
            0.05 * np.arange(24),
            np.tile([0.0, 4e-5, 5e-5, 0.1, 0.2, 9.79], (24, 1))
            + np.random.default_rng(3).normal(scale=1e-7, size=(24, 6)),
        ]
    )
).encode()


@given(
    cuts=st.lists(
        st.tuples(st.integers(0, len(SMALL)), st.integers(0, 40), st.binary(max_size=6)),
        max_size=5,
    ),
    command=st.sampled_from(["align", "info"]),
)
def test_mutated_tables_never_trace_back(
    cuts: list[tuple[int, int, bytes]],
    command: str,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    data = SMALL
    for place, length, insert in cuts:
        data = data[:place] + insert + data[place + length :]
    path = tmp_path_factory.getbasetemp() / "mutated-cli.csv"
    path.write_bytes(data)
    with pytest.raises(SystemExit) as stop:
        main([command, str(path), *PLACE])
    assert stop.value.code in (0, 2, 3)


@pytest.mark.parametrize("value", ["1e200", "-1e155", "1.7e308"])
def test_nonsense_is_refused_by_info_too(
    value: str, run: Run, table: Array, tmp_path: Path
) -> None:
    path = tmp_path / "truck.csv"
    path.write_text("\n".join(set_cell(40, 1, value)(as_text(table).splitlines())))
    ran = run("info", path)
    assert ran.code == 2
    assert re.search(r"data row 40 \(t = 2 s\): gyro x", ran.err), ran.err
