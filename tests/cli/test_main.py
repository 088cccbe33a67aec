"""The last net: help, faults of schuler itself, standard output that fails, escape sequences."""

from __future__ import annotations

import os
import subprocess
import sys

import click
import pytest

from schuler.cli import _COMMANDS, cli
from schuler.cli.parameters import Count, Number, Seconds
from schuler.errors import printable


def shell(*words, **settings):
    """Run the command line in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "schuler", *map(str, words)], stderr=subprocess.PIPE, text=True,
        timeout=120, **settings,
    )  # fmt: skip


@pytest.mark.parametrize("words", [(), ("calibrate",), ("plan",), ("rotation",), ("published",)])
def test_a_group_without_a_command_shows_its_help(words, run):
    done = run(*words)
    assert (done.code, done.err) == (0, "")
    assert done.out == run(*words, "--help").out
    assert done.out.count("\n") > 8


@pytest.mark.parametrize("name", _COMMANDS)
def test_each_command_has_help_with_debug(name, run):
    assert "--debug" in run(name, "--help").out


@pytest.fixture
def broken(monkeypatch):
    """Let every command raise what a test says."""

    def set_(error):
        def fail(*_, **__):
            raise error

        monkeypatch.setattr(cli, "main", fail)

    return set_


def test_an_internal_fault_is_one_sentence_with_exit_70(broken, run):
    broken(ZeroDivisionError("of all things\x1b[2J"))
    done = run("info", "x")
    assert (done.code, done.out) == (70, "")
    assert done.err.count("\n") == 1
    assert "internal fault, ZeroDivisionError: of all things\\x1b[2J (test_main.py" in done.err
    assert "--debug" in done.err


@pytest.mark.parametrize("how", ["option", "variable"])
def test_debug_shows_the_traceback(how, broken, run, monkeypatch):
    broken(ZeroDivisionError("of all things"))
    if how == "variable":
        monkeypatch.setenv("SCHULER_DEBUG", "1")
    done = run("info", "x", *(["--debug"] if how == "option" else []))
    assert done.code == 70
    assert "Traceback" in done.err


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (KeyboardInterrupt(), 130, "stopped"),
        (click.Abort(), 130, "stopped"),
        (MemoryError(), 2, "not enough memory"),
        (PermissionError(13, "Permission denied", "a.csv"), 2, "a.csv: Permission denied"),
        (RecursionError("deep"), 70, "RecursionError"),
        (EOFError("short"), 70, "EOFError"),
    ],
)
def test_each_kind_of_error_has_its_exit_code(error, code, said, broken, run):
    broken(error)
    done = run("info", "x")
    assert done.code == code
    assert said in done.err


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full here")
@pytest.mark.parametrize(
    "words", [("--help",), ("array", "triad"), ("array", "triad", "--json", "-")]
)
def test_a_full_standard_output_is_one_sentence(words):
    with open("/dev/full", "w") as full:
        done = shell(*words, stdout=full)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "standard output" in done.stderr


def test_a_reader_that_leaves_is_no_fault():
    out, into = os.pipe()
    os.close(out)
    with os.fdopen(into, "w") as pipe:
        done = shell("--help", stdout=pipe)
    assert done.returncode != 70
    assert "Traceback" not in done.stderr


def test_escape_sequences_of_a_name_do_not_reach_the_terminal(run, csv):
    evil = csv.with_name("a\x1b]0;owned\x07\x9b31m.csv")
    csv.rename(evil)
    done = run("info", evil)
    assert not set("\x1b\x07\x9b") & set(done.out + done.err)
    done = run("info", evil.with_name("absent\x1b[2J.csv"))
    assert done.code == 2
    assert "\x1b" not in done.err


@pytest.mark.parametrize(
    ("text", "shown"),
    [("plain é ü ′ ± σ", "plain é ü ′ ± σ"), ("a\x1b[2J", "a\\x1b[2J"), ("\u202ecod", "\\u202ecod"),
     ("line\nnext\tcell", "line\nnext\tcell"), ("\udcff", "\\udcff"), ("a\xa0b", "a\xa0b")],
)  # fmt: skip
def test_printable(text, shown):
    assert printable(text) == shown


@pytest.mark.parametrize(
    ("kind", "good", "bad"),
    [
        (Count(1, 100), ["1", "+7", "100"], ["0", "101", "1e3", "1.5", "-3", "9" * 6000, "x", "²"]),
        (Number(0.0, 1.0), ["0", "1", "0.5"], ["-0.1", "1.1", "nan", "inf", "x", "1e999"]),
        (Number(above=0.0), ["1e-9", "7"], ["0", "-1", "nan"]),
        (Seconds(above=0.0), ["1", "5min", "0.5 h"], ["0", "-1 s", "nan", "1e999h", "1 kg", "x"]),
    ],
)
def test_numbers_have_bounds(kind, good, bad):
    for text in good:
        kind.convert(text, None, None)
    for text in bad:
        with pytest.raises((click.BadParameter, ValueError)):
            kind.convert(text, None, None)


@pytest.mark.parametrize(
    "words",
    [
        ("campaign", "s.toml", "--runs", "1e11"),
        ("limit", "--spec", "navigation-fog", "--lat", "40", "--next-tilt", "nan"),
        ("calibrate", "centrifuge", "--passes", "-5"),
        ("calibrate", "centrifuge", "--dwell", "0"),
        ("calibrate", "centrifuge", "--dwell=1e300h"),
        ("calibrate", "centrifuge", "--simulate=-1"),
        ("navigate", "x.csv", "--every=99999999999999999999"),
        ("rotation", "optimise", "--acceleration=inf"),
        ("plan", "centrifuge", "--scheduler", "nonsense", "--rounds", "1"),
        ("align", "a\0b.csv", "--lat", "40"),
    ],
)
def test_options_out_of_bounds_are_one_sentence(words, run):
    done = run(*words)
    assert (done.code, done.out) == (2, "")
    assert done.err.count("\n") == 1


def test_an_interrupt_while_it_loads_is_one_sentence():
    """Ctrl-C comes while the command line itself is imported."""
    code = (
        "import sys\n"
        "class Finder:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'click':\n"
        "            raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Finder())\n"
        "from schuler.__main__ import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 130
    assert done.stderr == "schuler: stopped\n"


def test_an_interrupt_in_a_finaliser_stops_the_command_as_well():
    code = (
        "import signal, sys, types\n"
        # A process that was started in the background may have been told to ignore Ctrl-C.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "class Held:\n"
        "    def __del__(self):\n"
        "        raise KeyboardInterrupt\n"
        "def run():\n"
        "    held = Held()\n"
        "    del held\n"
        "    for _ in range(10**8):\n"
        "        pass\n"
        "    print('went on')\n"
        "sys.modules['schuler.cli'] = types.SimpleNamespace(main=run)\n"
        "from schuler.__main__ import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 130
    assert done.stdout == ""
    assert done.stderr == "schuler: stopped\n"
