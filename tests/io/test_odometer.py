"""Forward speed of pulses, distances and four wheels, and what cannot be one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from schuler.errors import InputError
from schuler.io import aid_kind, read_speed

TIME = np.arange(0.0, 60.0, 0.02)
SPEED = 8.0 + 4.0 * np.sin(0.2 * TIME)
WAY = 8.0 * TIME + 20.0 * (1.0 - np.cos(0.2 * TIME))
PULSE = 0.0208


def table(path: Path, head: str, *columns: np.ndarray) -> Path:
    np.savetxt(path, np.column_stack([TIME, *columns]), "%.9g", ",", header=head, comments="")
    return path


def test_pulses_become_speeds_at_the_middle_of_intervals(tmp_path: Path) -> None:
    path = table(tmp_path / "o.csv", "t,pulses", np.floor(WAY / PULSE))
    assert aid_kind(path) == "speeds"
    found = read_speed(path, pulse_length=PULSE, sigma=0.01)
    true = np.interp(found.time, TIME, SPEED)
    # Each end is cut to a whole pulse, and the sigma says so.
    counting = PULSE / np.sqrt(6.0) / 0.1
    assert np.std(found.value - true) == pytest.approx(counting, rel=0.2)
    assert found.sigma == pytest.approx(np.hypot(0.01, counting))
    assert np.max(np.abs(found.value - true)) < 1.01 * PULSE / 0.1
    assert found.notes == ("speed is pulses over 0.1 s",)


def test_a_distance_may_be_in_kilometres(tmp_path: Path) -> None:
    path = table(tmp_path / "o.csv", "time [s],distance [km]", WAY / 1000.0)
    found = read_speed(path)
    np.testing.assert_allclose(found.value, np.interp(found.time, TIME, SPEED), atol=1e-2)
    assert found.sigma == pytest.approx(0.1)


def test_a_counter_that_wraps_loses_an_interval(tmp_path: Path) -> None:
    counts = np.floor(WAY / PULSE) % 16384
    found = read_speed(table(tmp_path / "o.csv", "t,ticks", counts), pulse_length=PULSE)
    assert found.dropped["a count that jumps"] in (1, 2)
    np.testing.assert_allclose(found.value, np.interp(found.time, TIME, SPEED), atol=0.25)


@pytest.mark.parametrize(
    ("wheels", "factor", "said"),
    [(None, 1.0, "the two rear"), ("rear", 1.0, "the two rear"), ("front", 1.05, "the two front"),
     ("all", 1.025, "all four")],
)  # fmt: skip
def test_four_wheels(tmp_path: Path, wheels: str | None, factor: float, said: str) -> None:
    front, rear = 1.05 * SPEED, SPEED
    path = table(tmp_path / "w.csv", "t,wheel_fl,wheel_fr,wheel_rl [m/s],wheel_rr",
                 front + 0.3, front - 0.3, rear - 0.2, rear + 0.2)  # fmt: skip
    assert aid_kind(path) == "speeds"
    found = read_speed(path, wheels=wheels)
    np.testing.assert_allclose(found.value, factor * SPEED, rtol=1e-7)
    assert found.notes == (f"speed is the mean of {said} wheels",)


@pytest.mark.parametrize(
    ("head", "columns", "options", "words"),
    [
        ("t,pulses", (WAY,), {}, "say how many metres one is"),
        ("t,pulses", (WAY,), {"pulse_length": -1.0}, "say how many metres one is"),
        ("t,speed", (SPEED,), {"pulse_length": 0.02}, "is for a column pulses"),
        ("t,speed", (SPEED,), {"wheels": "rear"}, "there are none"),
        ("t,fl,fr", (SPEED, SPEED), {}, "the rear wheels need columns rl, rr; there is fl, fr"),
        ("t,fl,fr", (SPEED, SPEED), {"wheels": "left"}, "wheels must be rear, front, all"),
        ("t,vx,vy,vz", (SPEED, SPEED, SPEED), {"wheels": "all"}, "three axes"),
        ("t,pulses", (10.0 + 5.0 * (-1.0) ** np.arange(len(TIME)) * (np.arange(len(TIME)) // 5),),
         {"pulse_length": 0.01}, "counted since the start, and not by the row"),
        ("t,count", (SPEED,), {}, "no column of speeds was found"),
    ],
)  # fmt: skip
def test_what_is_no_odometer_is_said(
    tmp_path: Path, head: str, columns: tuple[np.ndarray, ...], options: dict[str, object],
    words: str,
) -> None:  # fmt: skip
    path = table(tmp_path / "o.csv", head, *columns)
    with pytest.raises(InputError, match=words):
        read_speed(path, **options)  # type: ignore[arg-type]
