"""The command ``schuler plan``, the test, or the manoeuvre, with the most information."""

from __future__ import annotations

from contextlib import nullcontext
from functools import partial
from typing import Any

import click

from schuler.cli.command import Group, echo, wants_text
from schuler.cli.common import draw, emit_json, json_option, report_option
from schuler.cli.completion import specs
from schuler.cli.parameters import Count, InputFile, Number, Seconds
from schuler.cli.progress import status
from schuler.errors import InputError

__all__ = ["command"]


@click.group("plan", cls=Group)
def command() -> None:
    """Find the best test of an instrument, or the best manoeuvre for a heading."""


@command.command("centrifuge")
@click.option("--positions", default="6", show_default=True, metavar="N|N-M",
              help="How many positions, or a range to see the trade.")  # fmt: skip
@click.option("--dwell", type=Seconds(above=0.0, high=1e6), default="20s", show_default=True,
              help="Time at each: whole turns of the arm.")  # fmt: skip
@click.option(
    "--total",
    type=Seconds(above=0.0, high=1e7),
    help="With a range: time in all, shared by the positions.",
)
@click.option(
    "--objective", default="min-max", show_default=True,
    help="What is made small: min-max (largest sigma / wanted), time, a, d, e or sum-rho.",
)  # fmt: skip
@click.option("--order", type=click.Choice(["zyx", "yzx"]), default="zyx", show_default=True,
              help="Of the gimbals.")  # fmt: skip
@click.option(
    "--compare", type=Count(0, 1000), default=1, show_default=True, metavar="N",
    help="Rounds spent on each other objective, to show what the plan gives up; 0: none.",
)  # fmt: skip
@click.option("--method", default="cma", show_default=True, help="cma, de or ga.")
@click.option(
    "--alpha", default="0,360", show_default=True, metavar="LOW,HIGH", help="Limits, deg."
)
@click.option("--beta", default="0,0", show_default=True, metavar="LOW,HIGH", help="Limits, deg.")
@click.option(
    "--gamma", default="0,360", show_default=True, metavar="LOW,HIGH", help="Limits, deg."
)
@click.option(
    "--force",
    type=Number(above=0.0, high=1000.0, unit="g"),
    default=10.0,
    show_default=True,
    metavar="G",
    help="Centripetal force.",
)
@click.option(
    "--rate",
    type=Number(above=0.0, high=1e5, unit="deg/s"),
    default=180.0,
    show_default=True,
    metavar="DEG/S",
    help="Of the arm.",
)
@click.option(
    "--lat",
    type=Number(-90.0, 90.0, unit="deg"),
    default=28.22,
    show_default=True,
    metavar="DEG",
    help="Latitude.",
)
@click.option(
    "--noise",
    type=Number(above=0.0, high=1e6, unit="ug"),
    default=10.0,
    show_default=True,
    metavar="UG",
    help="Of an output sample.",
)
@click.option("--time-limit", type=Seconds(above=0.0, high=1e6), default="60s", show_default=True,
              help="When to stop searching.")  # fmt: skip
