"""Random command lines: an answer or one sentence, in bounded time, and no input is lost.

``SCHULER_FUZZ_SCALE`` multiplies the number of lines (`make fuzz` sets it).
"""

from __future__ import annotations

import hashlib
import json
import os
import select
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import click
import numpy as np
import pytest

from schuler.cli import _COMMANDS
from schuler.cli.many import SOME_FAILED
from schuler.cli.parameters import Count, InputFile, Number, OutputFile, Seconds

pytest.importorskip("resource")

SCALE = float(os.environ.get("SCHULER_FUZZ_SCALE", "1"))
LINES = int(100 * SCALE) if SCALE > 1 else 30
DEADLINE = float(os.environ.get("SCHULER_FUZZ_DEADLINE", "120"))
"""s; a quiet machine with compiled kernels keeps to 10."""

MEMORY_KB = 600_000

HOSTILE = (
    "", " ", "nonsense", "a\0b".replace("\0", "%00"), "\x1b[31mred", "x" * 4000, "../..", "nan",
    "inf", "-inf", "-1", "0", "1", "2", "3.5", "1e308", "1e300h", "9" * 6000, "-" + "9" * 30, "é",
    "0.1 deg/h", "deg/s", "g", "m/s", "[[[[", "{", "1,2,3", "a=b", "motion.heading=5", "::", "0:1",
    "1:2:3", "100s", "-5 min", "1e-320", "0x10", "1_000", "\u202eabc", "\udcff", "%s%s%n", "--",
    "-", "FLU", "t,gx,gy,gz,ax,ay,az", "_,_,_", "1,2,3,4,5,6,7", "navigation-fog", "centred",
    "optimal", "kalman", "emd", "gate", "tetrahedron", "symmetric4", "gyro-x", "two-axis-16",
)  # fmt: skip

FILES = (
    "ok.csv", "ok.csv", "ok.csv", "ok.parquet", "empty.csv", "folder", "absent.csv", "deep.toml",
    "digits.toml", "scene.toml", "scene.toml", "spec.toml", "noise.bin", "/dev/null", "link.csv",
    "truth.parquet", "deep.json", "plan.json",
)  # fmt: skip

OUTPUTS = (
    "out.json", "out.html", "out.toml", "out.parquet", "out.csv", "-", "/dev/null", "/dev/full",
    "folder", "no/such/out.json", "ok.csv", "link.csv", "spec.toml", "x" * 300, "out",
)  # fmt: skip

#: what keeps a command short, said last
SHORT = {
    ("plan", "centrifuge"): ["--rounds", "1", "--time-limit", "1s", "--workers", "1",
                             "--positions", "2"],
    ("campaign",): ["--runs", "2", "--workers", "0"],
    ("live",): ["--idle", "0.05"],
    ("demo",): ["--minutes", "0.2"],
    ("published", "run"): ["--runs", "1", "--workers", "1"],
    ("rotation", "optimise"): ["--tries", "2", "--turns", "4"],
    ("align",): ["--idle", "0.05"],
}  # fmt: skip


def leaves():
    """Return each command that does something, with the words that call it."""
    found = {}
    for name in _COMMANDS:
        command = import_module(f"schuler.cli.{name}").command
        below = command.commands if isinstance(command, click.Group) else {None: command}
        found.update({(name, *([sub] if sub else [])): each for sub, each in below.items()})
    return found


def value(param, rng):
    """Draw a value of an option: mostly of its kind, sometimes anything."""
    kind = param.type
    if rng.random() < 0.3:
        return str(rng.choice(HOSTILE))
    if isinstance(kind, OutputFile):
        return str(rng.choice(OUTPUTS))
    if isinstance(kind, InputFile):
        return str(rng.choice(FILES))
    if isinstance(kind, click.Choice):
        return str(rng.choice(list(kind.choices)))
    if isinstance(kind, Seconds):
        return str(rng.choice(["0.5", "1s", "2s", "0.01 min", "-1", "0"]))
    if isinstance(kind, Number | Count) or kind is click.INT or kind is click.FLOAT:
        return str(rng.choice(["1", "2", "5", "30", "0.5", "-3", "45"]))
    return str(rng.choice(HOSTILE))


def draw(words, command, rng):
    """Return a random command line."""
    out = []
    for param in command.params:
        if isinstance(param, click.Argument):
            for _ in range(1 if param.nargs == 1 else int(rng.integers(0, 4))):
                if rng.random() < 0.95:
                    choice = FILES if isinstance(param.type, InputFile) else HOSTILE
                    out.append(str(rng.choice(choice)))
        elif rng.random() < (0.8 if param.required else 4.0 / len(command.params)):
            name = str(rng.choice([*param.opts, *param.secondary_opts]))
            out += [name] if param.is_flag else [name, value(param, rng)]
            if rng.random() < 0.3 and not param.is_flag:
                out[-2:] = [f"{name}={out[-1]}"]
    if command.name in ("align", "navigate", "compare", "live", "limit") and rng.random() < 0.7:
        out += ["--lat", "40"]
    if words == ("published", "run"):
        # A whole experiment takes its time; what is drawn here is how it is asked for.
        out = [w for w in out if w != "all"]
    return [*words, *out, *SHORT.get(words, [])]


