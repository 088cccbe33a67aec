"""What ``schuler navigate`` writes of a path: of which point, at which rows, in which format."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from schuler.cli.parameters import Count, OutputFile
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.io.trajectory_stream import TrajectoryStream
    from schuler.navigation import AidedNavigation
    from schuler.record import ImuRecord
    from schuler.trajectory import Trajectory

__all__ = ["PathOutput", "path_options", "triple"]

_SUFFIXES = (".parquet", ".pq", ".csv", ".npz", ".jsonl", ".gpx", ".kml", ".txt", ".mat")
_ANTENNA = "antenna"


def path_options(function: Any) -> Any:
    """Add the options of the path to a command."""
    options: list[Callable[[Any], Any]] = [
        click.option(
            "--every", type=Count(1), metavar="N",
            help="Samples to a row of the path (1; with --gnss rows are the epochs of the filter "
            "when it is not given).",
        ),
        click.option(
            "--at", metavar="antenna|X,Y,Z",
            help="Path of another point: the antenna, or so far from the IMU (body axes, m).",
        ),
        click.option(
            "--out", "out_to", type=OutputFile(*_SUFFIXES), metavar="OUT",
            help="Write the path: .parquet, .csv, .npz, .jsonl, .gpx, .kml.",
        ),
        click.option(
            "--out-format", type=click.Choice(["schuler", "pyins", "psins"]),
            help="Its columns: pyins (a table), psins (avp: .mat, .txt, .csv, .npz).",
        ),
    ]  # fmt: skip
    for option in reversed(options):
        function = option(function)
    return function


def triple(text: str, option: str) -> tuple[float, float, float]:
    """Return three numbers of an option.

    Raises
    ------
    InputError
        If the text is not three numbers with commas.
    """
    try:
        x, y, z = (float(cell) for cell in text.split(","))
    except ValueError:
        raise InputError(f"{option}: expected three numbers with commas, got '{text}'") from None
    return x, y, z


class Nowhere:
    """Takes the pieces of a path that is not written."""

    def write(self, piece: Trajectory) -> None:
        """Forget the rows."""


@dataclass(frozen=True)
class PathOutput:
    """The options of the path.

    Parameters
    ----------
    to : str or None
    layout : str
    every : int or None
    at : (float, float, float), "antenna" or None
    """

    to: str | None
    layout: str
    every: int | None
    at: tuple[float, float, float] | str | None

    @classmethod
    def taken(cls, options: dict[str, Any], *, aided: bool) -> PathOutput:
        """Take the options of the path out of those of a command, and check them before the work.

        Raises
        ------
        InputError
            For a format that the file cannot have, or an antenna without fixes.
        """
        from schuler.io.trajectory_write import check_trajectory_target

        to, layout, every, at = (
            options.pop(key) for key in ("out_to", "out_format", "every", "at")
        )  # fmt: skip
        if to is not None:
            check_trajectory_target(to, layout or "schuler")
        elif layout is not None:
            raise InputError("--out-format says the columns of --out: give one")
        if at is not None and at.strip().lower() == _ANTENNA:
            if not aided:
                raise InputError("--at antenna is where the fixes' antenna is: say --gnss")
            return cls(to, layout or "schuler", every, _ANTENNA)
        where = None if at is None else triple(at, "--at")
        return cls(to, layout or "schuler", every, where)

    def of_aided(self, found: AidedNavigation, record: ImuRecord) -> Trajectory:
        """Return the rows that are wanted of an aided navigation."""
        if self.at is not None:
            lever = found.antenna() if isinstance(self.at, str) else self.at
            return found.at_point(record, lever, self.every)
        return found.path if self.every is None else found.at_samples(record, self.every)

    @property
    def every_free(self) -> int:
        """Samples to a row that a free-inertial navigation keeps: all for another point's rate."""
        return 1 if self.at is not None else self.every or 1

    def of_free(self, path: Trajectory) -> Trajectory:
        """Return the rows that are wanted of a path at all samples, where a point was named."""
        from schuler.navigation.lever import at_lever

        if self.at is None:
            return path
        return at_lever(path, self.at).rows(slice(None, None, self.every or 1))

    @property
    def in_pieces(self) -> bool:
        """Whether the path can be written while it is made, or is not written at all."""
        from schuler.io.trajectory_stream import can_stream

        return self.at is None and (self.to is None or can_stream(self.to))

    def stream(self) -> AbstractContextManager[TrajectoryStream | Nowhere]:
        """Give what takes a path in pieces (`in_pieces`)."""
        from schuler.io.trajectory_stream import streamed_trajectory

        return nullcontext(Nowhere()) if self.to is None else streamed_trajectory(
            self.to, self.layout
        )  # fmt: skip

    def write(self, path: Trajectory, utc: float | None = None) -> None:
        """Write the file, if one is wanted; `utc` is the Unix time of the path's zero, s."""
        from schuler.io import write_trajectory

        if self.to is not None:
            about = {} if utc is None else {"utc": utc}
            write_trajectory(path, self.to, about, layout=self.layout)