@click.option(
    "--rounds", type=Count(1), help="Stop after so many rounds: the same answer everywhere."
)
@click.option(
    "--seed", type=Count(0, 2**31 - 1), default=0, show_default=True, help="Of the search."
)
@click.option(
    "--workers", type=Count(1, 1000), default=2, show_default=True, help="Rounds at a time."
)
@click.option("--scheduler", metavar="tcp://...", help="A Dask cluster for the rounds.")
@click.option(
    "--resume", type=InputFile(), metavar="JSON", help="Resume from an earlier plan's --json."
)
@json_option("Write the plan as JSON (- : here).")
@report_option("Draw the schemes and the trade.")
def centrifuge(**options: Any) -> None:
    """Find the positions of a platform on a centrifuge that tell its 45 coefficients best.

    The table at the end shows the plan by every objective, beside the published scheme and the
    best that a search for each objective finds. With a range of positions, a table before it has
    every objective of each number's plan.

    \b
      schuler plan centrifuge --positions 6 --dwell 20s --time-limit 60s --seed 0 --json -
      schuler plan centrifuge --positions 4-12 --total 120s --time-limit 20s --report trade.html
    """  # noqa: D301
    from schuler.centrifuge import (
        AngleLimits,
        Objective,
        Plant,
        Problem,
        by_objective,
        compare_objectives,
        explore,
        plan,
    )

    counts = _counts(options["positions"])
    limits = AngleLimits(*(_pair(options[key], key) for key in ("alpha", "beta", "gamma")))
    plant = Plant(
        force=options["force"], rate=options["rate"], latitude=options["lat"],
        noise=options["noise"], order=options["order"],
    )  # fmt: skip
    # Of a time in all each number of positions gets its own dwell: that of --dwell counts for none.
    shared = options["total"] is not None and len(counts) > 1
    problem = Problem(
        plant, counts[0], plant.period if shared else options["dwell"],
        Objective(options["objective"]), limits,
        options["method"],
    )  # fmt: skip

    reached: dict[int, float] = {}

    def progress(count: int, seconds: float, best: float, spent: int) -> None:
        """Show the best so far of a number of positions, after a time (s)."""
        reached[count] = best
        text = (
            f"{count} positions, {seconds:6.1f} s: best {options['objective']} so far {best:.6g} "
            f"after {spent} evaluations"
        )
        if len(reached) > 1:
            of = min(reached, key=lambda each: reached[each])
            text += f"; of all numbers {reached[of]:.6g}, {of} positions"
        say(text)

    settings: dict[str, Any] = {
        "seed": options["seed"], "time_limit": options["time_limit"], "rounds": options["rounds"],
        "workers": options["workers"],
    }  # fmt: skip
    if options["resume"] is not None:
        if len(counts) > 1:
            raise InputError("--resume continues one plan: say one number of --positions")
        settings |= _resumed(options["resume"], problem)
    if options["scheduler"]:
        from schuler.campaigns.execute import cluster_executor

        workers: Any = cluster_executor(options["scheduler"])
    else:
        workers = nullcontext()
    with workers as executor, status("planning") as say:
        if len(counts) == 1:
            found = [
                plan(problem, executor=executor, progress=partial(progress, counts[0]), **settings)
            ]
        else:
            found = explore(
                problem, counts, total=options["total"], executor=executor, progress=progress,
                **settings,
            )  # fmt: skip
        best = min(range(len(found)), key=lambda k: found[k].objective)
        if options["compare"]:
            found[best] = compare_objectives(
                found[best], rounds=options["compare"], seed=options["seed"],
                workers=options["workers"], executor=executor,
                progress=lambda name: say(f"for the table: the best by {name}"),
            )  # fmt: skip
    if options["json_to"] is not None:
        data = found[0].to_dict() if len(found) == 1 else {
            "schema": "schuler.plan-trade/1", "plans": [p.to_dict() for p in found]
        }  # fmt: skip
        emit_json(data, options["json_to"])
    draw(found, options["report_to"])
    if not wants_text():
        return
    echo(f"{'positions':>9}  {'dwell s':>7}  {options['objective']:>10}  {'published':>10}  "
               f"{'worst sigma':>11}   alpha,gamma or alpha,beta,gamma deg")  # fmt: skip
    for each in found:
        flat = limits.beta == (0.0, 0.0)
        shown_at = " ".join(
            ",".join(f"{v:g}" for v in (row[[0, 2]] if flat else row)) for row in each.positions
        )
        echo(f"{len(each.positions):9d}  {each.problem.dwell:7g}  {each.objective:10.4g}  "
                   f"{each.published_objective:10.4g}  {100 * each.worst_relative_sigma:9.3g} %   "
                   f"{shown_at}")  # fmt: skip
    echo()
    if len(found) > 1:
        echo("by every objective, * the least:")
        echo(by_objective({len(each.positions): each.scorecard for each in found}))
        echo()
    echo(f"{len(found[best].positions)} positions; {found[best].scorecard.headline}")
    echo(found[best].scorecard)


