"""What do blocks cost against the decomposition of the whole record? A hundred simulated trucks.

``python -m tests.prefilter.blocks_table`` (make validate) writes the table of
``docs/prefilter.md``: the azimuth error of the velocity filter and of the default method behind the
decomposition of the whole record and of blocks, how far the heading is from the one with the whole
record, and how far the filtered velocity is.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import schuler as sc
from schuler.prefilter import VelocityEmd
from schuler.published import conditions, yu_emd
from schuler.published.result import misalignment, rms_error

PAGE = Path(__file__).resolve().parents[2] / "docs" / "prefilter.md"
BEGIN, END = "<!-- blocks table -->\n", "<!-- end of the blocks table -->"
RUNS = 100
LENGTHS = (300.0, 600.0)
WHOLE = "whole record"
WAYS = {
    "no prefilter": None,
    WHOLE: VelocityEmd(),
    "blocks of 60 s": VelocityEmd(block=60.0, overlap=15.0),
    "blocks of 100 s": VelocityEmd(block=100.0),
    "blocks of 150 s": VelocityEmd(block=150.0, overlap=50.0),
}
METHODS = ("velocity filter", "default")


def rows_of(length: float) -> list[str]:
    """Return the table's rows for records of one length, s."""
    case = conditions("yu_emd")
    settings = case["simulation"]
    site, spec = sc.Site(case["site"]["lat"]), sc.load_spec(settings["grade"])
    methods = dict(zip(METHODS, (yu_emd.kalman(case), None), strict=True))
    errors: dict[tuple[str, str], list[float]] = {(w, m): [] for w in WAYS for m in METHODS}
    off: dict[str, list[float]] = {w: [] for w in WAYS}
    for k in range(RUNS):
        rng = np.random.default_rng([0, 3, k])
        motion = sc.motion.DisturbedVehicle.with_crew(rng, length, heading=rng.uniform(0, 360))
        made = sc.simulate(motion, site, length, settings["rate"], spec, rng)
        truth = made.truth.known("quat_nb")[-1]
        velocity = {}
        for way, prefilter in WAYS.items():
            record = made.record if prefilter is None else prefilter(made.record)
            velocity[way], _ = VelocityEmd().velocity(record)
            for name, method in methods.items():
                fix = sc.align(record, site, method, spec)
                errors[way, name].append(float(misalignment(fix.quat_nb, truth)[2]))
        for way in WAYS:
            off[way].append(float(np.sqrt(np.mean((velocity[way] - velocity[WHOLE]) ** 2))))
    lines = []
    for way in WAYS:
        cells = [f"{length:g} s", way]
        cells += ["{:.2f} ± {:.2f}".format(*rms_error(errors[way, name])) for name in METHODS]
        for name in METHODS:
            apart = np.subtract(errors[way, name], errors[WHOLE, name])
            cells.append("–" if way == WHOLE else f"{rms_error(apart)[0]:.2f}")
        cells.append("–" if way == WHOLE else f"{1e3 * rms_error(off[way])[0]:.1f}")
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def main() -> None:
    """Run all, print it, and write the page's table."""
    lines = [
        "| record | decomposed | velocity filter, ′ | default, ′ | apart from whole, ′ | "
        "the same, default | velocity apart, mm/s |",
        "|---|---|---:|---:|---:|---:|---:|",
    ]
    for length in LENGTHS:
        lines += rows_of(length)
    text = "\n".join(lines) + "\n"
    print(text)
    page = PAGE.read_text(encoding="utf-8")
    head, _, rest = page.partition(BEGIN)
    _, mark, tail = rest.partition(END)
    if not mark:
        sys.exit(f"{PAGE} has no place for the table: {BEGIN.strip()} ... {END}")
    PAGE.write_text(head + BEGIN + text + mark + tail, encoding="utf-8")


if __name__ == "__main__":
    main()
