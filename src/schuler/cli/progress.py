"""How far a command is: bars on standard error for a person, nothing in a pipe or with --quiet."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import click

__all__ = ["counting", "quiet_option", "shares", "status", "watched"]

_QUIET = "schuler.quiet"


def quiet_option() -> click.Option:
    """Return the option --quiet, which every command has."""

    def keep(ctx: click.Context, _: click.Parameter, value: bool) -> None:
        if value:
            ctx.find_root().meta[_QUIET] = True

    return click.Option(
        ["--quiet", "-q"], is_flag=True, expose_value=False, is_eager=True, callback=keep,
        help="Show no progress.",
    )  # fmt: skip


def watched() -> bool:
    """Say whether a person watches: standard error is a terminal, and --quiet was not said."""
    ctx = click.get_current_context(silent=True)
    quiet = ctx is not None and bool(ctx.find_root().meta.get(_QUIET))
    return sys.stderr.isatty() and not quiet


def _bar(*columns: Any) -> Any:
    from rich.console import Console
    from rich.progress import Progress

    return Progress(*columns, console=Console(stderr=True), transient=True)


@contextmanager
def counting(what: str, things: str = "") -> Iterator[Callable[..., None]]:
    """Give a function to call with what is done, how much there is, and words on what is next.

    Parameters
    ----------
    what : str
        Before the bar.
    things : str
        What is counted, behind it.
    """
    if not watched():
        yield lambda done, total, text="": None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import TimeRemainingColumn as Remaining

    with _bar(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn(things),
        TimeElapsedColumn(), TextColumn("left"), Remaining(), TextColumn("{task.fields[text]}"),
    ) as bar:  # fmt: skip
        task = bar.add_task(what, total=None, text="")
        begun: list[int] = []

        def tell(done: int, total: int, text: str = "") -> None:
            if not begun:
                # What an earlier start has done says nothing of the speed of this one.
                begun.append(done)
                bar.reset(task, total=total, completed=done)
            bar.update(task, total=total, completed=done, text=text)

        yield tell


@contextmanager
def shares(what: str) -> Iterator[Callable[[float], None] | None]:
    """Give a function to call with the share (0 to 1) that is done; None where nobody watches."""
    if not watched():
        yield None
        return
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn

    with _bar(
        TextColumn(what), BarColumn(), TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
    ) as bar:  # fmt: skip
        task = bar.add_task(what, total=1.0)
        yield lambda share: bar.update(task, completed=share)


@contextmanager
def status(what: str) -> Iterator[Callable[[str], None]]:
    """Give a function to call with words on what is done now, beside the time that has passed."""
    if not watched():
        yield lambda text: None
        return
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    with _bar(
        SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    ) as bar:  # fmt: skip
        task = bar.add_task(what, total=None)
        yield lambda text: bar.update(task, description=f"{what}: {text}")