@command.command("drive")
@click.option(
    "--spec",
    type=InputFile(),
    required=True,
    metavar="GRADE|TOML",
    shell_complete=specs,
    help="The instrument: navigation-rlg, navigation-fog, tactical-fog, industrial-mems or a file.",
)
@click.option(
    "--aid",
    "aids",
    multiple=True,
    default=["gnss=0.1m/s,3m@1Hz"],
    show_default=True,
    metavar="KIND=SIGMA@RATE",
    help="What is measured: gnss=..., odometer=0.1m/s@10Hz, dvl=0.02m/s@1Hz, or alone "
    "master=0.1mrad,0.02m/s@10Hz (velocity alone without mrad).",
)
@click.option("--vehicle", type=click.Choice(["car", "ship", "aircraft"]), default="car",
              show_default=True, help="What it can do: turn, brake, rock.")  # fmt: skip
@click.option("--speed", type=Number(0.1, 3600.0, unit="m/s"), default=12.0, show_default=True,
              metavar="M/S", help="At the start of the manoeuvre.")  # fmt: skip
@click.option("--time", type=Seconds(2.0, 3600.0), default="20s", show_default=True,
              help="Of the manoeuvre.")  # fmt: skip
@click.option("--before", type=Seconds(2.0, 3600.0), default="30s", show_default=True,
              help="Steady and straight before it, which the alignment has as well.")  # fmt: skip
@click.option("--lat", type=Number(-89.0, 89.0, unit="deg"), default=45.0, show_default=True,
              metavar="DEG", help="Latitude.")  # fmt: skip
@json_option("Write the plan as JSON (- : here).")
def drive(**options: Any) -> None:
    """Say which manoeuvre helps the heading of an alignment in motion most.

    \b
      schuler plan drive --spec tactical-fog --speed 12 --time 20s
      schuler plan drive --spec navigation-fog --vehicle aircraft --speed 70 --json -
    """  # noqa: D301
    from schuler.alignment.moving.manoeuvres import plan_drive
    from schuler.cli.limit_path import planned_aids
    from schuler.earth import Site

    found = plan_drive(
        options["spec"], planned_aids(options["aids"]), vehicle=options["vehicle"],
        speed=options["speed"], time=options["time"], before=options["before"],
        site=Site(options["lat"]),
    )  # fmt: skip
    if options["json_to"] is not None:
        emit_json(found.to_dict(), options["json_to"])
    if wants_text():
        echo(str(found))


def _counts(text: str) -> range:
    low, dash, high = text.partition("-")
    try:
        counts = range(int(low), int(high if dash else low) + 1)
    except ValueError:
        counts = range(0)
    if not counts:
        raise InputError(f"--positions: expected a number, or two as 4-12, got '{text}'")
    return counts


def _pair(text: str, name: str) -> tuple[float, float]:
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--{name}: expected two numbers as 0,360, got '{text}'") from None
    return low, high


def _resumed(path: str, problem: Any) -> dict[str, Any]:
    """Return what `plan` needs to resume from an earlier result."""
    from pathlib import Path

    import numpy as np

    from schuler._files import parse_json
    from schuler.centrifuge import evaluate_positions

    try:
        data = parse_json(Path(path).read_bytes())
        positions = np.array(data["positions"], dtype=np.float64)
        first = int(data["rounds"])
        fits = (
            positions.shape == (problem.positions, 3)
            and data["objective_name"] == problem.objective.name
            and data["dwell_s"] == problem.dwell
            and first >= 0
        )
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{path}: is not a plan that `schuler plan --json` wrote") from None
    if not fits:
        raise InputError(
            f"{path}: is a plan of another number of positions, dwell or objective; say the same"
        )
    value = float(evaluate_positions(problem, positions[None])[0])
    return {"first_round": first, "best": (value, positions)}
