"""Does decomposing the velocity pay? A hundred simulated records, and the real vehicle record.

``python -m tests.prefilter.velocity_table`` (make validate) writes the table of
``docs/prefilter.md``, which the page's picture draws. The simulated columns are those of
``schuler published run yu_emd --runs 100``; those of the real record need the shared records.
"""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import schuler as sc
from schuler import published
from schuler.alignment.history import inertial_to_local
from schuler.attitude import quat_to_matrix, quat_to_rotvec
from schuler.constants import ARCMIN
from schuler.prefilter import VelocityEmd
from schuler.prefilter.base import held_frame
from schuler.published import conditions, yu_emd
from schuler.published.result import misalignment, rms_error

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "prefilter.md"
BEGIN, END = "<!-- velocity table -->\n", "<!-- end of the velocity table -->"
RUNS, ENSEMBLE_RUNS, ENSEMBLE = 100, 100, 10
LENGTHS = (100.0, 150.0, 200.0, 300.0)


def vehicle() -> Path:
    """Return the real record's file."""
    folder = Path(os.environ.get("SCHULER_DATA") or ROOT.parent / "shared" / "data")
    return folder / "psins_lasergyro_vehicle" / "lasergyro.imu"


def heading_offset(fix: sc.Alignment, record: sc.ImuRecord, reference: np.ndarray) -> float:
    """Return how far the attitude at the end of a record is about the vertical, arcmin.

    Parameters
    ----------
    fix : Alignment
        At the end.
    record : ImuRecord
    reference : (3, 3) float64
        C_b^i0 at the start of the record, i0 being frozen there.
    """
    tracked = quat_to_matrix(held_frame(record)[-1])
    true = inertial_to_local(fix.history.duration, fix.site.latitude) @ reference @ tracked
    phi = quat_to_rotvec(sc.attitude.nearest_quat(quat_to_matrix(fix.quat_nb) @ true.T))
    return -float(phi[2]) / ARCMIN


def on_the_vehicle() -> dict[str, list[float]]:
    """Return the rms heading offsets, arcmin, of each way in windows of each length.

    The reference is the default method on the whole record of half an hour, carried to the end of
    each window by the gyros.
    """
    record = sc.read(vehicle())
    site = sc.Site(34.246048, 108.909664, 380.0)
    whole = sc.align(record, site, spec="navigation-rlg", at="start")
    start = quat_to_matrix(whole.quat_nb)
    start = inertial_to_local(0.0, site.latitude).T @ start
    track = quat_to_matrix(held_frame(record))
    case = conditions("yu_emd")
    ways = {name: (each, yu_emd.kalman(case)) for name, each in yu_emd.filters(case).items()}
    ways[yu_emd.ROBUST] = (None, yu_emd.kalman(case, "igg3"))
    ways[yu_emd.DEFAULT] = (None, None)
    rate = 1.0 / float(np.median(record.dt))
    out: dict[str, list[float]] = {name: [] for name in ways}
    for length in LENGTHS:
        rows = round(length * rate)
        offsets: dict[str, list[float]] = {name: [] for name in ways}
        for k in range(len(record) // rows):
            part = record.rows(k * rows, (k + 1) * rows)
            # C_b^n at the window's start, and i0 frozen anew there.
            now = inertial_to_local(k * length, site.latitude) @ start
            now = now @ (track[k * rows - 1] if k else np.eye(3))
            reference = inertial_to_local(0.0, site.latitude).T @ now
            for name, (prefilter, method) in ways.items():
                smooth = part if prefilter is None else prefilter(part)
                fix = sc.align(smooth, site, method, "navigation-rlg")
                offsets[name].append(heading_offset(fix, part, reference))
        for name, found in offsets.items():
            out[name].append(rms_error(found)[0])
    return out


def by_ensemble() -> tuple[list[str], float]:
    """Return the azimuth rms of records before which CEEMDAN stands, and its time, s."""
    import time

    case = conditions("yu_emd")
    settings = case["simulation"]
    site, spec = sc.Site(case["site"]["lat"]), sc.load_spec(settings["grade"])
    cells, spent = [], 0.0
    errors: dict[float, list[float]] = {length: [] for length in LENGTHS}
    design = VelocityEmd(ends="mirror", ensemble=ENSEMBLE)
    for k in range(ENSEMBLE_RUNS):
        rng = np.random.default_rng([0, 3, k])
        motion = sc.motion.DisturbedVehicle.with_crew(rng, 300.0, heading=rng.uniform(0, 360))
        made = sc.simulate(motion, site, 300.0, settings["rate"], spec, rng)
        truth = made.truth.known("quat_nb")
        for length in LENGTHS:
            rows = round(length * settings["rate"])
            begin = time.perf_counter()
            smooth = replace(design, seed=k)(made.record.rows(0, rows))
            spent = time.perf_counter() - begin
            fix = sc.align(smooth, site, yu_emd.kalman(case), spec)
            errors[length].append(float(misalignment(fix.quat_nb, truth[rows])[2]))
    cells = ["{:.1f} ± {:.1f}".format(*rms_error(errors[length])) for length in LENGTHS]
    return cells, spent


def table(found: published.Experiment, real: dict[str, list[float]]) -> str:
    """Return the rows of the page's table."""
    case = conditions("yu_emd")
    names = [*yu_emd.filters(case), yu_emd.ROBUST, yu_emd.DEFAULT]
    lines = [
        "| way | heading curve, std | 100 s | 150 s | 200 s | 300 s | real: 100 s | 150 s | 200 s |"
        " 300 s |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]

    def cell(row: published.Row) -> str:
        assert row.document_method is not None
        digits = 2 if row.document_method < 10.0 else 1 if row.document_method < 100.0 else 0
        return f"{row.document_method:.{digits}f} ± {float(row.note.split()[2]):.{digits}f}"

    for name in names:
        if name == yu_emd.DEFAULT:
            # The default has no curve of its own: it is solved anew for each length.
            rows = [found.row(f"azimuth rms at {end:g} s, Kalman, {yu_emd.NONE}")
                    for end in LENGTHS]  # fmt: skip
            cells = ["–", *(f"{row.best:.2f}" for row in rows)]
        else:
            cells = [cell(found.row(f"std of the heading curve, {name}"))]
            cells += [cell(found.row(f"azimuth rms at {end:g} s, Kalman, {name}"))
                      for end in LENGTHS]  # fmt: skip
        cells += [f"{value:.2f}" if value < 10.0 else f"{value:.0f}" for value in real[name]]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    limits = [found.row(f"azimuth rms at {end:g} s, Kalman, {yu_emd.NONE}").limit
              for end in LENGTHS]  # fmt: skip
    lines.append("| Cramér-Rao bound | – | " + " | ".join(f"{x:.2f}" for x in limits)
                 + " | – | – | – | – |")  # fmt: skip
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run all, print it, and write the page's table."""
    found = published.run("yu_emd", runs=RUNS, workers=1)
    print(found)
    real = on_the_vehicle()
    text = table(found, real)
    print(text)
    cells, spent = by_ensemble()
    print(f"CEEMDAN, {ENSEMBLE} noises, {ENSEMBLE_RUNS} records: {cells}, {spent:.2f} s for 300 s")
    page = PAGE.read_text(encoding="utf-8")
    head, _, rest = page.partition(BEGIN)
    _, mark, tail = rest.partition(END)
    if not mark:
        sys.exit(f"{PAGE} has no place for the table: {BEGIN.strip()} ... {END}")
    PAGE.write_text(head + BEGIN + text + mark + tail, encoding="utf-8")


if __name__ == "__main__":
    main()
