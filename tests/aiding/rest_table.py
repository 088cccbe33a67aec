"""What rest before and after a drive is worth for the heading.

``python -m tests.aiding.rest_table [RUNS]`` (make validate) writes the table of
``docs/how-to/align-while-driving.md``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import schuler as sc
from schuler.aiding import ZeroVelocity
from schuler.constants import ARCMIN
from schuler.motion import Manoeuvre, Route
from schuler.sensors import GRADES
from tests.alignment.moving.routes import fixes, heading_error, noisy, truth_of

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "align-while-driving.md"
BEGIN, END = "<!-- rest table -->\n", "<!-- end of the rest table -->"
GRADE = "navigation-fog"
REST = ZeroVelocity([(0.0, 120.0), (186.0, 306.0)], sigma=0.005)


def route() -> Route:
    """Return two minutes at rest, one of driving, and two at rest."""
    return Route(
        [
            Manoeuvre(120.0), Manoeuvre(12.0, speed=12.0), Manoeuvre(10.0, turn=90.0),
            Manoeuvre(12.0), Manoeuvre(8.0, turn=-60.0), Manoeuvre(12.0),
            Manoeuvre(12.0, speed=-12.0), Manoeuvre(120.0),
        ], heading=40.0,
    )  # fmt: skip


def lines(runs: int) -> list[str]:
    """Return the table."""
    perfect, spec = truth_of(route(), 306.0), GRADES[GRADE]
    out = [
        f"Two minutes at rest, one of driving, two at rest; {GRADE}, fixes of 3 m and 0.1 m/s each",
        f"second; {runs} runs, heading at the end, arcmin.", "",
        "| aids | rms error | stated | bound | rms / bound |", "|---|---|---|---|---|",
    ]  # fmt: skip
    for name, more in (("fixes", []), ("fixes and rest", [REST])):
        plan = [fixes(perfect, first=1.0), *more]
        bound = sc.limit_on(perfect.truth, spec, plan, record=perfect.record).sigma_arcmin[2]
        errors, stated = [], []
        for seed in range(runs):
            rng = np.random.default_rng(seed)
            record = noisy(perfect, GRADE, rng)
            fix = sc.align(record, aiding=[fixes(perfect, rng=rng, first=1.0), *more], spec=spec)
            errors.append(heading_error(fix.quat_nb, perfect.truth.quat_nb[-1])[2] / ARCMIN)
            stated.append(fix.sigma_arcmin[2])
        rms = float(np.sqrt(np.mean(np.square(errors))))
        out.append(
            f"| {name} | {rms:.2f} | {np.mean(stated):.2f} | {bound:.2f} | {rms / bound:.2f} |"
        )
    return out


def main() -> None:
    """Compute the table and write it into the page."""
    table = "\n".join(lines(int(sys.argv[1]) if len(sys.argv) > 1 else 100))
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    PAGE.write_text(f"{before}{BEGIN}{table}\n{END}{after}", encoding="utf-8")
    print(table)


if __name__ == "__main__":
    main()
