"""The command ``schuler calibrate centrifuge``: a platform's coefficients from a centrifuge."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from schuler.cli.command import CONTRADICTED, Command, add_input, echo, wants_text
from schuler.cli.common import draw, emit_json, json_option, report_option, say_warnings
from schuler.cli.parameters import Count, InputFile, Seconds
from schuler.errors import InputError, located

if TYPE_CHECKING:
    from schuler.centrifuge import CentrifugeScheme, Plant

__all__ = ["centrifuge"]


@click.command("centrifuge", cls=Command)
@click.argument("file", type=InputFile(), required=False)
@click.option(
    "--plant", type=InputFile(), metavar="TOML",
    help="Force, rate, gimbal order, noise ...: a file with the table [plant].",
)  # fmt: skip
@click.option(
    "--scheme", type=InputFile(), metavar="TOML",
    help="Positions, dwell, forces: a file with the table [scheme].",
)  # fmt: skip
@click.option(
    "--truth", type=InputFile(), metavar="TOML",
    help="True coefficients, the table [truth]; FILE.truth.toml is found by itself.",
)  # fmt: skip
@click.option("--accel", metavar="UNIT", help="Unit of the outputs in FILE (g).")
@click.option(
    "--dwell",
    type=Seconds(above=0.0, high=1e6),
    help="At a position, where no scheme says it; 100s.",
)
@click.option("--positions", metavar="A,B,G;...", help="deg; the published scheme where left out.")
@click.option("--simulate", "seed", type=Count(0, 2**63), metavar="SEED",
              help="Simulate the test, with the published coefficients or --truth.")  # fmt: skip
@click.option(
    "--passes",
    type=Count(1, 100),
    default=4,
    show_default=True,
    help="Of the filter; 1: no iteration.",
)
@click.option("--square-root", is_flag=True, help="Carry a square root of the covariance.")
@json_option()
@report_option("Draw what the test shows.")
def centrifuge(**options: Any) -> None:
    """Find a platform's coefficients from a centrifuge test, or say what the test would show.

    FILE: outputs of the three accelerometers, as columns t, ax, ay, az and position, where the
    positions are numbered. The time counts from an instant when the arm stood along the base's x.
    Without FILE the scheme alone is judged; `schuler simulate` makes a file from a test in TOML.

    \b
      schuler calibrate centrifuge outputs.csv --plant plant.toml --scheme scheme.toml
      schuler calibrate centrifuge --dwell 100s
      schuler calibrate centrifuge --simulate 1 --report platform.html
    """  # noqa: D301
    import numpy as np

    from schuler.centrifuge import Ekf, identify, simulate_platform
    from schuler.centrifuge.outputs import outputs_truth_path, read_outputs

    path, seed = options["file"], options["seed"]
    if path is not None and seed is not None:
        raise InputError("--simulate makes outputs of its own: leave FILE out, or --simulate")
    if path is None and options["accel"] is not None:
        raise InputError("--accel is for the outputs of a file: name one")
    told = options["truth"]
    if path is not None and told is None and (beside := outputs_truth_path(path)).is_file():
        told = str(beside)
        add_input("the truth", beside)
    plant, scheme = _plant_and_scheme(options, told if path is not None else None)
    truth = _truth(told, plant, needed=seed is not None)
    method = Ekf(passes=options["passes"], square_root=options["square_root"])
    outputs: Any = None
    first = None
    if path is not None:
        outputs, first = read_outputs(path, plant, len(scheme.positions), options["accel"] or "g")
    elif seed is not None:
        rng = np.random.default_rng(seed)
        outputs = simulate_platform(
            plant, scheme.positions, scheme.dwell, truth, rng, forces=scheme.forces or None
        )[0]
    found = identify(plant, scheme, outputs, method, first=first, truth=truth)
    if options["json_to"] is not None:
        emit_json(found.to_dict(), options["json_to"])
    draw(found, options["report_to"])
    if wants_text():
        echo(found)
    say_warnings(found.remarks)
    if found.remarks:
        click.get_current_context().exit(CONTRADICTED)


def _plant_and_scheme(
    options: dict[str, Any], beside: str | None
) -> tuple[Plant, CentrifugeScheme]:
    """Return what was said, or what the truth of a simulated file says, or as published."""
    from dataclasses import replace

    from schuler._files import read_toml
    from schuler.centrifuge import CentrifugeScheme, Plant
    from schuler.centrifuge.files import plant_from_toml, scheme_from_toml
    from schuler.centrifuge.scheme import published_test

    known = set() if beside is None else set(read_toml(beside))

    def source(name: str) -> str | None:
        given: str | None = options[name]
        return given or (beside if name in known else None)

    at = source("plant")
    plant = Plant() if at is None else plant_from_toml(at)
    at = source("scheme")
    if options["positions"] is not None:
        if options["scheme"] is not None:
            raise InputError("--positions and --scheme both say where the platform is put: say one")
        scheme = CentrifugeScheme(_positions(options["positions"]))
    else:
        scheme = published_test(plant) if at is None else scheme_from_toml(at)
    if options["dwell"] is not None:
        scheme = replace(scheme, dwell=options["dwell"])
    elif options["positions"] is not None and at is not None:
        scheme = replace(scheme, dwell=scheme_from_toml(at).dwell)
    return plant, scheme


def _truth(told: str | None, plant: Plant, needed: bool) -> Any:
    from schuler._files import read_toml
    from schuler.centrifuge.files import true_coefficients

    if told is None:
        return true_coefficients({}, plant) if needed else None
    data = read_toml(told)
    with located(Path(told)):
        return true_coefficients(data.get("truth", {} if "plant" in data else data), plant)


def _positions(text: str) -> Any:
    try:
        return tuple(tuple(float(v) for v in part.split(",")) for part in text.split(";"))
    except ValueError:
        raise InputError(
            f"--positions: expected alpha,beta,gamma;... in deg, got '{text}'"
        ) from None
