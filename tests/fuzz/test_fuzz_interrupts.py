"""Writing commands that are killed, interrupted or run out of disk: the old file or the new one.

``SCHULER_FUZZ_SCALE`` multiplies the number of moments (`make fuzz` sets it).
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from tests.conftest import LONG

resource = pytest.importorskip("resource")

SCALE = float(os.environ.get("SCHULER_FUZZ_SCALE", "1"))
MOMENTS = max(1, int(SCALE))
SIGNALS = (signal.SIGINT, signal.SIGKILL, signal.SIGTERM)

SPEC = """[gyro]
bias = "0.01 deg/h"
angle_random_walk = "0.003 deg/sqrt(h)"
[accelerometer]
bias = "50 ug"
velocity_random_walk = "10 ug/sqrt(Hz)"
"""
SCENE = """duration = "20 s"
rate = "50 Hz"
instrument = "spec.toml"
[site]
lat = 40.0
[motion]
kind = "static"
heading = 30
"""

#: words, and what they write
COMMANDS = {
    "align": ("align ok.parquet --lat 40 --json a.json --report a.html", ("a.json", "a.html")),
    "mapping": ("info plain.csv --axes RFU --save-mapping", ("plain.csv.toml",)),
    "allan": ("allan ok.parquet --save-spec s.toml --json s.json", ("s.toml", "s.json")),
    "simulate": ("simulate scene.toml --out m.csv --truth m.parquet", ("m.csv", "m.parquet")),
    "navigate": ("navigate ok.parquet --lat 40 --heading 30 --out p.parquet", ("p.parquet",)),
    "rotation": ("rotation optimise --turns 4 --tries 3 --out r.toml", ("r.toml",)),
    "array": ("array symmetric4 --json g.json --report g.html", ("g.json", "g.html")),
    "campaign": (
        "campaign scene.toml --runs 4 --workers 0 --method centred --out c --json c.json",
        ("c/results.parquet", "c.json"),
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Make a folder with a record and a scenario."""
    import schuler as sc
    from schuler.motion import Static
    from schuler.sensors import GRADES
    from schuler.simulation import simulate

    folder = tmp_path_factory.mktemp("bench")
    rng = np.random.default_rng(1)
    made = simulate(Static(30.0), sc.Site(40.0), 20.0, 50.0, GRADES["navigation-fog"], rng)
    rows = np.column_stack([made.record.time, made.record.dtheta * 50.0, made.record.dvel * 50.0])
    np.savetxt(folder / "plain.csv", rows, "%.17g", ",", header="t,gx,gy,gz,ax,ay,az", comments="")
    sc.write(made.record, folder / "ok.parquet")
    (folder / "spec.toml").write_text(SPEC)
    (folder / "scene.toml").write_text(SCENE)
    return folder


def start(words, folder, **settings):
    """Start a command, without the measuring of coverage, which writes files of its own."""
    plain = {k: v for k, v in os.environ.items() if not k.startswith("COV")}
    # In the background Ctrl-C is ignored, and by children too.
    settings.setdefault("preexec_fn", lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    return subprocess.Popen(
        [sys.executable, "-m", "schuler", *words.split()], cwd=folder, env=plain,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, **settings,
    )  # fmt: skip


def contents(folder, names):
    """Return the bytes of files, None where one is not there."""
    return {n: (folder / n).read_bytes() if (folder / n).exists() else None for n in names}


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("name", COMMANDS if SCALE > 1 or LONG else ["align"])
def test_a_killed_command_leaves_the_old_file_or_the_new_one(name, bench):
    words, outputs = COMMANDS[name]
    start(words, bench).communicate(timeout=120)
    begun = time.monotonic()
    for path in outputs:
        (bench / path).unlink()
    done = start(words, bench)
    _, err = done.communicate(timeout=120)
    took = time.monotonic() - begun
    assert done.returncode == 0, err
    new = contents(bench, outputs)
    before = {path.name for path in bench.rglob("*")}
    rng = np.random.default_rng(len(name))
    old = dict.fromkeys(outputs, b"# old\n")
    for k in range(MOMENTS):
        for path in outputs:
            # A campaign's results count as finished only where they are its own.
            (bench / path).write_bytes(b"# old\n")
        process = start(words, bench)
        time.sleep(rng.uniform(0.1, 1.0) * took)
        process.send_signal(SIGNALS[k % len(SIGNALS)])
        _, err = process.communicate(timeout=60)
        assert "Traceback" not in err
        found = contents(bench, outputs)
        for path in outputs:
            assert found[path] in (old[path], new[path]), f"{path} is neither old nor new"
    done = start(words, bench)
    _, err = done.communicate(timeout=120)
    assert done.returncode == 0, err
    assert contents(bench, outputs) == new
    left = {path.name for path in bench.rglob("*")} - before
    assert not left, f"left behind: {left}"


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize(
    "name", ["align", "simulate", "navigate", "allan"][: 4 if SCALE > 1 else 2]
)
def test_a_full_disk_leaves_the_old_file(name, bench):
    words, outputs = COMMANDS[name]
    for path in outputs:
        (bench / path).write_bytes(b"# old\n")

    def small_files():
        resource.setrlimit(resource.RLIMIT_FSIZE, (600, 600))

    process = start(words, bench, preexec_fn=small_files)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 2, err
    assert "cannot be written" in err
    assert "Traceback" not in err
    for path in outputs:
        assert len((bench / path).read_bytes()) <= 600
    assert b"# old\n" in contents(bench, outputs).values()
    assert not list(bench.rglob("*.part"))
