"""The command ``schuler campaign``: many runs of a scenario, and whether sigma is consistent."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from schuler.cli.command import Command, add_input, echo, wants_text
from schuler.cli.common import emit_json, json_option, report_option, say_warnings
from schuler.cli.completion import methods, scenarios
from schuler.cli.parameters import Count, InputFile

if TYPE_CHECKING:
    from schuler.campaigns import Results
    from schuler.campaigns.scatter import Scatter

__all__ = ["command"]


@click.command("campaign", cls=Command)
@click.argument("scenario", type=InputFile(), metavar="SCENARIO.toml", shell_complete=scenarios)
@click.option(
    "--runs", type=Count(1), default=100, show_default=True, metavar="N", help="Runs at each place."
)
@click.option(
    "--sweep", "sweeps", multiple=True, metavar="KEY=A,B,C",
    help="Values of a key of the scenario; several sweeps go all with all.",
)  # fmt: skip
@click.option(
    "--method", "methods", multiple=True, metavar="NAME", shell_complete=methods,
    help="Alignment methods, in the place of the scenario's.",
)  # fmt: skip
@click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Set a value of the scenario.",
)  # fmt: skip
@click.option("--seed", type=Count(0, 2**63), metavar="N", help="Another seed than the scenario's.")
@click.option(
    "--out", metavar="FOLDER", help="Where results go, and are resumed (NAME.campaign).",
)  # fmt: skip
@click.option(
    "--workers", type=Count(0, 1000), metavar="N",
    help="Workers of a local Dask cluster; 0: this process alone. Without it: a process for "
    "each core.",
)  # fmt: skip
@click.option("--scheduler", metavar="tcp://...", help="A Dask cluster that is there already.")
@json_option("Write the summary as JSON (- : here).")
@report_option("Draw the errors.")
def command(**options: Any) -> None:
    """Simulate and align a scenario many times; compare errors, sigma and the limit.

    Stopped at any moment and started again, it goes on; its results are the same bytes on any
    number of workers.

    \b
      schuler campaign truck.toml --runs 1000 --report truck.html
      schuler campaign truck.toml --runs 200 --sweep motion.crew.moving_mm=1,2,4 --workers 2
    """  # noqa: D301
    from schuler import campaigns
    from schuler.campaigns.store import Store
    from schuler.config import load_scenario, parse_overrides, parse_sweep

    overrides = parse_overrides(options["overrides"])
    if options["seed"] is not None:
        overrides["seed"] = options["seed"]
    scenario = load_scenario(options["scenario"], overrides)
    sweep = parse_sweep(options["sweeps"])
    campaign = campaigns.Campaign(scenario, options["runs"], sweep, options["methods"])
    out = options["out"] or f"{scenario.name.replace('/', '-')}.campaign"
    for path in scenario.files:
        add_input("the scenario", path)
    for path in Store(campaign, out).files():
        add_input("the campaign's store", path)
    if options["report_to"] is not None:
        from schuler.reports.page import graph_objects

        graph_objects()  # a missing library is said before the work
    with _progress(scenario.name) as progress:
        results = campaigns.campaign(
            campaign, out, workers=options["workers"], scheduler=options["scheduler"],
            progress=progress,
        )  # fmt: skip
    scatters = results.scatters()
    say_warnings(results.notes)
    if options["json_to"] is not None:
        emit_json(results.to_dict(), options["json_to"])
    if options["report_to"] is not None:
        from schuler.reports.campaign import campaign_report

        campaign_report(scatters, scenario.name, _inputs(results), options["report_to"])
    if wants_text():
        _print(results, scatters)


def _inputs(results: Results) -> list[tuple[str, str]]:
    campaign = results.campaign
    scenario = campaign.scenario
    return [
        ("scenario", scenario.name),
        ("motion", scenario.kind),
        ("site", f"{scenario.site.lat:g} deg N, {scenario.site.lon:g} deg E, "
         f"{scenario.site.height:g} m"),
        ("record", f"{scenario.duration:g} s at {scenario.rate:g} Hz"),
        ("instrument", "without errors" if scenario.spec is None else scenario.spec.name),
        ("runs", f"{campaign.runs} at each of {len(campaign.points)} place(s)"),
        *((f"sweep of {key}", ", ".join(map(str, v))) for key, v in campaign.sweep.items()),
        ("seed", str(scenario.seed)),
        ("attitude at", f"the {scenario.at}"),
        ("results", str(results.path)),
        ("SHA-256 of the scenario", scenario.digest),
    ]  # fmt: skip


def _print(results: Results, scatters: list[Scatter]) -> None:
    scenario = results.campaign.scenario
    echo(
        f"{scenario.name}: {results.campaign.runs} runs of {scenario.duration:g} s, heading error "
        "against the truth, arcmin"
    )
    width = max([8, *(len(s.label) for s in scatters)])
    swept = bool(results.campaign.sweep)
    head = f"{'place':<{width}}  " if swept else ""
    echo(f"{head}{'method':<18}{'mean':>8}{'std':>8}{'rms':>8}{'sigma':>8}{'limit':>8}"
               f"{'rms/lim':>9}{'NEES/3':>8}  consistent within")  # fmt: skip
    for s in scatters:
        place = f"{s.label:<{width}}  " if swept else ""
        low, high = s.nees_band
        echo(
            f"{place}{s.method:<18}{s.mean:>8.3f}{_cell(s.std):>8}{s.rms:>8.3f}{s.predicted:>8.3f}"
            f"{_cell(s.bound):>8}{_cell(s.ratio, 2):>9}{s.nees_ratio:>8.2f}  "
            f"{low:.2f} to {high:.2f}"
        )
    echo(f"results {results.path}")


def _cell(value: float | None, digits: int = 3) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


@contextmanager
def _progress(name: str) -> Iterator[Callable[[int, int], None] | None]:
    """Give a bar on standard error where a person watches."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    with Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("runs"),
        TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn(),
        console=Console(stderr=True), transient=True,
    ) as bar:  # fmt: skip
        task = bar.add_task(name, total=None)
        begun: list[int] = []

        def tell(done: int, total: int) -> None:
            if not begun:
                # What an earlier start has done says nothing of the speed of this one.
                begun.append(done)
                bar.reset(task, total=total, completed=done)
            bar.update(task, total=total, completed=done)

        yield tell
