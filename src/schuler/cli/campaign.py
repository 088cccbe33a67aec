"""The command ``schuler campaign``: many runs of a scenario, and whether sigma is consistent."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from schuler.cli.command import Command, add_input, echo, wants_text
from schuler.cli.common import draw, emit_json, json_option, report_option, say_warnings
from schuler.cli.completion import methods, scenarios
from schuler.cli.parameters import Count, InputFile
from schuler.cli.progress import counting

if TYPE_CHECKING:
    pass

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
    with counting(scenario.name, "runs") as progress:
        results = campaigns.campaign(
            campaign, out, workers=options["workers"], scheduler=options["scheduler"],
            progress=progress,
        )  # fmt: skip
    say_warnings(results.notes)
    if options["json_to"] is not None:
        emit_json(results.to_dict(), options["json_to"])
    draw(results, options["report_to"])
    if wants_text():
        echo(results)
