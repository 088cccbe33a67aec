"""The heading of a file that grows: a line that is shown while rows come, until Ctrl-C."""

from __future__ import annotations

import sys
import time as clock
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

import click

from schuler.cli.command import echo

if TYPE_CHECKING:
    from schuler.alignment import Alignment
    from schuler.calibration.apply import Calibration
    from schuler.record import ImuRecord

__all__ = ["budget_line", "follow"]

_BETWEEN = 0.5
"""Seconds between two lines."""

Solution = tuple[float, "Alignment"]


def follow(
    chunks: Iterable[ImuRecord], update: Callable[[ImuRecord], object],
    solution: Callable[[], Solution | None], calibration: Calibration | None, quiet: bool,
) -> None:  # fmt: skip
    """Take chunks as they come, and show heading and sigma twice a second, until the end or Ctrl-C.

    Parameters
    ----------
    chunks : iterable of ImuRecord
    update : callable
        Takes each chunk, calibrated.
    solution : callable
        Returns the time that is shown, s, and the alignment by now; None where there is none yet.
    calibration : Calibration or None
    quiet : bool
        Whether standard output is for the result alone.
    """
    with _line(quiet) as show:
        last = 0.0
        for chunk in chunks:
            update(chunk if calibration is None else calibration.apply(chunk))
            if clock.monotonic() - last < _BETWEEN:
                continue
            last = clock.monotonic()
            found = solution()
            if found is not None:
                time, fix = found
                show(
                    f"{time:12.2f} s  heading {fix.heading_deg:9.4f} deg "
                    f"± {fix.sigma_arcmin[2]:.3g}'"
                )


@contextmanager
def _line(quiet: bool) -> Iterator[Callable[[str], None]]:
    """Give what shows a line: in the place of the last one on a terminal, else below it."""
    screen = sys.stdout.isatty() and not quiet

    def show(line: str) -> None:
        if screen:
            click.echo(f"\r\x1b[K{line}", nl=False)
        else:
            echo(line, err=quiet)

    # Ctrl-C is the way to end a live alignment: the result so far is wanted.
    with suppress(KeyboardInterrupt):
        yield show
    if screen:
        echo()


def budget_line(fix: Alignment) -> str:
    """Return each source's part of the heading's sigma, the largest first."""
    from schuler.units import significant

    shares = sorted(fix.budget_arcmin2.items(), key=lambda item: -item[1])
    parts = (f"{name.replace('_', ' ')} {significant(v**0.5, 2)}'" for name, v in shares)
    return f"heading budget (1 sigma): {', '.join(parts)}"
