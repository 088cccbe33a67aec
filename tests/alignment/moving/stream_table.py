"""The heading at instants of a stream, beside that of passes over all that came, and the bound.

``python -m tests.alignment.moving.stream_table`` (make validate) writes the table of
``docs/live-in-motion.md``: each route of 300 s, its first 60 s kept for passes and the filter alone
beyond. A number of runs may follow.
"""

from __future__ import annotations

import sys

import numpy as np

import schuler as sc
from schuler.aiding import rows_of
from schuler.alignment import MovingStream, StreamSetting
from schuler.constants import ARCMIN
from schuler.errors import InputError
from schuler.sensors import GRADES
from tests.alignment.moving.routes import ROUTES, SITE, fixes, heading_error, noisy, truth_of
from tests.conftest import ROOT, chi_square_band

PAGE = ROOT / "docs" / "live-in-motion.md"
BEGIN, END = "<!-- stream table -->\n", "<!-- end of the stream table -->"
INSTANTS = (60.0, 120.0, 300.0)
KEEP = 60.0
CELLS = tuple((route, grade) for route in ROUTES for grade in ("navigation-fog", "tactical-fog"))


def at_instants(record, gnss, grade):
    """Return the alignments of one stream at the instants; None where it has no heading."""
    rows, done = rows_of(gnss), -np.inf
    stream = MovingStream(StreamSetting(grade, keep=KEEP, vibration=0.0))
    out = []
    for end in INSTANTS:
        stream.add(rows[(rows[:, 0] > done) & (rows[:, 0] <= end)])
        for chunk in record.between(done if np.isfinite(done) else None, end).chunks(500):
            stream.update(chunk)
        done = end
        try:
            out.append(stream.solution())
        except InputError:
            out.append(None)
    return out


def cell(route: str, grade: str, runs: int) -> list[str]:
    """Return the rows of a route and an instrument, one to an instant."""
    made, spec = truth_of(ROUTES[route](), INSTANTS[-1]), GRADES[grade]
    found = {end: {"whole": [], "stream": [], "apart": []} for end in INSTANTS}
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        gnss, record = fixes(made, rng=rng), noisy(made, grade, rng)
        streamed = at_instants(record, gnss, grade)
        for end, now in zip(INSTANTS, streamed, strict=True):
            true = made.truth.quat_nb[round(100 * end)]
            try:
                whole = sc.align(
                    record.between(None, end), SITE, aiding=gnss, spec=spec, vibration=0.0
                )  # fmt: skip
            except InputError:
                continue
            if now is None:
                continue
            for name, fix in (("whole", whole), ("stream", now)):
                error = heading_error(fix.quat_nb, true)
                nees = error @ np.linalg.solve(fix.covariance, error) / 3.0
                found[end][name].append((error[2] / ARCMIN, nees))
            apart = heading_error(now.quat_nb, whole.quat_nb)[2] / ARCMIN
            found[end]["apart"].append(apart / whole.sigma_arcmin[2])
    lines = []
    for end in INSTANTS:
        part = made.truth.rows(slice(0, round(100 * end) + 1))
        came = gnss.rows(np.asarray(gnss.time) <= end)
        limit = sc.limit_on(part, spec, came, record=made.record.between(None, end))
        bound = limit.sigma_arcmin[2]
        (whole, n1), (stream, n2) = (
            (np.sqrt(np.mean(np.square(a[:, 0]))) / bound, np.mean(a[:, 1]))
            for a in (np.array(found[end][name]) for name in ("whole", "stream"))
        )
        apart = np.sqrt(np.mean(np.square(found[end]["apart"])))
        lines.append(
            f"| {route} | {grade} | {end:.0f} | {bound:.3g}′ | {whole:.2f} | {stream:.2f} | "
            f"{n1:.2f} | {n2:.2f} | {apart:.3f} | {len(found[end]['apart'])} |"
        )
        print(lines[-1], flush=True)
    return lines


def main(runs: int) -> None:
    """Run all cells and write the table."""
    low, high = (x / (3 * runs) for x in chi_square_band(3 * runs, 0.05))
    lines = [
        "Routes of 300 s as in [how near it comes](concepts/in-motion.md#how-near-it-comes), the "
        f"first {KEEP:.0f} s kept (four times that until the heading is known to 2 deg) and the "
        f"filter alone beyond; {runs} runs of each, seeds 0 to "
        f"{runs - 1}. Root mean square of the heading's error over the bound (± "
        f"{70 / runs**0.5:.0f} %), of passes over the whole and of the stream at that instant, "
        f"NEES/3 of the attitude (95 % band {low:.2f} to {high:.2f}), and how far both headings "
        "are apart, rms in 1-sigma:",
        "",
        "| route | grade | s | bound | whole | stream | NEES/3, whole | NEES/3, stream | apart | "
        "runs |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for route, grade in CELLS:
        lines += cell(route, grade, runs)
    text = PAGE.read_text(encoding="utf-8")
    head, _, rest = text.partition(BEGIN)
    tail = rest.partition(END)[2]
    body = "\n".join(lines)
    PAGE.write_text(f"{head}{BEGIN}{body}\n{END}{tail}", encoding="utf-8")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
