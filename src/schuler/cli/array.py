"""The command ``schuler array``: what a geometry of redundant gyros is worth."""

from __future__ import annotations

from typing import Any

import click

from schuler.cli.command import Command, echo, wants_text
from schuler.cli.common import emit_json, json_option, report_option
from schuler.cli.parameters import Number, Seconds

__all__ = ["command"]


@click.command("array", cls=Command)
@click.argument("geometry", metavar="NAME|TOML")
@click.option("--mtbf", type=float, default=5000.0, show_default=True, metavar="H",
              help="Mean life of one sensor, h.")  # fmt: skip
@click.option("--weibull", type=Number(0.01, 100.0), default=1.0, show_default=True, metavar="K",
              help="Shape of the lives: 1 is exponential.")  # fmt: skip
@click.option("--coverage", type=Number(0.0, 1.0), default=1.0, show_default=True, metavar="C",
              help="Chance that a failure is found and shut out.")  # fmt: skip
@click.option("--mission", default="1000h,2000h,5000h,10000h", show_default=True, metavar="LIST",
              help="Times at which the reliability is told.")  # fmt: skip
@json_option("Write the figures as JSON (- : here).")
@report_option("Draw variances and reliability.")
def command(**options: Any) -> None:
    """Say what an array of gyros is worth: fusion, failures, reliability.

    GEOMETRY is triad, triad-plus-one, symmetric4, cone4 (cone5 ...), tetrahedron, skewed4,
    dodecahedron, or a TOML file with directions.

    \b
      schuler array symmetric4 --json -
      schuler array mine.toml --mtbf 20000 --coverage 0.95 --report mine.html
    """  # noqa: D301
    from schuler.sensors import Lifetime, Reliability, isolable, load_array

    array = load_array(options["geometry"])
    life = Lifetime(options["mtbf"], options["weibull"])
    reliability = Reliability(array, life, options["coverage"])
    convert = Seconds().convert
    hours = [convert(t.strip(), None, None) / 3600.0 for t in options["mission"].split(",")]
    figures = array.figures()
    gram = array.h.T @ array.h
    data = {
        "schema": "schuler.array/1",
        "name": array.name,
        "sensors": len(array),
        "H": array.h.tolist(),
        "HtH": _rounded(gram),
        "optimal": figures["optimal"],
        "total_variance": float(f"{figures['total_variance']:.12g}"),
        "determinant": float(f"{figures['determinant']:.12g}"),
        "condition": float(f"{figures['condition']:.12g}"),
        "subset_variance": {k: _rounded(v) for k, v in array.subset_variance().items()},
        "isolable": len(array) > 3 and isolable(array),
        "sensor_mtbf_h": life.mtbf,
        "weibull_shape": life.shape,
        "coverage": reliability.coverage,
        "mtbf_h": reliability.mtbf,
        "mtbf_ratio_to_triad": reliability.mtbf / _triad(life, options["coverage"]),
        "reliability": {f"{t:g}": float(reliability.at(t)) for t in hours},
    }
    if options["json_to"] is not None:
        emit_json(data, options["json_to"])
    if options["report_to"] is not None:
        from schuler.reports.array import array_report

        array_report(array, reliability, options["report_to"])
    if wants_text():
        _print(data)


def _rounded(values: Any) -> Any:
    """Return nested lists of numbers to twelve digits: what is exact reads as exact."""
    if hasattr(values, "tolist"):
        values = values.tolist()
    if isinstance(values, list):
        return [_rounded(v) for v in values]
    return round(float(values), 12) + 0.0


def _triad(life: Any, coverage: float) -> float:
    from schuler.sensors import Reliability, load_array

    return Reliability(load_array("triad"), life, coverage).mtbf


def _print(data: dict[str, Any]) -> None:
    echo(f"{data['name']}: {data['sensors']} sensors, total variance "
               f"{data['total_variance']:.4g} (at best {9 / data['sensors']:.4g})")  # fmt: skip
    echo(f"{'working':<14} {'x':>7} {'y':>7} {'z':>7} {'total':>7}")
    for key, v in data["subset_variance"].items():
        if key.count(",") >= data["sensors"] - 2:
            echo(f"{key:<14} {v[0]:7.4f} {v[1]:7.4f} {v[2]:7.4f} {sum(v):7.4f}")
    if not data["isolable"]:
        echo(
            "one wrong sensor can be seen, not told, from the parity alone"
            if data["sensors"] > 3 else "a wrong sensor cannot be seen: there is no redundancy"
        )  # fmt: skip
    echo(
        f"MTBF {data['mtbf_h']:.1f} h, {data['mtbf_ratio_to_triad']:.3g} times that of three "
        f"(one sensor {data['sensor_mtbf_h']:g} h, coverage {data['coverage']:g})"
    )
    told = ", ".join(f"{v:.4f} at {t} h" for t, v in data["reliability"].items())
    echo(f"reliability {told}")
