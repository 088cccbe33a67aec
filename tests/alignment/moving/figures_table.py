"""Alignment in motion beside its bound: five routes, two grades, a hundred seeded runs each.

``python -m tests.alignment.moving.figures_table`` (make validate) runs all cells and writes the
table of ``docs/concepts/in-motion.md``. A number of runs may follow.

All cells have the same seeds, so one draw of the biases is in many of them. A cell whose NEES
leaves its 95 % band is run again with a thousand other seeds, which say whether that was chance.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace

import numpy as np

import schuler as sc
from schuler.aiding import BodySpeed, GnssFixes
from schuler.attitude import nearest_quat
from schuler.constants import ARCMIN
from schuler.in_motion.body import body_rows
from schuler.in_motion.coarse import coarse
from schuler.in_motion.series import (
    body_velocity_series,
    position_series,
    velocity_series,
)
from schuler.sensors import GRADES
from tests.alignment.moving.routes import (
    ROUTES,
    SITE,
    body_speed,
    fixes,
    heading_error,
    noisy,
    truth_of,
)
from tests.conftest import ROOT, chi_square_band

PAGE = ROOT / "docs" / "concepts" / "in-motion.md"
MARK = "<!-- table -->\n"
AGAIN = "<!-- cells again -->\n"
MORE = 1000
LENGTHS = (60.0, 120.0, 300.0)


@dataclass(frozen=True)
class Cell:
    """A route, an instrument, a length and what is measured."""

    route: str
    grade: str
    length: float
    aid: str = "velocity and position"
    sigma: float = 0.1


CELLS = (
    *(Cell(route, grade, length) for route in ROUTES for grade in ("navigation-fog", "tactical-fog")
      for length in LENGTHS),
    *(Cell(route, "navigation-fog", length, "position") for route in ("car", "plane")
      for length in LENGTHS),
    *(Cell("ship", "navigation-fog", length, "body velocity", 0.02) for length in LENGTHS[1:]),
    *(Cell("car", "navigation-fog", length, "body velocity", 0.05) for length in LENGTHS[1:]),
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """What came of a cell: bound (arcmin), ratios to it, and NEES/3 of the attitude."""

    cell: Cell
    bound: float
    coarse: float
    coarse_sigma: float
    fine: float
    nees: float
    runs: int
    refused: int


def _aid(made, cell: Cell, rng=None) -> GnssFixes | BodySpeed:
    if cell.aid == "body velocity":
        return body_speed(made, sigma=cell.sigma, rng=rng)
    gnss = fixes(made, rng=rng)
    return replace(gnss, v_n=None) if cell.aid == "position" else gnss


def _coarse(record, aid, spec, made):
    rows = body_rows(record, aid.time)
    k = len(record)
    end = rows.mat_ib0_b[-1], rows.turn[-1]
    place = made.truth.lat[k], made.truth.lon[k]
    if isinstance(aid, BodySpeed):
        found = None
        for _ in range(4):
            about = None if found is None else found.mat_i0_ib0
            series = body_velocity_series(rows, aid, SITE, about)
            found = coarse(series, spec, place, record.end, *end)
        return found
    make = position_series if aid.v_n is None else velocity_series
    return coarse(make(rows, aid), spec, place, record.end, *end)


def run(cell: Cell, runs: int) -> Row:
    """Return the row of one cell."""
    made = truth_of(ROUTES[cell.route](), cell.length)
    spec, true = GRADES[cell.grade], made.truth.quat_nb[-1]
    bound = sc.limit_on(made.truth, spec, _aid(made, cell), record=made.record).sigma_arcmin[2]
    rough, rough_sigma = [], []
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        aid, record = _aid(made, cell, rng), noisy(made, cell.grade, rng)
        first = _coarse(record, aid, spec, made)
        rough.append(heading_error(nearest_quat(first.mat_nb), true)[2] / ARCMIN)
        rough_sigma.append(first.heading_sigma / ARCMIN)
    fine, nees, refused = _fine(made, cell, range(runs))
    return Row(
        cell, bound, _rms(rough) / bound, _rms(rough_sigma) / _rms(rough), _rms(fine) / bound,
        float(np.mean(nees)), len(fine), refused,
    )  # fmt: skip


def _fine(made, cell: Cell, seeds: range):
    """Return the heading's errors (arcmin) and NEES/3 of the fine stage, and how many refuse."""
    spec, true = GRADES[cell.grade], made.truth.quat_nb[-1]
    fine, nees, refused = [], [], 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        aid, record = _aid(made, cell, rng), noisy(made, cell.grade, rng)
        try:
            fix = sc.align(record, SITE, aiding=aid, spec=spec, vibration=0.0)
        except sc.InputError:
            refused += 1
            continue
        error = heading_error(fix.quat_nb, true)
        fine.append(error[2] / ARCMIN)
        nees.append(error @ np.linalg.solve(fix.covariance, error) / 3.0)
    return fine, nees, refused


def again(rows: list[Row], band: tuple[float, float]) -> str:
    """Return the cells that leave the band with a thousand other seeds, as a table."""
    lines = [
        "| route | grade | s | measured | NEES / 3, seeds 0 to 99 | seeds 1000 to 1999 | "
        "fine / bound |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        if band[0] <= row.nees <= band[1]:
            continue
        c = row.cell
        made = truth_of(ROUTES[c.route](), c.length)
        fine, nees, _ = _fine(made, c, range(1000, 1000 + MORE))
        error = np.std(nees) / np.sqrt(len(nees))
        lines.append(
            f"| {c.route} | {c.grade} | {c.length:.0f} | {c.aid} | {row.nees:.2f} | "
            f"{np.mean(nees):.3f} ± {error:.3f} | {_rms(fine) / row.bound:.2f} |"
        )
        print(lines[-1], flush=True)
    return "\n".join(lines) + "\n"


def _rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else np.nan


def table(rows: list[Row]) -> str:
    """Return the rows as a Markdown table."""
    lines = [
        "| route | grade | s | measured | bound | coarse / bound | coarse sigma / rms | "
        "fine / bound | NEES / 3 | runs |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        c = row.cell
        aid = c.aid if c.aid != "body velocity" else f"{c.aid}, {c.sigma:g} m/s"
        cells = (
            c.route, c.grade, f"{c.length:.0f}", aid, f"{row.bound:.3g}′", f"{row.coarse:.2f}",
            f"{row.coarse_sigma:.2f}", f"{row.fine:.2f}", f"{row.nees:.2f}", row.runs,
        )  # fmt: skip
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run all cells and write their table into the page."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    rows = []
    for cell in CELLS:
        rows.append(run(cell, runs))
        print(table(rows[-1:]).splitlines()[-1], f"refused {rows[-1].refused}", flush=True)
    low, high = (x / (3 * runs) for x in chi_square_band(3 * runs, 0.05))
    print(f"95 % band of NEES / 3 for {runs} runs: {low:.2f} to {high:.2f}")
    if runs == 100:
        text = PAGE.read_text(encoding="utf-8")
        for mark, body in ((MARK, table(rows)), (AGAIN, again(rows, (low, high)))):
            head, _, rest = text.partition(mark)
            _, _, tail = rest.partition(mark)
            text = f"{head}{mark}{body}{mark}{tail}"
        PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
