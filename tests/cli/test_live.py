"""Live alignment over loopback: dropped, repeated and shuffled packets, checkpoints, pipes."""

from __future__ import annotations

import json
import os
import pty
import socket
import subprocess
import sys
import time

import numpy as np
import pytest

from schuler.align import LiveAligner, align
from schuler.align.live import fill
from schuler.earth import Site
from schuler.errors import InputError
from schuler.io.packets import encode_csv, encode_frame
from schuler.motion import DisturbedVehicle
from schuler.sensors import GRADES
from schuler.simulate import simulate

SITE = Site(50.0)
RATE = 50.0


@pytest.fixture(scope="module")
def record():
    rng = np.random.default_rng(3)
    truck = DisturbedVehicle.draw(rng, 120.0, heading=75.0)
    return simulate(truck, SITE, 120.0, RATE, GRADES["navigation-rlg"], rng).record


def samples(record):
    values = np.hstack([record.dtheta, record.dvel])
    return [
        (k, float(t), tuple(map(float, v)))
        for k, (t, v) in enumerate(zip(record.time, values, strict=True))
    ]


def shaken(items, rng):
    """Drop, repeat and shuffle 5 % each."""
    out = []
    for item in items:
        u = rng.random()
        if u < 0.05:
            continue
        out += [item, item] if u < 0.10 else [item]
    for k in range(len(out) - 4):
        if rng.random() < 0.05:
            j = k + int(rng.integers(1, 4))
            out[k], out[j] = out[j], out[k]
    return out


def start(*arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "schuler", "live", *arguments], stdin=subprocess.PIPE,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


@pytest.mark.slow
def test_udp_with_a_bad_line(record):
    """5 % dropped, 5 % repeated, 5 % shuffled: the heading is that of the whole record."""
    port = free_port()
    process = start(f"udp:{port}", "--lat", "50", "--spec", "navigation-rlg", "--json",
                    "--idle", "5", "--every", "0.2", "--method", "centred")  # fmt: skip
    packets = shaken(samples(record), np.random.default_rng(1))
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    time.sleep(2.5)
    for k, item in enumerate(packets):
        sender.sendto(encode_frame(*item, "increments"), ("127.0.0.1", port))
        if k % 50 == 0:
            time.sleep(0.01)
    sender.close()
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err.decode()
    lines = [json.loads(line) for line in out.decode().splitlines()]
    assert len(lines) >= 2
    last = lines[-1]
    assert last["schema"] == "schuler.live/1"
    assert last["counts"]["repeated"] + last["counts"]["late"] > 100
    assert last["counts"]["lost"] > 100
    whole = align(record, SITE, "centred", "navigation-rlg")
    off = abs(last["heading_deg"] - whole.heading_deg) * 60
    # Interpolated samples leave some noise of their own; sigma says so.
    assert off < 3 * last["sigma_arcmin"]["up"]


def test_a_clean_stream_gives_the_record_s_own_bits(record):
    live = LiveAligner(SITE, "increments", "centred", "navigation-rlg")
    for item in samples(record):
        live.push([item])
    live.finish()
    assert live.solution().heading_deg == pytest.approx(
        align(record, SITE, "centred", "navigation-rlg").heading_deg, abs=1e-7
    )
    assert live.counts()["lost"] == 0


def test_a_checkpoint_goes_on_as_if_nothing_had_been(record, tmp_path):
    packets = shaken(samples(record), np.random.default_rng(2))
    path = tmp_path / "state.npz"

    def make():
        return LiveAligner(SITE, "increments", "centred", "navigation-rlg")

    through, first = make(), make()
    through.push(packets)
    at = 0
    for cut in (100, 2000, 2001, len(packets)):
        first.push(packets[at:cut])
        first.save(path)
        first = make()
        first.load(path)
        at = cut
    through.finish()
    first.finish()
    assert first.solution().heading_deg == through.solution().heading_deg
    assert first.counts() == through.counts()


def test_a_checkpoint_of_another_alignment_is_refused(record, tmp_path):
    path = tmp_path / "state.npz"
    live = LiveAligner(SITE, "increments", "centred", "navigation-rlg")
    live.push(samples(record)[:1000])
    live.save(path)
    with pytest.raises(InputError, match="site"):
        LiveAligner(Site(51.0), "increments", "centred", "navigation-rlg").load(path)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(InputError, match="saved state"):
        LiveAligner(SITE, "increments", "centred", "navigation-rlg").load(path)


def test_losses_are_filled_by_a_quintic():
    def curve(k):
        return k, 0.1 * k, tuple(float(k**5 - 2 * k**2 + c) for c in range(6))

    known = [curve(k) for k in range(20) if k not in (7, 8, 13)]
    np.testing.assert_allclose(
        [[s[1], *s[2]] for s in fill([], known)], [[curve(k)[1], *curve(k)[2]] for k in range(20)],
        rtol=1e-9, atol=1e-9,
    )  # fmt: skip
    assert [s[0] for s in fill(known[:3], known[3:])] == list(range(3, 20))
    far = [curve(0), curve(1), curve(40)]
    assert fill([], far) == far


def test_csv_by_a_pipe(record):
    process = start("-", "--lat", "50", "--kind", "increments", "--json")
    data = b"# number, time, ...\n" + b"".join(encode_csv(*s) for s in samples(record))
    out, err = process.communicate(data, timeout=60)
    assert process.returncode == 0, err.decode()
    last = json.loads(out.decode().splitlines()[-1])
    assert last["counts"]["damaged"] == 0
    assert last["heading_deg"] == pytest.approx(75.0, abs=0.5)


def test_a_serial_port(record):
    pytest.importorskip("serial")
    ours, theirs = pty.openpty()
    import tty

    tty.setraw(theirs)
    process = start(f"serial:{os.ttyname(theirs)}", "--lat", "50", "--idle", "5", "--json")
    time.sleep(2.0)
    os.set_blocking(ours, False)
    data = b"".join(encode_frame(*item, "increments") for item in samples(record)[:3000])
    deadline = time.monotonic() + 30.0
    while data and time.monotonic() < deadline and process.poll() is None:
        try:
            data = data[os.write(ours, data) :]
        except BlockingIOError:
            time.sleep(0.005)
    assert not data, "the port was not read"
    out, err = process.communicate(timeout=60)
    os.close(ours)
    os.close(theirs)
    assert process.returncode == 0, err.decode()
    assert json.loads(out.decode().splitlines()[-1])["counts"]["aligned"] == 3000


@pytest.mark.parametrize(
    ("arguments", "text"),
    [(["udp:5005"], "--lat"), (["tcp:5005", "--lat", "5"], "live source"),
     (["udp:x", "--lat", "5"], "port"), (["-", "--lat", "5", "--method", "kalman"], "whole record"),
     (["serial:/nowhere", "--lat", "5"], "cannot be opened"),
     (["-", "--lat", "5", "--every", "0"], "above 0 s"),
     (["-", "--lat", "5", "--depth", "1"], "from 4 to")],
)  # fmt: skip
def test_bad_input(arguments, text, record):
    process = start(*arguments)
    data = b"".join(encode_csv(*s) for s in samples(record)[:300])
    out, err = process.communicate(data, timeout=60)
    assert process.returncode == 2
    assert out == b""
    assert text in err.decode()
    assert err.decode().count("\n") == 1
