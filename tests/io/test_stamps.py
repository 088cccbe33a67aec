"""Stamps: their unit is found, counters go on, bursts and coarse ones are named, dates are read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from schuler import InputError, open_source, read
from schuler.io.clock import Clock
from schuler.io.instants import to_seconds
from tests.io.conftest import Array, make_rows, make_text, same

Put = Callable[..., Path]


def stamped(stamps: list[str], rows: Array, header: str = "time,gx,gy,gz,ax,ay,az") -> str:
    """Return a table with these texts for stamps."""
    lines = [",".join([s, *map(repr, map(float, r))]) for s, r in zip(stamps, rows, strict=True)]
    return "\n".join([header, *lines]) + "\n"


#: unit, its size in s, rates whose stamps it can hold, the start: 1, 2, 3 could be seconds as well
UNITS = [
    (unit, factor, rate, begin)
    for unit, factor, most in (("ms", 1e-3, 500.0), ("us", 1e-6, 2000.0), ("ns", 1e-9, 2000.0))
    for rate in (2.5, 25.0, 100.0, 400.0, 500.0, 1000.0, 2000.0)
    for begin in (0.0, 1.7e9)
    if rate < most
]


@pytest.mark.parametrize(("unit", "factor", "rate", "begin"), UNITS)
def test_the_unit_is_found_by_the_rate(unit: str, factor: float, rate: float, begin: float) -> None:
    stamps = np.round((begin + np.arange(500) / rate) / factor)
    clock = Clock(None, None, [])
    clock.look(stamps)
    assert (clock.unit, clock.found) == (unit, True)
    assert np.allclose(clock.seconds(stamps), factor * stamps, rtol=0, atol=5e-7)


@pytest.mark.parametrize("step", [1e-4, 0.01, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("begin", [0.0, 604_000.0, 1.7e9])
def test_seconds_stay_seconds(step: float, begin: float) -> None:
    clock = Clock(None, None, [])
    clock.look(begin + step * np.arange(100))
    assert (clock.unit, clock.found) == ("s", False)


def test_days_of_matlab_and_of_spreadsheets() -> None:
    for begin in (738_000.0, 45_000.0):
        clock = Clock(None, None, [])
        clock.look(begin + np.arange(300) / 86400.0 / 25.0)
        assert clock.unit == "86400 s"


@pytest.mark.parametrize(
    ("period", "unit", "what"),
    [
        (604_800.0, None, "the end of a week"),
        (86_400.0, None, "the end of a day"),
        (3600.0, None, "the end of a hour"),
        (604_800_000.0, "ms", "the end of a week"),
        (2.0**32, "us", "a counter of 32 bits"),
        (2.0**32, "0.0001 s", "a counter of 32 bits"),
        (2.0**16, "ms", "a counter of 16 bits"),
        (2.0**32 * 1e-6, None, "a counter of 32 bits"),
    ],
)
def test_stamps_that_start_again_go_on(period: float, unit: str | None, what: str) -> None:
    factor = Clock(unit, None, []).interval(np.ones(1))[0]
    true = period * factor + (np.arange(2000) - 1000.5) * 0.01
    raw = np.mod(true / factor, period)
    notes: list[str] = []
    whole = Clock(unit, None, notes)
    whole.look(raw)
    assert np.allclose(whole.seconds(raw), true, rtol=0, atol=1e-6)
    assert len(notes) == 1
    assert what in notes[0]
    # In pieces of any size, the same bits.
    for size in (1, 7, 1001):
        pieces = Clock(unit, None, [])
        pieces.look(raw)
        found = [pieces.seconds(raw[i : i + size]) for i in range(0, len(raw), size)]
        assert np.array_equal(np.concatenate(found), Clock.seconds(whole.again(), raw))


def test_time_that_goes_back_is_still_an_error(put: Put) -> None:
    rows = make_rows(60)
    rows[30:, 0] -= 0.2
    with pytest.raises(InputError, match="time goes backward"):
        read(put(make_text(rows)))


@pytest.mark.parametrize(("size", "inside"), [(2, 1e-4), (5, 1e-4), (10, 1e-5), (5, 0.0)])
def test_bursts_are_named_with_the_rate(size: int, inside: float, put: Put) -> None:
    rows = make_rows(400)
    k = np.arange(400)
    rows[:, 0] = (k // size + 1) * size * 0.01 - (size - 1 - k % size) * inside
    path = put(make_text(rows))
    with pytest.raises(InputError, match=r"arrive in bursts.*as --rate 100$"):
        read(path)
    assert read(path, rate=100.0).duration == pytest.approx(3.99)


def test_gaps_now_and_then_are_no_bursts(put: Put) -> None:
    rows = np.delete(make_rows(600), [50, 51, 200, 333, 334, 335, 500], axis=0)
    assert read(put(make_text(rows))).quality.gaps == 4


def test_stamps_of_32_bits_are_said(put: Put) -> None:
    rows = make_rows(400)
    rows[:, 0] = (30_000 + 0.01 * np.arange(400)).astype(np.float32)
    source = open_source(put(make_text(rows)))
    assert any("resolution of 32-bit numbers (1.95 ms)" in note for note in source.notes)
    assert "--rate 100" in " ".join(source.notes)


def test_a_stated_unit_that_gives_no_rate_is_doubted(put: Put) -> None:
    rows = make_rows(100)
    rows[:, 0] = 10.0 * np.arange(100)
    source = open_source(put(make_text(rows)), time="s")
    assert source.mapping.time == "s"
    assert any("in ms it would be 100 Hz (--time ms)" in note for note in source.notes)


@pytest.mark.parametrize(
    "form",
    [
        "2026-11-27 10:00:{:06.3f}+00:00",
        "2026-11-27T10:00:{:06.3f}Z",
        "2026-11-27T11:00:{:06.3f}+01:00",
        "2026/11/27 10:00:{:06.3f}",
        "2026-11-27T08:30:{:06.3f}-0130",
    ],
)
def test_dates_are_unix_times(form: str, put: Put) -> None:
    rows = make_rows(200)
    stamps = [form.format(t) for t in rows[:, 0]]
    source = open_source(put(stamped(stamps, rows[:, 1:])))
    found = source.read()
    assert found.time[0] == pytest.approx(1_795_773_600.02, abs=1e-6)
    assert np.allclose(np.diff(found.time), 0.01, rtol=0, atol=1e-6)
    assert any("no zone" in note for note in source.notes) == (form[-1] == "}")
    # Read in one way or cell by cell, the same.
    assert to_seconds(stamps[1]) == pytest.approx(found.time[0], abs=1e-6)


def test_times_of_day_pass_midnight(put: Put) -> None:
    rows = make_rows(200)
    seconds = 86_399.0 + rows[:, 0]
    stamps = [f"{int(s) // 3600 % 24:02d}:{int(s) // 60 % 60:02d}:{s % 60:06.3f}" for s in seconds]
    found = read(put(stamped(stamps, rows[:, 1:])))
    assert np.allclose(found.time, seconds[1:], rtol=0, atol=1e-6)


def test_a_cell_that_is_no_date_is_named(put: Put) -> None:
    rows = make_rows(5)
    stamps = [f"2026-11-27T10:00:0{k}Z" for k in range(5)]
    stamps[3] = "later"
    with pytest.raises(InputError, match=r"line 5, column 'time': 'later' is no date and time"):
        read(put(stamped(stamps, rows[:, 1:])))


def test_the_rate_frees_the_time_column(put: Put) -> None:
    rows = make_rows(40)
    expected = read(put(make_text(rows)), rate=100.0)
    for stamps in (["noon"] * 40, ["12:61:99"] * 40, [""] * 40):
        assert same(read(put(stamped(stamps, rows[:, 1:]), "odd.csv"), rate=100.0), expected)


@pytest.mark.parametrize(
    "names", ["sec,nanosec", "header.stamp.sec,header.stamp.nanosec", "stamp_secs,stamp_nsecs"]
)
def test_time_in_two_columns(names: str, put: Put) -> None:
    rows = make_rows(250)
    ns = np.round(1e9 * (1_700_000_000 + rows[:, 0] - 1.0)).astype(np.int64)
    table = np.column_stack([rows[:, 1:]])
    lines = [
        ",".join([str(n // 10**9), str(n % 10**9), *map(repr, map(float, r))])
        for n, r in zip(ns, table, strict=True)
    ]
    path = put("\n".join([f"{names},gx,gy,gz,ax,ay,az", *lines]) + "\n")
    source = open_source(path)
    assert "columns '" in source.meaning
    found = source.read()
    assert np.allclose(found.time, ns[1:] / 1e9, rtol=0, atol=1e-6)


def test_start_and_stop_count_from_the_first_row_with_a_plus(put: Put) -> None:
    rows = make_rows(400)
    plain = read(put(make_text(rows)), start=1.01, stop=2.01)
    rows[:, 0] += 1.7e9
    path = put(make_text(rows), "later.csv")
    found = read(path, start="+1s", stop="+2")
    assert len(found) == len(plain)
    assert found.start == pytest.approx(1.7e9 + 1.01, abs=1e-5)
    mixed = read(path, start="+1s", stop=1.7e9 + 2.01)
    assert same(mixed, found)
    date = read(path, start="2023-11-14T22:13:21.01Z", stop="+2 s")
    assert same(date, found)
    with pytest.raises(
        InputError, match=r"row is at 1700000000.01 s; with a plus, as --start \+60s"
    ):
        read(path, stop=2.0)
    with pytest.raises(InputError, match="must be before stop"):
        read(path, start="+3s", stop="+2s")
    with pytest.raises(InputError, match="no samples between"):
        read(path, start="+30s")


def test_an_instant_of_a_large_time_is_shown_in_full(put: Put) -> None:
    rows = np.delete(make_rows(200), slice(100, 130), axis=0)
    rows[:, 0] += 1.7e9
    with pytest.raises(InputError, match=r"\(t = 1700000001.31 s\).*since t = 1700000001(\.00)? s"):
        read(put(make_text(rows)))
