"""Text tables whose rows name their sensor."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from schuler.errors import InputError
from schuler.io import open_source, read
from schuler.io.labelled import find_labelled
from schuler.io.mapping import Mapping

N = 300
Put = Callable[..., Path]


def samples() -> list[tuple[float, str, tuple[float, float, float]]]:
    """Return rows of gyros at 100 Hz and accelerometers 3 ms later, whose force grows with time."""
    out = []
    for k in range(1, N + 1):
        t = 0.01 * k
        out.append((t, "gyro", (1e-3, -2e-3, 5e-5 * k)))
        out.append((t + 0.003, "accel", (0.1, -0.2, 9.8 + 0.01 * (t + 0.003))))
    return out


def table(line: Callable[[float, str, tuple[float, float, float]], str], header: str = "") -> str:
    return header + "\n".join(line(*row) for row in samples()) + "\n"


FORMS = {
    "named columns": table(
        lambda t, s, v: f"{t:.4f},{s},{v[0]!r},{v[1]!r},{v[2]!r}", "time,sensor,x,y,z\n"
    ),
    "no header, milliseconds": table(
        lambda t, s, v: (
            f"{'GYR' if s == 'gyro' else 'ACC'};{1e3 * t:.1f};{v[0]!r};{v[1]!r};{v[2]!r}"
        )
    ),
    "blanks": table(lambda t, s, v: f"{t:.4f} /imu/{s} {v[0]!r} {v[1]!r} {v[2]!r}"),
    "a header that orders the values": table(
        lambda t, s, v: f"{s},{v[2]!r},{v[1]!r},{v[0]!r},3,{1e9 * t:.0f}",
        "name,z,y,x,accuracy,timestamp [ns]\n",
    ),
    "other sensors": table(
        lambda t, s, v: (
            f"TYPE_{'GYROSCOPE' if s == 'gyro' else 'ACCELEROMETER'},{t:.4f},"
            f"{v[0]!r},{v[1]!r},{v[2]!r}\nGPS,{t:.4f},48.0,11.0,500.0,3.0,0.5\n"
            f"TYPE_LINEAR_ACCELERATION,{t:.4f},0,0,0"
        )
    ),
    "times of day": table(
        lambda t, s, v: f"2026-01-02T00:00:{t:09.6f}Z,{s},{v[0]!r},{v[1]!r},{v[2]!r}",
        "time,sensor,x,y,z\n",
    ),
}


@pytest.mark.parametrize("form", FORMS)
def test_rows_that_name_their_sensor_are_joined(form: str, put: Put) -> None:
    source = open_source(put(FORMS[form]), axes="RFU")
    found = source.read()
    assert any("its rows name their sensor in column" in note for note in source.notes)
    assert found.rate == pytest.approx(100.0)
    assert np.allclose(found.gyro[:, :2], [1e-3, -2e-3], rtol=1e-9)
    t = found.time - found.time[0]
    # The accelerometers are interpolated to the gyros' stamps; a sample is a mean over its own.
    slope = np.polyfit(t, found.accel[:, 2], 1)
    assert slope[0] == pytest.approx(0.01, rel=1e-6)
    assert found.accel[0, 2] == pytest.approx(9.8 + 0.01 * 0.015, abs=2e-4)


def test_blocks_of_any_size_give_the_same_rows(put: Put) -> None:
    source = open_source(put(FORMS["other sensors"]), axes="RFU")
    whole = source.read()
    pieces = list(open_source(put(FORMS["other sensors"]), axes="RFU").chunks(7))
    assert np.array_equal(np.concatenate([piece.dvel for piece in pieces]), whole.dvel)


def test_what_else_is_there_is_said(put: Put) -> None:
    notes = open_source(put(FORMS["other sensors"]), axes="RFU").notes
    assert any("rows of GPS, TYPE_LINEAR_ACCELERATION were left out" in note for note in notes)


def test_a_bad_row_is_named_by_its_line(put: Put) -> None:
    lines = FORMS["named columns"].split("\n")
    lines[202] = lines[202].replace("9.8", "9.8.1")
    with pytest.raises(InputError, match="line 203"):
        read(put("\n".join(lines)), axes="RFU")
    lines[202] = "2.0"
    with pytest.raises(InputError, match="line 203 has no column 2, which names the sensor"):
        read(put("\n".join(lines)), axes="RFU")


def test_more_numbers_than_three_need_a_header(put: Put) -> None:
    text = table(lambda t, s, v: f"{s},{t:.4f},{t:.4f},{v[0]!r},{v[1]!r},{v[2]!r}")
    with pytest.raises(InputError, match="write a header that names them"):
        read(put(text))


@pytest.mark.parametrize(
    "text",
    [
        "t,gx,gy,gz,ax,ay,az\n" + "0.01,0,0,0,0,0,9.8\n" * 20,
        # One sensor alone, and a column of words that name none.
        table(lambda t, s, v: f"{t:.4f},gyro,{v[0]!r},{v[1]!r},{v[2]!r}"),
        "frame,t,gx,gy,gz,ax,ay,az\n" + "body,0.01,0,0,0,0,0,9.8\n" * 20,
    ],
)
def test_other_tables_are_not_taken_for_such(text: str) -> None:
    assert find_labelled(text.encode(), Mapping()) is None
