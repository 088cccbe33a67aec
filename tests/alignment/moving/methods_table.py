"""Methods of alignment in motion on the same records, which are simulated, and on a real drive.

``python -m tests.alignment.moving.methods_table`` (make validate) writes the tables of
``docs/concepts/in-motion-methods.md``. A number of runs may follow.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

import schuler as sc
from schuler.attitude import multiply, nearest_quat, rotvec_to_quat
from schuler.constants import ARCMIN, DEG
from schuler.errors import InputError
from schuler.in_motion.body import body_rows
from schuler.in_motion.coarse import coarse
from schuler.in_motion.series import position_series, velocity_series
from schuler.navigation import AidingOptions, navigate_aided
from schuler.sensors import GRADES
from tests.alignment.moving.routes import ROUTES, SITE, fixes, heading_error, noisy, truth_of
from tests.conftest import ROOT

PAGE = ROOT / "docs" / "concepts" / "in-motion-methods.md"
MARK = "<!-- table -->\n"
GRADE, SPEC = "tactical-fog", GRADES["tactical-fog"]
WRONG = (20.0, 90.0, 180.0)
METHODS = (
    "plain fit", "centred fit", "positions alone", "fine", *(f"filter, {x:.0f}°" for x in WRONG),
    "bound",
)  # fmt: skip


def _plain(series) -> np.ndarray:
    """Return the rotation of a fit that takes the first velocity as exact."""
    x, y = series.x - series.x[0], series.y - series.y[0]
    u, _, vt = np.linalg.svd(y.T @ x)
    return u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt


def _at_end(rotation, about, rows, place, time):
    """Return C_b^n at the end for a rotation, as the coarse alignment `about` has its own."""
    return (
        about.mat_nb
        @ np.linalg.inv(about.mat_i0_ib0 @ rows.mat_ib0_b[-1])
        @ (rotation @ rows.mat_ib0_b[-1])
    )


def errors(made, record, gnss, seed) -> list[float]:
    """Return the heading error of each method at the end of a record, rad; nan where refused."""
    true = made.truth.quat_nb[len(record)]
    rows = body_rows(record, gnss.time)
    place = made.truth.lat[len(record)], made.truth.lon[len(record)]
    end = rows.mat_ib0_b[-1], rows.turn[-1]
    series = velocity_series(rows, gnss)
    about = coarse(series, SPEC, place, record.end, *end)
    found = [nearest_quat(_at_end(_plain(series), about, rows, place, record.end)),
             nearest_quat(about.mat_nb)]  # fmt: skip
    alone = replace(gnss, v_n=None)
    found.append(nearest_quat(
        coarse(position_series(rows, alone), SPEC, place, record.end, *end).mat_nb
    ))  # fmt: skip
    try:
        fix = sc.align(record, SITE, aiding=gnss, spec=SPEC, vibration=0.0)
        found.append(fix.quat_nb)
    except InputError:
        found.append(None)
    sign = 1.0 if seed % 2 else -1.0
    for wrong in WRONG:
        turn = rotvec_to_quat(np.array([0.0, 0.0, sign * wrong * DEG]))
        start = sc.Start(
            SITE, multiply(turn, made.truth.quat_nb[0]), made.truth.v_n[0],
            covariance=np.diag([*[(1.0 * DEG) ** 2] * 2, (wrong * DEG) ** 2, *[1.0] * 6]),
        )  # fmt: skip
        try:
            path = navigate_aided(
                record, gnss, start=start, spec=SPEC, options=AidingOptions(vibration=0.0)
            )
            found.append(path.path.quat_nb[-1] if hasattr(path, "path") else path.quat_nb[-1])
        except InputError:
            found.append(None)
    return [np.nan if q is None else abs(heading_error(q, true)[2]) for q in found]


def row(route: str, length: float, runs: int) -> list[float]:
    """Return the rms heading error of each method and the bound, arcmin."""
    made = truth_of(ROUTES[route](), length)
    out = []
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        gnss, record = fixes(made, rng=rng), noisy(made, GRADE, rng)
        out.append(errors(made, record, gnss, seed))
    bound = sc.limit_on(made.truth, SPEC, fixes(made), record=made.record).sigma_arcmin[2]
    rms = np.sqrt(np.nanmean(np.square(out), axis=0)) / ARCMIN
    return [*rms, bound]


def main() -> None:
    """Run all routes and write the table into the page."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    lines = [f"| route | s | {' | '.join(METHODS)} |", "|---" * (2 + len(METHODS)) + "|"]
    for route in ("car", "accel", "plane", "ship"):
        for length in (60.0, 120.0):
            cells = " | ".join(f"{x:.3g}′" for x in row(route, length, runs))
            lines.append(f"| {route} | {length:.0f} | {cells} |")
            print(lines[-1], flush=True)
    if PAGE.exists():
        head, _, rest = PAGE.read_text(encoding="utf-8").partition(MARK)
        _, _, tail = rest.partition(MARK)
        table = "\n".join(lines) + "\n"
        PAGE.write_text(f"{head}{MARK}{table}{MARK}{tail}", encoding="utf-8")


if __name__ == "__main__":
    main()
