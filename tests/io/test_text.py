"""Text tables: every layout reads the same; every fault is one sentence with its line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schuler import InputError, open_source, read
from schuler.io import text as text_module
from schuler.record import ImuRecord
from tests.io.conftest import HEADER, Array, make_rows, make_text, same

Put = Callable[..., Path]


def expected(rows: Array, **options: object) -> ImuRecord:
    return ImuRecord.from_rates(rows[:, 0], rows[:, 1:4], rows[:, 4:7], **options)


# -- layouts ---------------------------------------------------------------------------


def layouts(rows: Array) -> dict[str, bytes]:
    plain = make_text(rows)
    lines = plain.splitlines()
    spaced = "\n".join(
        [HEADER.replace(",", "  ")]
        + ["   " + "   ".join(repr(float(v)) for v in row) + "  " for row in rows]
    )
    made = {
        "comma": plain,
        "no last newline": plain.rstrip("\n"),
        "no header": make_text(rows, header=None),
        "semicolon": make_text(rows, ";"),
        "tab": make_text(rows, "\t"),
        "blank": make_text(rows, " "),
        "blanks": spaced,
        "blanks and tabs": spaced.replace("   ", " \t "),
        "blanks, CRLF": spaced.replace("\n", "\r\n"),
        "CRLF": make_text(rows, end="\r\n"),
        "CR CR LF": make_text(rows, end="\r\r\n"),
        "decimal comma": plain.replace(",", ";").replace(".", ","),
        "comments": "# made by hand\n% so\n\n" + plain,
        "comments between": "\n".join([*lines[:9], "# here, 1, 2", "  % there", *lines[9:]]) + "\n",
        "empty lines": "\n".join([*lines[:9], "", "   ", *lines[9:], "", ""]) + "\n",
        "quoted": "\n".join(",".join(f'"{c}"' for c in line.split(",")) for line in lines),
        "trailing delimiter": "\n".join([lines[0]] + [line + "," for line in lines[1:]]),
        "trailing delimiters": "\n".join(line + "," for line in lines),
        "blanks in cells": plain.replace(",", " , "),
        "plus signs": plain.replace(",0", ",+0"),
        "fortran": plain.replace("e-", "D-"),
        "names in a comment": "# " + plain,
        "units": plain.replace(HEADER, "t (s),gx [rad/s],gy [rad/s],gz [rad/s],"
                               "ax [m/s^2],ay [m/s²],az [m/s2]").replace("[m/s²]", "[m/s^2]")
                      .replace("[m/s2]", "[m/s^2]"),
        "aliases": plain.replace(HEADER, "Time,Gyro_X,gyro.y,omega z,ACC_X,accel(y),fz"),
        "more columns": "\n".join(
            [f"label,{lines[0]},temp"] + [f"run {i},{line},x" for i, line in enumerate(lines[1:])]
        ),
    }  # fmt: skip
    out = {key: value.encode() for key, value in made.items()}
    out["byte order mark"] = b"\xef\xbb\xbf" + plain.encode()
    out["other encoding"] = "# schöne Grüße\n".encode("latin-1") + plain.encode()
    return out


@pytest.mark.parametrize("layout", layouts(make_rows(3)))
def test_layout(layout: str, put: Put, rows: Array) -> None:
    path = put(layouts(rows)[layout], "odd.suffix")
    source = open_source(path)
    assert source.format == "text"
    assert same(source.read(), expected(rows))
    assert source.progress == 1.0
    assert source.notes == []


def test_options_of_layout(put: Put, rows: Array) -> None:
    lines = make_text(rows, header=None).splitlines()
    path = put("junk\n7 of it\n" + "\n".join(["// x", *lines]))
    assert same(read(path, skip_rows=2, comment="//"), expected(rows))
    path = put("\n".join(line.replace(",", "|").replace(".", ",") for line in lines))
    assert same(read(path, delimiter="|", decimal=","), expected(rows))
    path = put(make_text(rows, "\t", header=None).replace(".", ","))
    assert same(read(path, decimal=","), expected(rows))
    path = put("1,2,3,4,5,6,7\n" + "\n".join(lines))
    assert same(read(path, header=True, columns="1,2,3,4,5,6,7"), expected(rows))


# -- columns ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ("az,ay,ax,gz,gy,gx,t", None),
        ("az,ay,ax,gz,gy,gx,t", "t,gx,gy,gz,ax,ay,az"),
        ("az,ay,ax,gz,gy,gx,t", "7,6,5,4,3,2,1"),
        ("az,ay,ax,gz,gy,gx,t", "t,gx,5,4,ax,2,az"),
        ("c,b,a,z,y,x,clock", "clock,x,y,z,a,b,c"),
        ("c [m/s^2],b [m/s^2],a [m/s^2],z,y,x,clock", "clock,x,y,z,a [m/s^2],b,c"),
        (None, "az,ay,ax,gz,gy,gx,t"),
        (None, "fz,fy,fx,wz,wy,wx,time"),
        (None, "7,6,5,4,3,2,1"),
    ],
)
def test_columns(header: str | None, columns: str | None, put: Put, rows: Array) -> None:
    path = put(make_text(rows[:, ::-1], header=header))
    assert same(read(path, columns=columns), expected(rows))


def test_columns_passed_over(put: Put, rows: Array) -> None:
    wide = np.column_stack([rows[:, :1] * 0 + 9, rows[:, :4], rows[:, 1], rows[:, 4:], rows[:, 0]])
    path = put(make_text(wide, header=None))
    assert same(read(path, columns="_,t,gx,gy,gz,-,ax,ay,az"), expected(rows))


def test_rate_makes_the_clock(put: Put, rows: Array) -> None:
    path = put(make_text(rows[:, 1:], header=None))
    source = open_source(path, rate=50, start_time=2)
    record = source.read()
    assert source.meaning.endswith("time from the rate 50 Hz, starting at 2 s")
    assert record.start == 2.0
    assert np.array_equal(record.time, 2 + np.arange(1, 40) / 50)
    increments = read(path, rate=50, start_time=2, gyro="rad", accel="m/s")
    assert np.allclose(increments.time, 2 + np.arange(1, 41) / 50, rtol=0, atol=1e-12)
    assert increments.start == pytest.approx(2.0, abs=1e-12)
    # With a time column the rate replaces it.
    with_time = put(make_text(rows), "time.csv")
    assert same(read(with_time, rate=50, start_time=2), record)
    picked = read(with_time, rate=50, start_time=2, columns="gx,gy,gz,ax,ay,az")
    assert same(picked, record)


@pytest.mark.parametrize(
    ("header", "options", "part"),
    [
        ("t,x,gy,gz,ax,ay,az", {}, "no column for gx was found; its columns are t, x, gy"),
        ("x,gx,gy,gz,ax,ay,az", {}, "no time column"),
        ("t,gx,gx,gz,ax,ay,az", {}, r"columns 2 \('gx'\) and 3 \('gx'\) could both be gx"),
        ("t,gx,wx,gz,ax,ay,az", {}, r"could both be gx"),
        (HEADER, {"columns": "t,wx,gy,gz,ax,ay,az"},
         "column 'wx' is not in the file; its columns are t, gx, gy"),
        (HEADER, {"columns": "8,2,3,4,5,6,7"}, "column 8 is not in the file, which has 7"),
        (HEADER, {"columns": "t,gx,gy,gz,ax,ay"}, "names 6 columns"),
        (HEADER, {"columns": "t,gx,gy"}, "names 3 columns, expected seven"),
        (HEADER, {"columns": "t,gx,2,gz,ax,ay,az"}, "takes column 2 .* twice"),
        (HEADER, {"columns": "t,gx,gy,gz,_,ay,az"}, "passes over"),
        ("t,q,q,gz,ax,ay,az", {"columns": "t,q,gz,2,ax,ay,az"}, "2 columns are named 'q'"),
        (None, {"columns": "t,gx,gy,gz,ax,ay,az,_"}, "names 8 columns, but there are only 7"),
        (None, {"columns": "t,gx,gy,gz,ax,ay,bz"}, "column 'bz' means nothing here"),
        (None, {"columns": "t,gx,gy,gz,ax,ay,fx"}, "names ax twice"),
        (None, {"columns": "t,gx,gy,gz,ax,ay,_"}, "no column for az"),
        (None, {"columns": "_,gx,gy,gz,ax,ay,az"}, "no time column"),
        ("t,gx [deg/s],gy [rad/s],gz,ax,ay,az", {}, "gyro columns have different units"),
        ("t,gx [q/s],gy [q/s],gz [q/s],ax,ay,az", {}, "unknown unit 'q/s'"),
        ("t,gx [rad],gy [rad],gz [rad],ax [g],ay [g],az [g]", {}, "both as rates"),
        (HEADER, {"gyro": "deg", "accel": "g"}, "'deg' is of angle, .* 'g' of acceleration"),
        (HEADER, {"gyro": "deg", "mean_rates": True}, "are increments; drop --mean-rates"),
        (HEADER, {"start_time": 1}, "a start time needs a rate"),
    ],
)  # fmt: skip
def test_column_errors(
    header: str | None, options: dict[str, object], part: str, put: Put, rows: Array
) -> None:
    path = put(make_text(rows, header=header))
    with pytest.raises(InputError, match=part) as error:
        read(path, **options)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


# -- meaning ---------------------------------------------------------------------------


def test_units_and_kinds(put: Put, rows: Array) -> None:
    path = put(make_text(rows))
    t, w, f = rows[:, 0], rows[:, 1:4], rows[:, 4:]
    deg = np.pi / 180
    record = read(path, gyro="0.1 deg/s", accel="mg", time="0.5 s")
    assert np.allclose(record.time, 0.5 * t[1:])
    assert np.allclose(record.dtheta[0], 0.005 * 0.5 * (w[0] + w[1]) * 0.1 * deg, rtol=1e-12)
    assert np.allclose(record.dvel[0], 0.005 * 0.5 * (f[0] + f[1]) * 9.80665e-3, rtol=1e-12)
    record = read(path, mean_rates=True)
    assert same(record, ImuRecord.from_mean_rates(t, w, f))
    record = read(path, gyro="rad", accel="m/s", coning_corrected=True)
    assert same(record, ImuRecord.from_increments(t, w, f, coning_corrected=True))


@pytest.mark.parametrize(
    ("header", "options", "meaning"),
    [
        (HEADER, {}, "instantaneous rates in rad/s and m/s^2 (assumed), axes RFU (assumed), "
                     "time from column 't' in s"),
        (HEADER, {"gyro": "deg/s"}, "instantaneous rates in deg/s and m/s^2 (accelerometer unit "
                                    "assumed), axes RFU (assumed), time from column 't' in s"),
        (HEADER, {"accel": "g*s", "axes": "y,x,-z", "time": "ms"},
         "increments in rad and g*s (gyro unit assumed), axes FRD, time from column 't' in ms"),
        (None, {"mean_rates": True, "gyro": "deg/s", "accel": "g", "axes": "RFU"},
         "rates averaged over each interval in deg/s and g, axes RFU, time from column 1 in s"),
        ("clock [ms],gx [deg/h],gy [deg/h],gz [deg/h],ax,ay,az",
         {"columns": "clock,gx,gy,gz,ax,ay,az"},
         "instantaneous rates in deg/h and m/s^2 (accelerometer unit assumed), axes RFU "
         "(assumed), time from column 'clock' in ms"),
        ("t,dtheta_x,dtheta_y,dtheta_z,dvx,dvy,dvz", {},
         "increments in rad and m/s, axes RFU (assumed), time from column 't' in s"),
    ],
)  # fmt: skip
def test_meaning(
    header: str | None, options: dict[str, object], meaning: str, put: Put, rows: Array
) -> None:
    assert open_source(put(make_text(rows, header=header)), **options).meaning == meaning


def test_interval_column_of_others_increments(put: Put, rows: Array) -> None:
    dt = 0.004 + 0.001 * (np.arange(len(rows)) % 3)
    table = np.column_stack([np.cumsum(dt), dt, rows[:, 1:]])
    header = "t,dt,gx [rad],gy [rad],gz [rad],ax [m/s],ay [m/s],az [m/s]"
    record = read(put(make_text(table, header=header)))
    assert np.array_equal(record.dt, dt)
    assert np.array_equal(record.dvel, rows[:, 4:])


# -- missing values and cut files ------------------------------------------------------


@pytest.mark.parametrize("cell", ["", "nan", "NaN", "NA", "null", "inf", "-inf"])
def test_cells_without_a_number_drop_the_row(cell: str, put: Put, rows: Array) -> None:
    lines = make_text(rows).splitlines()
    lines[5] = ",".join([*lines[5].split(",")[:3], cell, *lines[5].split(",")[4:]])
    record = read(put("\n".join(lines)))
    assert record.quality is not None
    assert record.quality.not_finite == 1
    assert record.quality.first_not_finite == "data row 5 (t = 0.05 s), gyro z"
    assert same(record, expected(np.delete(rows, 4, axis=0)))


def test_cut_last_line_is_dropped_with_a_note(put: Put, rows: Array) -> None:
    text = make_text(rows)
    source = open_source(put(text + "0.41,1e-3,0.0"))
    assert same(source.read(), expected(rows))
    assert source.notes == ["the last line is cut off and was dropped: '0.41,1e-3,0.0'"]
    with pytest.raises(InputError, match="line 42 has 3 cells, expected 7"):
        read(put(text + "0.41,1e-3,0.0\n"))


# -- faults ----------------------------------------------------------------------------

GOOD = make_text(make_rows(5))


@pytest.mark.parametrize(
    ("content", "part"),
    [
        (b"", "is empty"),
        (b"\n \n", "is empty"),
        (b"# only\n", "has no data rows"),
        (HEADER, "has a header but no data rows"),
        (HEADER + "\n", "has a header but no data rows"),
        (HEADER + "\n0.01,1,2,3,4,5,6\n", "only one data row"),
        (GOOD + "0.06,1,2,x,4,5,6\n", "line 7, column 'gz': 'x' is not a number"),
        (GOOD + "0.06,1,2,3,4,5\n", "line 7 has 6 cells, expected 7: '0.06,1,2,3,4,5'"),
        (GOOD + "0.06,1,2,3,4,5,6,7\n", "line 7 has 8 cells, expected 7"),
        (GOOD + "0.06,1,2,1_0,4,5,6\n", "line 7, column 'gz': '1_0' is not a number"),
        (GOOD + "0.06,1,2,0x10,4,5,6\n", "line 7, column 'gz'"),
        ("# a\n\n" + GOOD + "0.06,,2,true,4,5,6\n", "line 9, column 'gz': 'true'"),
        (GOOD + "12:30:01,1,2,3,4,5,6\n", "line 7, column 't': '12:30:01' is not a number"),
        (GOOD + ",1,2,3,4,5,6\n", "data row 6: the time is not a finite number"),
        (GOOD + "0.02,1,2,3,4,5,6\n", r"data row 6 \(t = 0.02 s\): time goes backward"),
        (GOOD + "0.05,1,2,3,4,5,6\n", "the time of the row before is repeated"),
        (GOOD + "9,1,2,3,4,5,6\n", "a gap of 8.95 s"),
        (b"\xff\xfet\0,\0", "is UTF-16 text"),
        (b"\x00\x01\x02\x03" * 50, "neither text nor a known binary format"),
        (GOOD.replace("\n", "\r"), "old Macintosh line ends"),
        (GOOD.splitlines()[0] + "\n1,2,3\n4,5,6\n", "line 2 has 3 cells, but the header in line 1"),
        ("some title\n" + GOOD, r"line 2 \('t,gx.*--skip-rows"),
        ("1,2,3\n4,5,6\n", "it has 3 columns without names"),
        ("1;2,5;3;4;5;6;7\n2;2.5;3;4;5;6;7\n", "line 2, column 2: '2.5' is not a number"),
        ("9" * 2_000_000, "line 1 is longer than 1 MB"),
    ],
)
def test_faults(content: str | bytes, part: str, put: Put) -> None:
    path = put(content)
    with pytest.raises(InputError, match=part) as error:
        read(path)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


def test_files_that_are_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no\.csv: there is no such file"):
        read(tmp_path / "no.csv")
    with pytest.raises(InputError, match="is a folder"):
        read(tmp_path)


def test_file_that_may_not_be_read(csv: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: Path, *args: object, **kwargs: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(InputError, match=r"truck\.csv: cannot be read \(Permission denied\)"):
        read(csv)


def test_bad_arguments(csv: Path) -> None:
    for options, part in (
        ({"start": 2, "stop": 1}, "must be before stop"),
        ({"start": 7}, "no samples between 7 and its end"),
        ({"stop": -1}, "no samples between its start and -1"),
        ({"max_gap": -1}, "longest gap"),
    ):
        with pytest.raises(InputError, match=part):
            read(csv, **options)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="chunk size"):
        open_source(csv).chunks(0)


# -- blocks ----------------------------------------------------------------------------


@given(data=st.data(), block=st.integers(1, 700), size=st.integers(1, 50))
def test_any_block_and_chunk_size_gives_the_same_bits(
    data: st.DataObject, block: int, size: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    rows = make_rows(12)
    layout = data.draw(st.sampled_from(sorted(layouts(rows))))
    path = tmp_path_factory.getbasetemp() / "blocks.txt"
    path.write_bytes(layouts(rows)[layout])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(text_module, "_BLOCK_BYTES", block)
        source = open_source(path)
        parts = list(source.chunks(size))
    assert max(len(part) for part in parts) <= size
    assert same(ImuRecord.concatenate(parts), expected(rows))
    assert source.quality is not None
    assert source.quality.rows == 12


@given(block=st.integers(1, 300), bad=st.integers(0, 11))
def test_a_bad_line_is_named_whatever_the_block(
    block: int, bad: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    lines = make_text(make_rows(12)).splitlines()
    lines[4:4] = ["# note", ""]
    number = bad + 2 if bad < 3 else bad + 4
    lines[number - 1] = lines[number - 1].replace(",", ",?", 1)
    path = tmp_path_factory.getbasetemp() / "bad.txt"
    path.write_text("\n".join(lines) + "\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(text_module, "_BLOCK_BYTES", block)
        with pytest.raises(InputError, match=rf": line {number}, column 'gx': '\?"):
            read(path)


def test_start_and_stop(put: Put) -> None:
    rows = make_rows(1000)
    record = read(put(make_text(rows)), start=2.0, stop=5.0)
    whole = expected(rows).between(2.0, 5.0)
    assert np.array_equal(record.time, whole.time)
    # The first interval opens with the first row, so its second sample is a trapezoid's.
    assert np.array_equal(record.dtheta[1:], whole.dtheta[1:])
    # What lies outside is not checked, and rows keep their numbers.
    bad = rows.copy()
    bad[100, 0] = 0.0
    bad[700:, 0] = 0.0
    assert same(read(put(make_text(bad)), start=2.0, stop=5.0), record)
    with pytest.raises(InputError, match=r"data row 701 \(t = 0 s\): time goes backward"):
        read(put(make_text(bad)), start=2.0)


# -- fuzz ------------------------------------------------------------------------------


@given(content=st.binary(max_size=400))
def test_random_bytes_raise_nothing_else(
    content: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzz.csv"
    path.write_bytes(content)
    with pytest.raises(InputError) as error:
        read(path)
    assert "\n" not in str(error.value)


@given(
    layout=st.sampled_from(sorted(layouts(make_rows(3)))),
    cuts=st.lists(
        st.tuples(st.integers(0, 5000), st.integers(0, 9), st.binary(max_size=4)), max_size=4
    ),
)
def test_mutated_tables_raise_nothing_else(
    layout: str,
    cuts: list[tuple[int, int, bytes]],
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    content = layouts(make_rows(6))[layout]
    for place, length, insert in cuts:
        i = place % (len(content) + 1)
        content = content[:i] + insert + content[i + length :]
    path = tmp_path_factory.getbasetemp() / "mutated.csv"
    path.write_bytes(content)
    sentence = ""
    try:
        record = read(path)
        assert np.isfinite(record.dtheta).all()
        assert np.isfinite(record.dvel).all()
    except InputError as error:
        sentence = str(error)
    assert "\n" not in sentence
