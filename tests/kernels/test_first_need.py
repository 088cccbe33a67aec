"""What a command lacks is compiled by several processes, and by this one where they fail."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from schuler.kernels import _cache as cache
from schuler.kernels import _machine_code as machine_code
from schuler.kernels import ahead, first_need

SCREEN = next(entry for entry in ahead.entries() if entry.signature[0] == "spikes.screen")
CHEAP = ["quat.quat_multiply_many", "quat.quat_rotate_many", "earth.radii_many", "allan.integrate"]


def missing(monkeypatch, command, there=()):
    """Return what is compiled for the screening of a record that a command calls."""
    monkeypatch.setattr(cache, "has_code", lambda name: name.partition("-")[0] in there)
    monkeypatch.setattr(first_need, "_command", command)
    return {signature for _, signature in first_need._missing(*SCREEN.signature)}


def test_what_the_running_command_calls_is_compiled(monkeypatch):
    for command in ("info", "demo", "align"):
        expected = {e.signature for e in ahead.entries() if command in e.commands}
        assert missing(monkeypatch, command) == expected


def test_without_a_known_command_it_is_the_least_that_calls_the_kernel(monkeypatch):
    info = {e.signature for e in ahead.entries() if "info" in e.commands}
    assert missing(monkeypatch, None) == missing(monkeypatch, "plan") == info


def test_what_is_there_is_left_out(monkeypatch):
    found = missing(monkeypatch, "info", there=("intake.check", "intake.integrate"))
    assert SCREEN.signature in found
    assert not {"intake.check", "intake.integrate"} & {place for place, _ in found}


def test_a_kernel_that_no_command_calls_is_compiled_alone(monkeypatch):
    monkeypatch.setattr(cache, "has_code", lambda name: False)
    assert (
        first_need._missing("sequential.sprt", ("f8:2", "f8:1", "f8", "f8", "b1:2", "i8:1")) == []
    )


def test_a_cheap_kernel_does_not_say_what_a_program_is_about_to_do(monkeypatch):
    monkeypatch.setattr(cache, "has_code", lambda name: False)
    cheap = next(e for e in ahead.entries() if e.signature[0] == "earth.gravity_many")
    assert "info" in cheap.commands
    monkeypatch.setattr(first_need, "_command", None)
    assert first_need._missing(*cheap.signature) == []
    monkeypatch.setattr(first_need, "_command", "info")
    assert len(first_need._missing(*cheap.signature)) > 5


def test_little_is_not_shared(monkeypatch):
    monkeypatch.setattr(
        first_need, "_missing", lambda *_: [(first_need.ENOUGH / 2, SCREEN.signature)]
    )
    started = []
    monkeypatch.setattr(first_need, "_share", lambda *given: started.append(given))
    first_need.compile_together(*SCREEN.signature)
    assert started == []


@pytest.mark.compiled
@pytest.mark.skipif(not machine_code.available(), reason="kernels are called through Numba")
@pytest.mark.parametrize(
    "fails", ["", "sys.executable = '/nowhere'", "sys.executable = '/bin/false'"]
)
def test_all_are_compiled_whatever_becomes_of_the_other_process(tmp_path, fails):
    code = (
        "import sys\n"
        "from schuler.kernels import ahead, first_need\n"
        "from schuler.kernels._cache import has_code\n"
        "from schuler.kernels._jit import file_of\n"
        f"todo = [each for each in ahead.signatures() if each[0] in {CHEAP}]\n"
        f"{fails}\n"
        "first_need._share(todo, 1)\n"
        "left = [each for each in todo if not has_code(file_of(*each))]\n"
        # One that the other process took and did not make is compiled when it is called.
        "print(len(todo), len(left))"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, timeout=120,
        env={**os.environ, "SCHULER_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    count, left = map(int, done.stdout.split())
    assert count == 5
    assert left <= (1 if "false" in fails else 0)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.skipif(not machine_code.available(), reason="kernels are called through Numba")
def test_the_list_names_what_the_first_commands_call(tmp_path):
    code = (
        "import sys\n"
        "import schuler.kernels._jit as jit\n"
        "from schuler.cli import main\n"
        "code = jit._Kernel._code\n"
        "def told(kernel, words, **settings):\n"
        "    print('called', kernel._place, *words, file=sys.stderr)\n"
        "    return code(kernel, words, **settings)\n"
        "jit._Kernel._code = told\n"
        "main(sys.argv[1:])\n"
    )
    commands = [
        ["demo", "--out", "."],
        ["info", "demo.parquet"],
        ["align", "demo.parquet", "--lat", "40"],
        ["align", "demo.parquet", "--lat", "40", "--spec", "navigation-fog"],
    ]
    for arguments in commands:
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments], cwd=tmp_path, capture_output=True, text=True,
            timeout=300, check=True,
        )  # fmt: skip
        lines = [line.split() for line in done.stderr.splitlines() if line.startswith("called ")]
        called = {(place, tuple(words)) for _, place, *words in lines}
        listed = {entry.signature for entry in ahead.entries() if arguments[0] in entry.commands}
        assert called
        assert called <= listed, f"signatures.txt: {arguments[0]} calls {called - listed}"
