"""The clock of samples beside UTC: said, with its numbers."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.aiding.stream_clock import StreamClock
from schuler.errors import InputError

DAY = 86400.0


@pytest.mark.parametrize(
    ("clock", "day_time", "near", "expected"),
    [
        (StreamClock("utc"), 10.0, 12.0, 10.0),
        (StreamClock("utc"), 86399.0, 1.0, -1.0),
        (StreamClock("utc"), 5.0, 1_700_006_400.0 + 6.0, 1_700_006_405.0),
        (StreamClock("utc"), 86395.0, 1_700_006_400.0 + 6.0, 1_700_006_395.0),
        (StreamClock("gps", leap_seconds=18.0), 10.0, 3 * DAY + 30.0, 3 * DAY + 28.0),
        (StreamClock("gps", leap_seconds=18.0), 86390.0, 3 * DAY + 9.0, 3 * DAY + 8.0),
        (StreamClock("arrival", error=0.05), 10.0, 777.25, 777.25),
    ],
)
def test_a_fix_comes_to_the_day_of_the_samples(clock, day_time, near, expected):
    assert clock.on_record(day_time, near) == expected


def test_the_error_of_an_arrival_widens_what_moves():
    clock = StreamClock("arrival", error=0.1)
    row = np.array([5.0, 0.7, 0.2, 100.0, 3.0, 3.0, 3.0, 0.0, 40.0, 0.0, 0.1, 0.1, 0.5, 1.0])
    before = row.copy()
    before[0], before[8] = 4.0, 38.0
    out = clock.widened(row, before)
    np.testing.assert_allclose(out[4:7], [3.0, 5.0, 3.0])
    np.testing.assert_allclose(out[10:13], [0.1, np.hypot(0.1, 0.2), 0.5])
    np.testing.assert_array_equal(StreamClock("utc").widened(row, before), row)


@pytest.mark.parametrize(
    ("kind", "numbers", "text"),
    [
        ("local", {}, "got 'local'"),
        ("gps", {}, "leap seconds"),
        ("utc", {"leap_seconds": 18.0}, "leap seconds"),
        ("gps", {"leap_seconds": 90.0}, "0 to 60"),
        ("arrival", {}, "error of the arrival"),
        ("arrival", {"error": 5.0}, "at most 2"),
        ("utc", {"error": 0.1}, "and with no other"),
    ],
)
def test_what_is_not_said_is_not_guessed(kind, numbers, text):
    with pytest.raises(InputError, match=text):
        StreamClock(kind, **numbers)
