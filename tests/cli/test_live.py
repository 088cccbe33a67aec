"""Live alignment over loopback: dropped, repeated and shuffled packets, checkpoints, pipes."""

from __future__ import annotations

import json
import os
import pty
import signal
import socket
import subprocess
import sys
import time
from contextlib import closing
from http.client import HTTPConnection

import numpy as np
import pytest

from schuler.alignment import LiveAligner, align, parse_method
from schuler.alignment.live import fill
from schuler.earth import Site
from schuler.errors import InputError
from schuler.io.packets import encode_csv, encode_frame
from schuler.motion import DisturbedVehicle
from schuler.prefilter import parse_prefilter
from schuler.sensors import GRADES
from schuler.simulation import simulate

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
        # A test that runs in the background would ignore Ctrl-C, and so would its children.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip


def listening(process):
    """Wait until the command listens; return where."""
    for line in process.stderr:
        if line.startswith(b"note: listening on udp:"):
            host, _, port = line.decode().split("udp:")[1].strip().rpartition(":")
            return host, int(port)
    raise AssertionError(f"ended with {process.wait()}")


def last_line(out):
    return json.loads(out.decode().splitlines()[-1])


@pytest.mark.slow
def test_udp_with_a_bad_line_and_a_flood(record):
    """5 % dropped, repeated, shuffled each, and as many datagrams of others, the first ones too."""
    process = start("udp:0", "--lat", "50", "--spec", "navigation-rlg", "--json",
                    "--idle", "5", "--every", "0.2", "--method", "centred")  # fmt: skip
    where = listening(process)
    packets = shaken(samples(record), np.random.default_rng(1))
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
    ):
        other.sendto(b"hello", where)
        for k, item in enumerate(packets):
            sender.sendto(encode_frame(*item, "increments"), where)
            noise = encode_frame(k * 977, 1e3 * (k % 13), [0.0] * 6, "increments")
            other.sendto(noise if k % 2 else noise[:50], where)
            if k % 40 == 0:
                time.sleep(0.01)
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err.decode()
    lines = [json.loads(line) for line in out.decode().splitlines()]
    assert len(lines) >= 2
    last = lines[-1]
    assert last["schema"] == "schuler.live/1"
    counts = last["counts"]
    assert counts["repeated"] + counts["late"] > 100
    assert counts["lost"] > 100
    assert counts["foreign"] > 1000
    assert counts["malformed"] > 1000
    assert last["contradictions"] == []
    whole = align(record, SITE, "centred", "navigation-rlg")
    off = abs(last["heading_deg"] - whole.heading_deg) * 60
    # Interpolated samples leave some noise of their own; sigma says so.
    assert off < 3 * last["sigma_arcmin"]["up"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_with_the_result(record, number):
    process = start("-", "--lat", "50", "--every", "0.1", "--json")
    data = b"".join(encode_csv(*s) for s in samples(record))
    process.stdin.write(data)
    process.stdin.flush()
    first = process.stdout.readline()
    process.send_signal(number)
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err.decode()
    assert json.loads(first)["schema"] == "schuler.live/1"
    assert last_line(out)["heading_deg"] == pytest.approx(75.0, abs=0.5)
    assert b"Traceback" not in err


def test_a_killed_session_is_resumed(record, tmp_path):
    path = tmp_path / "north.npz"
    arguments = ("-", "--lat", "50", "--every", "0.05", "--json", "--checkpoint", str(path))
    frames = [encode_frame(*s, "increments") for s in samples(record)]
    process = start(*arguments)
    process.stdin.write(b"".join(frames[:4000]))
    process.stdin.flush()
    process.stdout.readline()
    deadline = time.monotonic() + 60.0
    while not path.exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    process.kill()
    process.communicate(timeout=300)
    assert process.returncode == -signal.SIGKILL
    again = start(*arguments)
    # The sender repeats what it still has.
    out, err = again.communicate(b"".join(frames[300:]), timeout=300)
    assert again.returncode == 0, err.decode()
    assert b"note: resumed from" in err
    last = last_line(out)
    assert (last["counts"]["aligned"], last["spans"]) == (6000, 1)
    through = start("-", "--lat", "50", "--json")
    out, _ = through.communicate(b"".join(frames), timeout=300)
    assert last_line(out)["heading_deg"] == last["heading_deg"]


def test_a_checkpoint_s_folder_that_vanishes_ends_nothing(record, tmp_path):
    folder = tmp_path / "state"
    folder.mkdir()
    process = start("-", "--lat", "50", "--every", "0.05", "--json",
                    "--checkpoint", str(folder / "north.npz"))  # fmt: skip
    data = b"".join(encode_csv(*s) for s in samples(record))
    process.stdin.write(data[: len(data) // 2])
    process.stdin.flush()
    process.stdout.readline()
    moved = folder.rename(tmp_path / "elsewhere")
    for _ in range(2):
        process.stdout.readline()
    out, err = process.communicate(data[len(data) // 2 :], timeout=300)
    assert process.returncode == 0, err.decode()
    assert err.decode().count("the state is not saved") == 1
    assert last_line(out)["counts"]["aligned"] == 6000
    assert not folder.exists()
    assert [p.name for p in moved.iterdir()] in ([], ["north.npz"])


def test_a_result_that_a_later_span_contradicts_is_said(record):
    turned = [(n, t, (v[1], -v[0], v[2], v[4], -v[3], v[5])) for n, t, v in samples(record)]
    data = b"".join(encode_csv(*s) for s in [*samples(record), *turned[:4000]])
    process = start("-", "--lat", "50", "--spec", "navigation-rlg")
    out, err = process.communicate(data, timeout=300)
    assert process.returncode == 3, err.decode()
    assert "span 1 of 2, 0 s to 120 s" in out.decode(), out.decode()
    assert b"note: the sender restarted, at number 0; span 2 begins" in err
    assert b"sigma apart" in err


def test_what_came_and_was_no_use_is_said_by_reason(record):
    frames = [encode_frame(*s, "increments", key=b"a" * 16, run=1) for s in samples(record)[:90]]
    process = start("-", "--lat", "50")
    out, err = process.communicate(b"".join(frames) + b"\nhello\n1,2\n", timeout=300)
    assert process.returncode == 2
    assert out == b""
    assert err.decode() == (
        "schuler: standard input: no sample could be used of those that came: 2 that are no "
        "sample, 90 with a tag, and no key to check it (--key-file)\n"
    )


def test_keyed_frames_in_a_pipe(record, tmp_path):
    key = tmp_path / "imu.key"
    key.write_text("a secret of the two of us\n")
    secret = b"a secret of the two of us"
    data = b"".join(
        encode_frame(*s, "increments", key=secret, run=7) + encode_frame(*s, "increments")
        for s in samples(record)
    )
    process = start("-", "--lat", "50", "--json", "--key-file", str(key))
    out, err = process.communicate(data, timeout=300)
    assert process.returncode == 0, err.decode()
    counts = last_line(out)["counts"]
    assert (counts["aligned"], counts["unauthenticated"]) == (6000, 6000)


def test_a_refused_checkpoint_and_a_cold_start(record, tmp_path):
    path = tmp_path / "north.npz"
    path.write_bytes(b"my own data")
    data = b"".join(encode_csv(*s) for s in samples(record))
    arguments = ("-", "--lat", "50", "--checkpoint", str(path))
    process = start(*arguments)
    out, err = process.communicate(data, timeout=300)
    assert (process.returncode, out) == (2, b"")
    assert path.read_bytes() == b"my own data"
    assert b"--cold-start" in err
    process = start(*arguments, "--cold-start")
    out, err = process.communicate(data, timeout=300)
    assert process.returncode == 0, err.decode()
    assert (tmp_path / "north.npz.refused").read_bytes() == b"my own data"
    assert path.read_bytes()[:2] == b"PK"


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
    out, err = process.communicate(data, timeout=300)
    assert process.returncode == 0, err.decode()
    last = json.loads(out.decode().splitlines()[-1])
    assert last["counts"]["damaged"] == 0
    assert last["heading_deg"] == pytest.approx(75.0, abs=0.5)


def test_a_serial_port(record):
    pytest.importorskip("serial")
    ours, theirs = pty.openpty()
    import tty

    tty.setraw(theirs)
    process = start(f"serial:{os.ttyname(theirs)}", "--lat", "50", "--idle", "2", "--json")
    assert b"listening on serial:" in process.stderr.readline()
    os.set_blocking(ours, False)
    data = b"".join(encode_frame(*item, "increments") for item in samples(record)[:3000])
    deadline = time.monotonic() + 30.0
    while data and time.monotonic() < deadline and process.poll() is None:
        try:
            data = data[os.write(ours, data) :]
        except BlockingIOError:
            time.sleep(0.005)
    assert not data, "the port was not read"
    out, err = process.communicate(timeout=300)
    os.close(ours)
    os.close(theirs)
    assert process.returncode == 0, err.decode()
    assert json.loads(out.decode().splitlines()[-1])["counts"]["aligned"] == 3000


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["udp:5005"], "--lat"), (["tcp:5005", "--lat", "5"], "live source"),
        (["udp:x", "--lat", "5"], "port"), (["udp:99999999999", "--lat", "5"], "port"),
        (["udp:no such host:5", "--lat", "5"], "cannot listen"),
        (["-", "--lat", "5", "--method", "kalman-huge"], "unknown method"),
        (["serial:/nowhere", "--lat", "5"], "cannot be opened"),
        (["-", "--lat", "5", "--every", "0"], "above 0 s"),
        (["-", "--lat", "5", "--idle", "-1"], "above 0 s"),
        (["-", "--lat", "5", "--max-gap", "0"], "above 0 s"),
        (["-", "--lat", "5", "--depth", "1"], "4"),
        (["-", "--lat", "5", "--depth", "5000"], "4096"),
        (["-", "--lat", "5", "--from", "192.0.2.1"], "only udp"),
        (["udp:0", "--lat", "5", "--from", "192.0.2"], "IPv4"),
        (["udp:0", "--lat", "5", "--from", "192.0.2.1:0"], "IPv4"),
        (["-", "--lat", "5", "--key-file", "/nowhere"], "cannot be read"),
        (["-", "--lat", "5", "--cold-start"], "--checkpoint"),
    ],
)  # fmt: skip
def test_bad_input(run, arguments, text):
    if arguments[0] == "serial:/nowhere":
        pytest.importorskip("serial")
    done = run("live", *arguments)
    assert done.code == 2
    assert done.out == ""
    assert text in done.err
    assert done.err.count("\n") == 1


@pytest.mark.parametrize("size", [0, 15, 5000])
def test_a_key_that_is_too_short_or_long_is_refused(run, tmp_path, size):
    path = tmp_path / "imu.key"
    path.write_bytes(b"k" * size)
    done = run("live", "-", "--lat", "5", "--key-file", path)
    assert done.code == 2
    assert "16 to 4096 bytes" in done.err


def test_a_key_is_no_checkpoint(run, tmp_path):
    path = tmp_path / "imu.key"
    path.write_bytes(b"k" * 32)
    done = run("live", "-", "--lat", "5", "--key-file", path, "--checkpoint", path, "--cold-start")
    assert done.code == 2
    assert "replaces an input" in done.err
    assert path.read_bytes() == b"k" * 32


def piped(lines, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "schuler", "live", "-", *arguments], input=lines,
        capture_output=True, text=True,
    )  # fmt: skip


def test_a_prefilter_in_blocks_and_one_of_the_whole_record(record):
    """The command takes the first and refuses the second in a sentence."""
    lines = "".join(
        f"{k},{t!r},{','.join(map(repr, v))}\n" for k, t, v in samples(record)[: 40 * int(RATE)]
    )
    blocks = "emd-velocity(block=20 s, overlap=5 s)"
    options = ["--lat", "50", "--spec", "navigation-rlg", "--method", "centred"]
    done = piped(lines, *options, "--prefilter", blocks, "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    ours = align(
        record.rows(0, 40 * int(RATE)), SITE,
        parse_method("centred").with_prefilter(parse_prefilter(blocks)), "navigation-rlg",
    )  # fmt: skip
    assert found["heading_deg"] == pytest.approx(ours.heading_deg, abs=1e-3)
    assert found["method"]["options"]["prefilter"]["name"] == "emd-velocity"
    done = piped(lines, *options, "--prefilter", "wavelet")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "the prefilter wavelet needs the whole record" in done.stderr


def events(where, path="/events"):
    """Give the states that a page's server sends, until it ends."""
    with closing(HTTPConnection(where, timeout=60)) as connection:
        connection.request("GET", path)
        answer = connection.getresponse()
        assert answer.status == 200
        for line in answer:
            if line.startswith(b"data: "):
                yield json.loads(line[6:])


def page_address(process):
    """Wait until the command says where its page is; return host and port."""
    for line in process.stderr:
        if line.startswith(b"note: the page is http://"):
            return line.decode().split("http://")[1].partition("/")[0]
    raise AssertionError(f"ended with {process.wait()}")


def test_a_page_shows_what_is_aligned(record):
    options = ("--lat", "50", "--spec", "navigation-rlg", "--every", "0.05", "--page")
    with start("-", *options) as process:
        states = events(page_address(process))
        assert next(states)["phase"] == "waiting"
        process.stdin.write(b"".join(encode_csv(*s) for s in samples(record)))
        process.stdin.flush()
        while (state := next(states))["phase"] == "waiting":
            pass
        assert state["phase"] == "aligning"
        assert state["source"] == "standard input"
        process.stdin.close()
        *_, last = states
        out = process.stdout.read()
    assert process.returncode == 0
    assert last["phase"] == "ended"
    assert float(last["heading"]["value"].rstrip("°")) == pytest.approx(75.0, abs=0.5)
    assert last["counts"][0] == [6000, "aligned"]
    assert out.startswith(b"heading 7")


def test_a_page_says_that_nothing_usable_came():
    with start("-", "--lat", "50", "--page", "0") as process:
        states = events(page_address(process))
        next(states)
        process.stdin.write(b"hello\n")
        process.stdin.close()
        *_, last = states
    assert process.returncode == 2
    assert last["phase"] == "failed"
    assert "1 that are no sample" in last["end"]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["-", "--page", "0.0.0.0:0"], "--page-key-file"), (["--page", "udp:5005", "-"], "source"),
        (["-", "--page-key-file", "x.key"], "say --page"),
        (["-", "--page", "0.0.0.0:0", "--page-key-file", "/nowhere"], "cannot be read"),
    ],
)  # fmt: skip
def test_pages_that_are_refused(run, arguments, text):
    done = run("live", *arguments, "--lat", "5")
    assert (done.code, done.out) == (2, "")
    assert text in done.err
    assert done.err.count("\n") == 1
