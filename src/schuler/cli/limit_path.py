"""The bound on a path of ``schuler limit --path``: its options, and its run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schuler.cli.command import echo, wants_text
from schuler.cli.common import draw, emit_json
from schuler.cli.parameters import Seconds
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.alignment.moving.planned import PlannedAid
    from schuler.record import ImuRecord
    from schuler.trajectory import Trajectory

__all__ = ["limit_on_path", "planned_aids", "times_of"]

_OF_REST = ("positions", "next_yaw", "lat", "lon", "height")


def times_of(text: str) -> list[float]:
    """Return the times of a list as ``60s,300s,10min``, s."""
    convert = Seconds().convert
    return [convert(cell.strip(), None, None) for cell in text.split(",")]


def planned_aids(texts: Sequence[str]) -> list[PlannedAid]:
    """Return the aids that texts say, one of a kind.

    Raises
    ------
    InputError
        For a text that says none, or a kind twice.
    """
    from schuler.alignment.moving.planned import PlannedAid

    out = [PlannedAid.parse(text) for text in texts]
    kinds = [aid.kind for aid in out]
    twice = next((kind for kind in kinds if kinds.count(kind) > 1), None)
    if twice is not None:
        raise InputError(f"--aid: {twice} is there twice")
    return out


def limit_on_path(options: dict[str, Any]) -> None:
    """Print the bound on a path.

    Parameters
    ----------
    options : dict
        Of the command.

    Raises
    ------
    InputError
        For options of an alignment at rest, or no aid.
    """
    from schuler.alignment.moving.planned import path_table

    given = [key for key in _OF_REST if options[key] is not None]
    if given:
        raise InputError(
            f"--{given[0].replace('_', '-')} is of an alignment at rest: leave it out beside --path"
        )
    if not options["aids"]:
        raise InputError("the limit on a path depends on the aids: say --aid gnss=0.1m/s,3m@1Hz")
    aids = planned_aids(options["aids"])
    times = None if options["times"] is None else sorted(times_of(options["times"]))
    path, record = _read_path(options["path"])
    found = path_table(path, options["spec"], aids, times, record=record)
    if options["json_to"] is not None:
        emit_json(found.to_dict(), options["json_to"])
    draw(found, options["report_to"])
    if wants_text():
        echo(str(found))


def _read_path(name: str) -> tuple[Trajectory, ImuRecord | None]:
    """Return a path, and what a perfect instrument has along it where it is a scenario's."""
    from dataclasses import replace

    if Path(name).suffix.lower() == ".toml":
        from schuler.config import load_scenario

        scenario = replace(load_scenario(name), spec=None, gyro_bias=None, accel_bias=None)
        made = scenario.run()
        return replace(made.truth, name=Path(name).name), made.record
    from schuler.io import read_trajectory

    return read_trajectory(name), None