@pytest.fixture
def bench(tmp_path, monkeypatch):
    """Make a folder of small files, good and bad; return the digests of those that must stay."""
    import schuler as sc
    from schuler.motion import Static
    from schuler.sensors import GRADES
    from schuler.simulation import simulate

    rng = np.random.default_rng(1)
    made = simulate(Static(30.0), sc.Site(40.0), 4.0, 20.0, GRADES["navigation-fog"], rng)
    sc.write(made.record, tmp_path / "ok.csv")
    sc.write(made.record, tmp_path / "ok.parquet")
    from schuler.io import write_trajectory

    write_trajectory(made.truth, tmp_path / "truth.parquet")
    (tmp_path / "link.csv").symlink_to("ok.csv")
    (tmp_path / "empty.csv").touch()
    (tmp_path / "folder").mkdir()
    (tmp_path / "noise.bin").write_bytes(rng.bytes(5000))
    (tmp_path / "deep.toml").write_text("a = " + "[" * 100_000)
    (tmp_path / "deep.json").write_text("[" * 100_000)
    (tmp_path / "plan.json").write_text('{"positions": [[0, 0, 0]], "rounds": 1e999}')
    (tmp_path / "digits.toml").write_text("lat = " + "9" * 6000)
    (tmp_path / "spec.toml").write_text(
        '[gyro]\nbias = "0.01 deg/h"\nangle_random_walk = "0.003 deg/sqrt(h)"\n'
        '[accelerometer]\nbias = "50 ug"\n'
    )
    (tmp_path / "scene.toml").write_text(
        'duration = "4 s"\nrate = "20 Hz"\ninstrument = "spec.toml"\n'
        '[site]\nlat = 40.0\n[motion]\nkind = "static"\nheading = 30\n'
    )
    monkeypatch.chdir(tmp_path)
    return {path: digest(path) for path in tmp_path.iterdir() if path.is_file()}


def digest(path: Path) -> str:
    """Return a file's digest, or nothing where it is gone."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""


class Worker:
    """A process that runs command lines; it is ended when one takes too long."""

    def __init__(self) -> None:
        answers, into = os.pipe()
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.fuzz.command_worker", str(into)],
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            pass_fds=(into,), env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        )  # fmt: skip
        os.close(into)
        self._answers = os.fdopen(answers)

    def ask(self, words: list[str], deadline: float) -> dict | None:
        """Return how a command line ended; None where it did not in time."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(words).encode() + b"\n")
        self._process.stdin.flush()
        ready, _, _ = select.select([self._answers], [], [], deadline)
        line = self._answers.readline() if ready else None
        return None if line is None else json.loads(line) if line else {"code": "died", "err": ""}

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()
        self._answers.close()


def asked_for(words: list[str], path: Path) -> bool:
    """Say whether a command that takes no record was told to write a file, itself or by a link."""
    outputs = [w.rpartition("=")[2] for w in words]
    without_record = words[0] == "simulate" or words[:2] == ["rotation", "optimise"]
    return without_record and any(Path(w).resolve() == path.resolve() for w in outputs)


WARM = [
    ["align", "ok.csv", "--lat", "40", "--spec", "navigation-fog", "--report", "warm.html"],
    ["compare", "ok.csv", "--lat", "40"],
    ["navigate", "ok.csv", "--lat", "40", "--heading", "3", "--spec", "navigation-fog"],
    ["allan", "ok.csv"], ["info", "ok.csv"], ["limit", "--spec", "navigation-fog", "--lat", "40"],
    ["demo", "--out", "warm", "--minutes", "0.2"], ["array", "symmetric4"],
    ["calibrate", "systematic", "ok.csv", "--lat", "40", "--spec", "navigation-fog"],
    ["calibrate", "centrifuge", "--simulate", "1"],
    ["plan", "centrifuge", "--rounds", "1", "--time-limit", "1s", "--positions", "2"],
    ["rotation", "residual", "two-axis-16"], ["simulate", "scene.toml", "--out", "warm.csv"],
    ["campaign", "scene.toml", "--runs", "2", "--workers", "0", "--out", "warm.d"],
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.compiled
def test_random_command_lines_end_well(bench):
    rng = np.random.default_rng(20261127)
    commands = list(leaves().items())
    worker = Worker()
    bad = []
    try:
        # Kernels that are not compiled yet take memory of their own: another process pays for them.
        for words in WARM:
            assert worker.ask(words, 300.0) is not None
        worker.close()
        worker = Worker()
        worker.ask(["--help"], 60.0)
        for k in range(LINES):
            words = draw(*commands[k % len(commands)], rng)
            if any("\0" in w for w in words):
                continue
            found = worker.ask(words, DEADLINE)
            if found is None or found["code"] == "died":
                bad.append((words, "no answer in time" if found is None else "died"))
                worker.close()
                worker = Worker()
                worker.ask(["--help"], 60.0)
                continue
            last = [li for li in found["err"].splitlines() if li.startswith("schuler: ")]
            if (
                found["code"] not in (0, 2, 3, SOME_FAILED)
                or "Traceback" in found["err"]
                or (found["code"] == 2 and len(last) != 1)
                or "\x1b" in found["out"] + found["err"]
                or found["peak_kb"] > MEMORY_KB
            ):
                bad.append((words, {k: str(v)[-600:] for k, v in found.items() if k != "out"}))
            for path, before in bench.items():
                if asked_for(words, path):
                    bench[path] = digest(path)
                elif digest(path) != before:
                    bad.append((words, f"{path.name} was changed"))
                    pytest.fail(f"{bad}")
    finally:
        worker.close()
    shown = "\n".join(f"{' '.join(w[:120] for w in words)}\n   {what}" for words, what in bad[:20])
    assert not bad, f"{len(bad)} of {LINES}:\n{shown}"
