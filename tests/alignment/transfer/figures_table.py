"""Transfer alignment of a pod on an aircraft: rms errors, NEES, and what straight flight hides.

``python -m tests.alignment.transfer.figures_table`` (make validate) runs all cells and writes the
table of ``docs/how-to/transfer.md``. A number of runs may follow.
"""

from __future__ import annotations

import sys

import numpy as np

import schuler as sc
from schuler.alignment.transfer import Flexure, MasterNoise
from tests.alignment.transfer.aircraft import ATTITUDE, VELOCITY, case, errors
from tests.conftest import ROOT, chi_square_band

PAGE = ROOT / "docs" / "how-to" / "transfer.md"
BEGIN, END = "<!-- transfer figures -->", "<!-- end of transfer figures -->"
CELLS = (
    ("rock", 0.0, "wing rock, 10 s"), ("rock", 1e-3, "wing rock, flexure"),
    ("turn", 0.0, "45° turn, 20 s"), ("turn", 1e-3, "45° turn, flexure"),
    ("straight", 0.0, "straight, 20 s"),
)  # fmt: skip
AXES = ("east", "north", "up")


def cell(path: str, bends: float, runs: int) -> str:
    """Return a row of the table for seeds 0 to runs - 1; a band that is left is an error."""
    phi, nees, mount, late, sigma = [], [], [], [], []
    unseen = []
    for seed in range(runs):
        record, master, made, mounting = case(path, seed, flexure=bends)
        fix = sc.transfer(
            record, master, spec="tactical-fog", noise=MasterNoise(ATTITUDE, VELOCITY),
            flexure=Flexure(bends) if bends else None,
        )  # fmt: skip
        p, m, _, dt = errors(fix, made, mounting)
        phi.append(p)
        sigma.append(np.diag(fix.covariance))
        nees.append(p @ np.linalg.solve(fix.covariance, p))
        mount.append(m @ np.linalg.solve(fix.mounting_covariance, m))
        late.append(dt)
        unseen.append({"heading", "mounting about up"} <= set(fix.not_observable))
    low, high = (each / (3 * runs) for each in chi_square_band(3 * runs, 0.05))
    ratio, of_mount = np.mean(nees) / 3.0, np.mean(mount) / 3.0
    print(f"{path} {bends}: NEES/3 {ratio:.3f} in {low:.2f} to {high:.2f}, mounting {of_mount:.3f}")
    assert np.mean(nees) * runs < chi_square_band(3 * runs, 1e-4)[1]
    assert (path == "straight") == all(unseen)
    rms = 1e3 * np.sqrt(np.mean(np.square(phi), axis=0))
    stated = 1e3 * np.sqrt(np.mean(sigma, axis=0))
    each = " | ".join(f"{r:.2g} ({s:.2g})" for r, s in zip(rms, stated, strict=True))
    delay = f"{1e3 * np.sqrt(np.mean(np.square(late))):.2g}"
    return f"{each} | {delay} | {ratio:.2f} | {of_mount:.2f} |"


def main(runs: int) -> None:
    """Run all cells and write the table."""
    rows = [
        f"{runs} runs; rms error (stated 1-sigma) of the attitude, mrad:", "",
        f"| flight | {' | '.join(AXES)} | delay, ms | NEES/3 | NEES/3 of the mounting |",
        "|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    for path, bends, name in CELLS:
        rows.append(f"| {name} | {cell(path, bends, runs)}")
    text = PAGE.read_text(encoding="utf-8")
    first, rest = text.split(BEGIN)
    last = rest.split(END)[1]
    body = "\n".join(rows)
    PAGE.write_text(f"{first}{BEGIN}\n{body}\n{END}{last}", encoding="utf-8")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
