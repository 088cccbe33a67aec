"""The help has examples for every command, and what is misspelt is named as it was meant."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from schuler.cli import cli
from schuler.errors import near


def commands(group: click.Group, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Give each command's path and help."""
    ctx = click.Context(group)
    for name in group.list_commands(ctx):
        command = group.get_command(ctx, name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from commands(command, (*path, name))
        else:
            yield (*path, name), command.help or ""


ALL = dict(commands(cli, ()))  # type: ignore[arg-type]
SHORT = {("array", "figures"): "schuler array "}
"""A command that its group runs by itself."""


@pytest.mark.parametrize("path", ALL, ids=" ".join)
def test_each_command_has_an_example(path: tuple[str, ...]) -> None:
    begin = SHORT.get(path, f"schuler {' '.join(path)}")
    assert begin in ALL[path]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("algin", "x"), "No such command 'algin' (did you mean 'align'?)"),
        (("calibrate", "pose"), "poses"),
        (("align", "x.csv", "--lattitude", "4"), "'--lat'"),
        (("align", "truck.csv", "--lat", "4", "--method", "optimul"), "did you mean 'optimal'?"),
        (("align", "truck.csv", "--lat", "4", "--method", "kalman(pases=3)"), "mean 'passes'?"),
        (("align", "truck.csv", "--lat", "4", "--prefilter", "lowpas"), "mean 'lowpass'?"),
        (("align", "truck.csv", "--lat", "4", "--spec", "navigation-fogg"), "'navigation-fog'?"),
        (("align", "truck.csv", "--lat", "4", "--gyro", "deg/sek"), "did you mean 'deg/s'?"),
        (("align", "truck.csv", "--lat", "4", "--columns", "t,gx,gy,gz,ax,ay,azz"), "mean 'az'?"),
        (("align", "truck.csv", "--lat", "4", "--axes", "NED"), "FRD if x points forward"),
        (("published", "run", "guo2014"), "did you mean 'guo2015'?"),
    ],
)
def test_what_is_misspelt_is_named_as_it_was_meant(
    run, csv: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(csv.parent)
    done = run(*arguments)
    assert (done.code, done.out) == (2, "")
    assert said in done.err
    assert done.err.count("\n") == 1


def test_what_is_like_nothing_has_no_suggestion() -> None:
    assert near("xyzzy", ["optimal", "kalman"]) == ""
    assert near("NAVIGATION-FOG", ["navigation-fog"]) == " (did you mean 'navigation-fog'?)"
