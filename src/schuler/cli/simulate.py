"""The command ``schuler simulate``: a scenario file to a record and its truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from schuler.cli.command import Command, add_input, add_output, echo, wants_text
from schuler.cli.common import emit_json, json_option
from schuler.cli.completion import scenarios
from schuler.cli.parameters import Count, InputFile, OutputFile

if TYPE_CHECKING:
    from schuler.config import Scenario
    from schuler.simulation import Simulation

__all__ = ["command"]


@click.command("simulate", cls=Command)
@click.argument("scenario", type=InputFile(), metavar="SCENARIO.toml", shell_complete=scenarios)
@click.option(
    "--out", type=OutputFile(".parquet", ".csv", ".npz", ".mat", ".h5"), metavar="FILE",
    help="The record: .parquet (default: by the scenario's name), "
    ".csv, .npz, .mat or .h5.",
)  # fmt: skip
@click.option(
    "--truth",
    type=OutputFile(".parquet", ".pq"),
    metavar="PARQUET",
    help="Where the truth goes (FILE.truth.parquet).",
)
@click.option("--seed", type=Count(0, 2**63), metavar="N", help="Another seed than the scenario's.")
@click.option("--run", type=Count(0), metavar="K", help="Make run K of the scenario's campaign.")
@click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE",
    help="Set a value of the scenario: motion.heading=30, duration=60s.",
)  # fmt: skip
@json_option("Write what was made as JSON (- : here).")
def command(**options: Any) -> None:
    """Simulate the record of a scenario file, with its truth beside it.

    A file with the table [scheme] is a centrifuge test of a platform: its outputs are made, for
    `schuler calibrate centrifuge`.

    \b
      schuler simulate truck.toml --out truck.parquet
      schuler simulate truck.toml --seed 7 --set motion.heading=120 --set duration=60s
    """  # noqa: D301
    from schuler.centrifuge.files import is_test
    from schuler.config import load_scenario, parse_overrides
    from schuler.io import write, write_trajectory
    from schuler.io.trajectory import truth_path

    overrides = parse_overrides(options["overrides"])
    if is_test(options["scenario"]):
        _centrifuge_test(options, overrides)
        return
    if options["seed"] is not None:
        overrides["seed"] = options["seed"]
    scenario = load_scenario(options["scenario"], overrides)
    run = options["run"]
    out = Path(options["out"] or f"{scenario.name.replace('/', '-')}.parquet")
    truth = Path(options["truth"] or truth_path(out))
    if options["out"] is None:
        add_output("the record (--out)", out)
    if options["truth"] is None:
        add_output("the truth (--truth)", truth)
    for path in scenario.files:
        add_input("the scenario", path)
    made = scenario.run(scenario.sequence(run))
    write(made.record, out)
    about = _about(scenario, made, run)
    write_trajectory(made.truth, truth, {**about, "scenario": dict(scenario.data)})
    about = {"schema": "schuler.simulation/2", "record": str(out), "truth": str(truth), **about}
    if options["json_to"] is not None:
        emit_json(about, options["json_to"])
    if wants_text():
        _print(scenario, about)


def _centrifuge_test(options: dict[str, Any], overrides: dict[str, Any]) -> None:
    """Simulate a centrifuge test."""
    from schuler.centrifuge.files import simulate_test
    from schuler.centrifuge.outputs import outputs_truth_path, write_outputs
    from schuler.errors import InputError

    if options["truth"] is not None or options["run"] is not None:
        option = "--truth" if options["truth"] is not None else "--run"
        raise InputError(
            f"{option} is for a vehicle's record; the truth of a centrifuge test goes into "
            "FILE.truth.toml"
        )
    made = simulate_test(options["scenario"], overrides, options["seed"])
    out = Path(options["out"] or f"{made.name}.csv")
    if options["out"] is None:
        add_output("the outputs (--out)", out)
    add_output("the truth", outputs_truth_path(out))
    write_outputs(out, made.plant, made.scheme, made.outputs, made.truth)
    about = made.to_dict(str(out))
    if options["json_to"] is not None:
        emit_json(about, options["json_to"])
    if wants_text():
        echo(
            f"{made.name}: centrifuge test, {about['positions']} positions of "
            f"{made.scheme.dwell:g} s, {about['samples']} samples at {made.plant.sampling:g} Hz, "
            f"seed {made.seed}"
        )
        echo(f"outputs {out}, truth {outputs_truth_path(out)}")


def _about(scenario: Scenario, made: Simulation, run: int | None) -> dict[str, Any]:
    from schuler.constants import DEG_PER_HOUR, MICRO_G

    return {
        "name": scenario.name,
        "seed": scenario.seed,
        "run": run,
        "motion": scenario.kind,
        "instrument": None if scenario.spec is None else scenario.spec.name,
        "samples": len(made.record),
        "duration_s": scenario.duration,
        "rate_hz": scenario.rate,
        "latitude_deg": scenario.site.lat,
        "longitude_deg": scenario.site.lon,
        "height_m": scenario.site.height,
        "heading_deg": {at: made.heading_deg(at) for at in ("start", "end")},
        "gyro_bias_deg_h": [float(v) / DEG_PER_HOUR for v in made.gyro_bias],
        "accelerometer_bias_ug": [float(v) / MICRO_G for v in made.accel_bias],
        "scenario_sha256": scenario.digest,
    }


def _print(scenario: Scenario, about: dict[str, Any]) -> None:
    site, heading = scenario.site, about["heading_deg"]
    gyro, accel = about["gyro_bias_deg_h"], about["accelerometer_bias_ug"]
    seed = f"seed {about['seed']}" + ("" if about["run"] is None else f", run {about['run']}")
    echo(
        f"{about['name']}: {about['motion']}, {scenario.duration:g} s at {scenario.rate:g} Hz, "
        f"{about['samples']} samples, {seed}"
    )
    echo(f"site        {site.lat:g} deg N, {site.lon:g} deg E, {site.height:g} m")
    echo(
        f"heading     {heading['start']:.4f} deg at the start, {heading['end']:.4f} deg at the end"
    )
    if about["instrument"] is None:
        echo("instrument  without errors")
    else:
        echo(f"instrument  {about['instrument']}")
        echo(f"gyro bias   {'  '.join(f'{v:+.5f}' for v in gyro)} deg/h (x, y, z)")
        echo(f"accel bias  {'  '.join(f'{v:+.2f}' for v in accel)} ug (x, y, z)")
    echo(f"record {about['record']}, truth {about['truth']}")
