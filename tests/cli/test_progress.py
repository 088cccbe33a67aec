"""Progress is for a person who watches: bars on a terminal, nothing in a pipe or with --quiet."""

from __future__ import annotations

import io
import logging
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import click
import pytest

from schuler.cli import progress
from tests.cli.conftest import Ran

Run = Callable[..., Ran]


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Put a terminal in the place of standard error; in the test, as pytest has its own before."""
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    return screen


@pytest.fixture
def logs() -> Iterator[logging.Logger]:
    log = logging.getLogger("schuler")
    before = log.handlers[:], log.level
    yield log
    log.handlers[:], level = before
    log.setLevel(level)


def test_bars_are_drawn_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = terminal(monkeypatch)
    with progress.counting("comparing", "methods") as tell:
        tell(1, 4, "wahba")
        tell(2, 4, "kalman")
    with progress.shares("navigating") as share:
        assert share is not None
        share(0.5)
    with progress.status("planning") as say:
        say("4 positions")
    drawn = screen.getvalue()
    for words in ("comparing", "2/4", "kalman", "navigating", "50 %", "planning: 4 positions"):
        assert words in drawn, words


def test_nothing_is_drawn_in_a_pipe_or_with_quiet(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = terminal(monkeypatch)
    with click.Context(click.Command("x")) as ctx:
        ctx.meta[progress._QUIET] = True
        assert not progress.watched()
        with progress.counting("comparing") as tell, progress.shares("reading") as share:
            tell(1, 2)
            assert share is None
    assert screen.getvalue() == ""
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    assert not progress.watched()


def test_every_command_takes_quiet(run: Run, csv: Path) -> None:
    done = run("align", csv, "--lat", "40", "--quiet")
    assert done.code == 0
    assert "heading" in done.out


def test_the_log_is_on_standard_error_from_its_level_on(
    run: Run, csv: Path, logs: logging.Logger, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SCHULER_LOG", "debug")
    done = run("align", csv, "--lat", "40", "--json", "-")
    assert "schuler.cli: schuler align: reads ['" in done.err
    assert "schuler.io: " in done.err
    assert "schuler.alignment: " in done.err
    assert done.out.startswith("{")
    monkeypatch.setenv("SCHULER_LOG", "info")
    assert "schuler.io: " not in run("align", csv, "--lat", "40", "--json", "-").err


def test_a_level_that_is_none_is_said(run: Run, csv: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SCHULER_LOG", "loud")
    done = run("align", csv, "--lat", "40")
    assert (done.code, done.out) == (2, "")
    assert done.err == "schuler: SCHULER_LOG=loud: expected one of debug, info, warning, error\n"
