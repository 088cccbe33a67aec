"""KF-GINS text and binary."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from schuler import InputError, open_source, read
from schuler.record import ImuRecord
from tests.io.conftest import Array, make_text, same

Put = Callable[..., Path]
FRD = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def expected(rows: Array) -> ImuRecord:
    return ImuRecord.from_increments(rows[:, 0], rows[:, 1:4] @ FRD.T, rows[:, 4:7] @ FRD.T)


def odo(rows: Array) -> Array:
    return np.column_stack([rows, np.linspace(1, 2, len(rows))])


@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.parametrize("binary", [False, True])
def test_both_forms(put: Put, rows: Array, binary: bool, wide: bool) -> None:
    rows[:, 0] += 357473.0
    table = odo(rows) if wide else rows
    content = table.astype("<f8").tobytes() if binary else make_text(table, "  ", header=None)
    source = open_source(put(content, "Leador-A15.bin"), format="kf-gins")
    assert source.meaning == (
        "increments in rad and m/s, axes FRD, time from the seconds of the week in s"
    )
    assert source.format == "kf-gins"
    assert same(source.read(), expected(rows))
    # What is said wins.
    turned = read(source.path, format="kf-gins", axes="RFU")
    assert np.array_equal(turned.dtheta, rows[:, 1:4])


def test_sizes_that_fit_both(put: Put, rows: Array) -> None:
    # 56 rows of 8 are 64 rows of 7: the time decides.
    many = np.vstack([rows, rows])[:56]
    many[:, 0] = 0.01 * np.arange(56)
    path = put(odo(many).astype("<f8").tobytes(), "a.bin")
    assert same(read(path, format="kf-gins"), expected(many))


def test_errors(put: Put, rows: Array) -> None:
    whole = rows.astype("<f8").tobytes()
    with pytest.raises(InputError, match=r"a\.bin: is truncated, or not a KF-GINS file of 7 or 8"):
        read(put(whole[:-4], "a.bin"), format="kf-gins")
    with pytest.raises(InputError, match="or not a KF-GINS file"):
        read(put(rows[::-1].astype("<f8").tobytes(), "a.bin"), format="kf-gins")
    path = put(whole, "a.bin")
    named = read(path, format="kf-gins", columns="t,gx,gy,gz,ax,ay,az")
    assert same(named, expected(rows))
    with pytest.raises(InputError, match=r"'kfgins' .did you mean 'kf-gins'\?.; known: "):
        read(path, format="kfgins")
    with pytest.raises(InputError, match="--columns names 2 columns"):
        read(put("1 2 3\n4 5 6\n", "a.txt"), format="kf-gins", columns="1,2")


def test_the_format_may_stand_beside_the_file(put: Put, rows: Array) -> None:
    path = put(make_text(rows, " ", header=None), "a.txt")
    path.with_name("schuler-mapping.toml").write_text('format = "kf-gins"\n')
    assert same(read(path), expected(rows))
    assert open_source(path).kind == "increments"
    assert open_source(path, format="text").kind == "rates"
