"""The command ``schuler published``: experiments of the literature, redone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import click

from schuler.cli.command import Group, echo, wants_text
from schuler.cli.common import draw, emit_json, json_option, report_option
from schuler.cli.parameters import Count
from schuler.cli.progress import counting

__all__ = ["command"]


def check_name(name: str, known: Sequence[str], more: str) -> None:
    """Refuse a name that no experiment has."""
    from schuler.errors import InputError, near

    if name not in known:
        raise InputError(
            f"'{name}'{near(name, known)} is no published experiment; there are "
            f"{', '.join(known)}{more}"
        )


@click.group("published", cls=Group)
def command() -> None:
    """Redo published experiments: printed, by the document's method, by ours, and the limit.

    \b
      schuler published list
      schuler published run guo2015
      schuler published run yu_emd --set site.lat=50 --set "gyro.bias=0.1 deg/h"
      schuler published run all --report published.html --json published.json
    """  # noqa: D301


@command.command("list")
def list_() -> None:
    """Say which experiments there are, and where they were published.

    \b
      schuler published list
    """  # noqa: D301
    from schuler.published import EXPERIMENTS, conditions

    width = max(map(len, EXPERIMENTS))
    for name in EXPERIMENTS:
        case = conditions(name)
        echo(f"{name:<{width}}  {case['title']}\n{'':<{width}}  {case['citation']}")


@command.command("conditions")
@click.argument("name")
def conditions_(name: str) -> None:
    """Say which conditions of the experiment NAME can be set, and what they are.

    \b
      schuler published conditions guo2015
    """  # noqa: D301
    import json

    from schuler.published import EXPERIMENTS, changeable

    check_name(name, EXPERIMENTS, "")
    known = changeable(name)
    width = max(map(len, known))
    for key, value in known.items():
        said = "(not said)" if value is None else json.dumps(value, ensure_ascii=False)
        echo(f"{key:<{width}}  {said}")


@command.command("run")
@click.argument("name")
@click.option(
    "--runs", type=Count(1), metavar="N", help="Independent runs (each its own without it)."
)
@click.option(
    "--seed", type=Count(0, 2**31 - 1), default=0, show_default=True, help="Of the random numbers."
)
@click.option(
    "--workers", type=Count(1, 1000), metavar="N", help="Processes; one to a core without it."
)
@click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Set a condition of the experiment, as site.lat=50.",
)
@json_option("Write the rows as JSON (- : here).")
@report_option("Write a page.")
def run_(
    name: str, runs: int | None, seed: int, workers: int | None, overrides: tuple[str, ...],
    json_to: str | None, report_to: str | None,
) -> None:  # fmt: skip
    """Redo the experiment NAME, several with commas, or all.

    \b
      schuler published run guo2015 --report guo2015.html
      schuler published run yu_emd --set site.lat=50
    """  # noqa: D301
    from schuler.config import parse_overrides
    from schuler.published import EXPERIMENTS, Options, conditions, run, to_dict

    names = list(EXPERIMENTS) if name == "all" else [each.strip() for each in name.split(",")]
    for each in names:
        check_name(each, EXPERIMENTS, ", and all")
    Options(runs, seed, workers)
    changes = parse_overrides(overrides)
    for each in names:
        conditions(each, changes.items())  # a condition that is not there is said before the work
    found = []
    for each in dict.fromkeys(names):
        options: dict[str, Any] = {
            "runs": runs, "seed": seed, "workers": workers, "changes": changes,
        }  # fmt: skip
        with counting(each, "jobs") as progress:
            found.append(run(each, progress=progress, **options))
        if wants_text():
            echo(("" if len(found) == 1 else "\n") + str(found[-1]))
    if json_to is not None:
        emit_json(to_dict(found), json_to)
    draw(found, report_to)
