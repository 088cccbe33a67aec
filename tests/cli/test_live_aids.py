"""``schuler live --gnss``: samples and NMEA over loopback UDP, and both in one pipe."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
import time

import numpy as np
import pytest

from tests.alignment.moving.nmea_tools import UTC_DAY, frames, in_turn, sentences
from tests.alignment.moving.routes import car, fixes, noisy, truth_of

pytestmark = pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")


@pytest.fixture(scope="module")
def drive():
    made, rng = truth_of(car(), 40.0, 50.0), np.random.default_rng(2)
    gnss = fixes(made, rng=rng)
    return made, noisy(made, "tactical-fog", rng), gnss


def start(*arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "schuler", "live", *arguments, "--spec", "tactical-fog", "--json"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def listening(process):
    """Wait until the command listens; return where, of samples and of sentences."""
    for line in process.stderr:
        if line.startswith(b"note: listening on udp:"):
            where = re.findall(r"udp:([\d.]+):(\d+)", line.decode())
            return [(host, int(port)) for host, port in where]
    raise AssertionError(f"ended with {process.wait()}")


def lines_of(out):
    return [json.loads(line) for line in out.decode().splitlines()]


def test_samples_and_sentences_by_udp(drive):
    """Two senders, one with damaged sentences: the heading is found, and what was lost is said."""
    made, record, gnss = drive
    process = start(
        "udp:0", "--gnss", "udp:0", "--imu-time", "utc", "--idle", "1.5", "--every", "0.3"
    )  # fmt: skip
    imu, nmea = listening(process)
    damaged = b"$GPGGA,000001.00,4000.0,N*11\r\n"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for k, (second, data) in enumerate(
            in_turn(frames(record, UTC_DAY), sentences(gnss, UTC_DAY))
        ):
            sender.sendto(data, nmea if second else imu)
            if second:
                sender.sendto(damaged, nmea)
            if k % 20 == 0:
                time.sleep(0.01)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err.decode()
    last = lines_of(out)[-1]
    assert last["schema"] == "schuler.live/1"
    assert last["counts"]["aligned"] == len(record)
    assert last["aid_counts"]["fixes"] == len(gnss)
    assert last["aid_counts"]["aid_checksum"] == len(gnss)
    assert set(last["aids"]["used"]) == {"gnss", "gnss_velocity"}
    true = np.degrees(np.arctan2(*_forward(made)[:2]))
    off = (last["heading_deg"] - true + 180.0) % 360.0 - 180.0
    assert abs(60.0 * off) < 4.0 * last["heading_sigma_arcmin"]


def _forward(made):
    from schuler.attitude import quat_to_matrix

    return quat_to_matrix(made.truth.quat_nb[-1])[:, 1]


def test_both_in_one_pipe(drive):
    """Frames and sentences mixed: the last line is the alignment of the same in memory."""
    from schuler.aiding.stream_clock import StreamClock
    from schuler.alignment.moving.live import LiveAids, MovingLiveSession
    from schuler.alignment.moving.stream_setting import StreamSetting

    _, record, gnss = drive
    items = in_turn(frames(record, UTC_DAY), sentences(gnss, UTC_DAY))
    process = start("-", "--gnss", "-", "--imu-time", "utc")
    out, err = process.communicate(b"".join(data for _, data in items), timeout=120)
    assert process.returncode == 0, err.decode()
    session = MovingLiveSession(LiveAids(StreamClock("utc"), StreamSetting("tactical-fog")))
    for second, data in items:
        (session.feed_aid if second else session.feed)(data)
    expected = session.finish().best.alignment.to_dict()
    last = lines_of(out)[-1]
    del expected["schema"], last["schema"]
    assert {key: last[key] for key in expected} == expected


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--gnss", "udp:0"), "say what the samples' times are"),
        (("--gnss", "udp:0", "--imu-time", "gps"), "leap seconds"),
        (("--gnss", "udp:0", "--imu-time", "arrival"), "error of the arrival"),
        (("--gnss", "udp:0", "--imu-time", "utc", "--lat", "40"), "--lat is of an alignment"),
        (("--gnss", "sky:7", "--imu-time", "utc"), "a live source is"),
        (("--lat", "40", "--keep", "100s"), "say --gnss"),
        (("--gnss", "udp:0", "--imu-time", "utc", "--estimate", "scale"), "takes delay and lever"),
    ],
)  # fmt: skip
def test_bad_input(run, arguments, text):
    ran = run("live", "udp:0", *arguments)
    assert ran.code == 2
    assert text in ran.err
    assert "Traceback" not in ran.err


def test_steady_and_straight_is_said():
    """No acceleration: no heading, and what is missing."""
    from schuler.motion import Route

    made = truth_of(Route([], heading=40.0, speed=15.0), 20.0, 50.0)
    record = noisy(made, "tactical-fog", np.random.default_rng(1))
    items = in_turn(frames(record, UTC_DAY), sentences(fixes(made), UTC_DAY))
    process = start("-", "--gnss", "-", "--imu-time", "utc")
    _, err = process.communicate(b"".join(data for _, data in items), timeout=120)
    assert process.returncode == 2
    assert "brake or turn" in err.decode()


def test_a_contradiction_comes_first_and_in_json(drive):
    """Fixes that are said to be forty times better than they are."""
    _, record, gnss = drive
    items = in_turn(frames(record, UTC_DAY), sentences(gnss, UTC_DAY))
    process = start("-", "--gnss", "-", "--imu-time", "utc", "--gnss-sigma", "0.001,0.005",
                    "--vibration", "0")  # fmt: skip
    out, err = process.communicate(b"".join(data for _, data in items), timeout=120)
    assert process.returncode == 3, err.decode()
    last = lines_of(out)[-1]
    assert any("times their sigma" in text or "refused" in text for text in last["contradictions"])


def test_the_page_says_what_became_of_the_fixes(drive):
    from schuler.aiding.stream_clock import StreamClock
    from schuler.alignment import LiveAids, MovingLiveSession, StreamSetting
    from schuler.cli.live_aids import aid_counts
    from schuler.reports.live_page import LivePage

    _, record, gnss = drive
    session = MovingLiveSession(LiveAids(StreamClock("utc"), StreamSetting("tactical-fog")))
    for second, data in in_turn(frames(record, UTC_DAY)[:500], sentences(gnss, UTC_DAY)[:8]):
        (session.feed_aid if second else session.feed)(data)
    page = LivePage("-")
    page.update(None, session.counts(), **aid_counts(session))
    assert [8, "taken"] in page.state["fixes"]
    said = [text for _, text in page.state["fixes"]]
    assert "sentences with a wrong checksum" not in said
