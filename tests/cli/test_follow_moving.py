"""``schuler align --follow --gnss``: a record and its fixes, both of which grow."""

from __future__ import annotations

import subprocess
import sys
import time

import numpy as np
import pytest

from schuler.constants import DEG
from tests.alignment.moving.routes import car, fixes, noisy, truth_of

from .conftest import found

IMU = "time [s],gx [rad/s],gy [rad/s],gz [rad/s],ax [m/s^2],ay [m/s^2],az [m/s^2]"
GNSS = "time [s],lat [deg],lon [deg],height [m],ve [m/s],vn [m/s],vu [m/s]"


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    made, rng = truth_of(car(), 40.0, 50.0), np.random.default_rng(2)
    gnss, record = fixes(made, rng=rng), noisy(made, "tactical-fog", rng)
    folder = tmp_path_factory.mktemp("drive")
    rates = np.hstack([record.time[:, None], record.gyro, record.accel])
    np.savetxt(folder / "imu.csv", rates, "%.12g", ",", header=IMU, comments="")
    rows = np.column_stack([gnss.time, gnss.lat / DEG, gnss.lon / DEG, gnss.height, gnss.v_n])
    np.savetxt(folder / "gnss.csv", rows, "%.11g", ",", header=GNSS, comments="")
    return folder / "imu.csv", folder / "gnss.csv"


def test_files_that_do_not_grow(run, files):
    imu, gnss = files
    whole = run("align", imu, "--gnss", gnss, "--spec", "tactical-fog", "--json", "-")
    ran = run("align", imu, "--gnss", gnss, "--spec", "tactical-fog", "--follow", "--idle", "0.1s",
              "--json", "-")  # fmt: skip
    assert ran.code == 0
    assert found(ran.out) == found(whole.out)
    assert any("± " in line for line in ran.err.splitlines())


def test_both_grow(run, files, tmp_path):
    """Pieces that end anywhere, the fixes after their samples: the result is that of the files."""
    texts = [path.read_text() for path in files]
    paths = [tmp_path / path.name for path in files]
    for path in paths:
        path.touch()
    heads = [texts[0].index("\n") + 30, texts[1].index("\n") + 30]
    for path, text, head in zip(paths, texts, heads, strict=True):
        path.write_text(text[:head])
    out = tmp_path / "live.json"
    with subprocess.Popen(
        [sys.executable, "-W", "error", "-m", "schuler", "align", paths[0], "--gnss", paths[1],
         "--spec", "tactical-fog", "--follow", "--latency", "30s", "--idle", "1.5s", "--json", out],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        for begin, end in ((0.0, 0.3), (0.3, 0.61), (0.61, 1.0)):
            for path, text, head in zip(paths, texts, heads, strict=True):
                first, last = (head + int(part * (len(text) - head)) for part in (begin, end))
                with path.open("a") as file:
                    file.write(text[first:last])
                time.sleep(0.15)
        _, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    whole = run("align", *(files[0], "--gnss", files[1]), "--spec", "tactical-fog", "--json", "-")
    one, other = found(out.read_text()), found(whole.out)
    assert one == other


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--follow", "--at", "start"), "attitude at the end"),
        (("--follow", "--zupt"), "for --gnss alone, got --zupt"),
        (("--latency", "3s"), "--latency goes with --follow"),
        (("--follow", "--estimate", "scale"), "takes delay and lever"),
        (("--follow", "--windows", "10s"), "leave out --windows"),
    ],
)
def test_bad_input(run, files, arguments, text):
    ran = run("align", files[0], "--gnss", files[1], "--spec", "tactical-fog", *arguments)
    assert ran.code == 2
    assert text in ran.err


def test_fixes_that_never_come(run, files, tmp_path):
    path = tmp_path / "gnss.csv"
    path.write_text(GNSS + "\n")
    ran = run("align", files[0], "--gnss", path, "--spec", "tactical-fog", "--follow", "--idle",
              "0.1s")  # fmt: skip
    assert ran.code == 2
    assert str(path) in ran.err
    assert "Traceback" not in ran.err
