"""The command ``schuler demo``, a simulated truck beside its truth."""

from __future__ import annotations

from pathlib import Path

import click

from schuler.cli.command import Command, add_output, echo
from schuler.cli.parameters import Count, Number
from schuler.errors import InputError, how_to_install

__all__ = ["command"]


@click.command("demo", cls=Command)
@click.option(
    "--out", default="out", show_default=True, type=click.Path(), metavar="FOLDER",
    help="Where the record, the report and the result go.",
)  # fmt: skip
@click.option(
    "--seed", type=Count(0, 2**63), default=2, show_default=True, help="Seed of the simulation."
)
@click.option(
    "--minutes",
    type=Number(0.2, 600.0),
    default=10.0,
    show_default=True,
    help="Length of the record.",
)
def command(out: str, seed: int, minutes: float) -> None:
    """Simulate a truck with its crew at work, find north, compare with the truth, draw a report.

    A navigation-grade fibre-optic unit at 100 Hz; everything is made on this machine.

    \b
      schuler demo
      schuler demo --out here --minutes 2 --seed 7
    """  # noqa: D301
    from importlib.util import find_spec

    import numpy as np

    import schuler as sc
    from schuler.cli.common import emit_json
    from schuler.motion import DisturbedVehicle
    from schuler.sensors import GRADES
    from schuler.simulation import simulate

    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error.strerror})") from None
    rng = np.random.default_rng(seed)
    site = sc.Site(lat=40.0, lon=116.3, height=50.0)
    spec = GRADES["navigation-fog"]
    truck = DisturbedVehicle.draw(rng, 60 * minutes, heading=57.3, pitch=1.2, roll=-0.8)
    made = simulate(truck, site, 60 * minutes, 100.0, spec, rng, name="demo truck")
    path = folder / "demo.parquet"
    for name in ("demo.parquet", "demo.html", "demo.json"):
        add_output("--out", folder / name)
    sc.write(made.record, path)

    record = sc.read(path)
    fix = sc.align(record, site, spec=spec)
    fix = fix.noting(
        [],
        {
            "file": str(path),
            "latitude": f"{site.lat:g} deg",
            "height": f"{site.height:g} m",
            "method": repr(fix.method),
            "specification": spec.name,
            "simulation": f"seed {seed}, {minutes:g} min at 100 Hz, true heading "
            f"{made.heading_deg():.5f} deg at the end",
        },
    )
    drawn = find_spec("plotly") is not None
    if drawn:
        sc.report(fix, folder / "demo.html")
    emit_json(fix.to_dict(), str(folder / "demo.json"))

    truth = made.heading_deg()
    off = ((fix.heading_deg - truth + 180.0) % 360.0 - 180.0) * 60.0
    echo(str(fix))
    echo(
        f"truth: heading {truth:.3f} deg; the estimate is off by {off:+.2f}' "
        f"({abs(off) / float(fix.sigma_arcmin[2]):.1f} sigma)"
    )
    report = f"report {folder / 'demo.html'}, " if drawn else ""
    echo(f"record {path}, {report}result {folder / 'demo.json'}")
    if not drawn:
        echo(
            "note: reports are drawn by Plotly, which is not installed: "
            + how_to_install("report"),
            err=True,
        )
