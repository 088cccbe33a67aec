"""What is the start of a causal low-pass worth? A hundred simulated trucks, twice.

``python -m tests.prefilter.lowpass_table`` (make validate) writes the table of
``docs/prefilter.md``: the azimuth's spread by TRIAD of the integrals behind a low-pass of 0.05 Hz,
by what the filter takes the force before the record for.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import signal

import schuler as sc
from schuler.alignment import Inertial
from schuler.alignment.history import inertial_to_local
from schuler.attitude import quat_to_matrix, rotate
from schuler.motion.vehicle import Crew
from schuler.prefilter import LowPass
from schuler.prefilter.base import held_frame
from schuler.published import conditions
from schuler.published.result import misalignment

PAGE = Path(__file__).resolve().parents[2] / "docs" / "prefilter.md"
BEGIN, END = "<!-- low-pass table -->\n", "<!-- end of the low-pass table -->"
RUNS, RATE, LATITUDE = 100, 100.0, -35.0
LOW = LowPass(0.05)
METHOD = Inertial("integral-triad")

NAMES = {
    "none": "no filter",
    "1 s": "mean of 1 s",
    "20 s": "mean of 20 s",
    "force": "a line fitted to the force",
    "triad": "gravity by TRIAD of the filtered record, second pass",
    "velocity": "**a line whose integral fits the velocity (as built)**",
    "truth": "gravity by the true attitude, as no user knows it",
    "zero-phase": "zero-phase, for comparison",
}


def started(record: sc.ImuRecord, before: np.ndarray) -> sc.ImuRecord:
    """Return the filtered record after a force (k, 3), m/s^2, in the held frame."""
    turn = held_frame(record)
    force = np.concatenate([before, rotate(turn, record.accel)])
    sos = LOW.sections(float(record.dt[0]))
    state = signal.sosfilt_zi(sos)
    out = np.column_stack(
        [signal.sosfilt(sos, x, zi=state * x[0])[0][len(before) :] for x in force.T]
    )
    back = rotate(turn * [1.0, -1.0, -1.0, -1.0], out)
    return replace(record, dvel=back * record.dt[:, None])


def ways(
    made: sc.Simulation, site: sc.Site, spec: sc.ImuSpec
) -> dict[str, Callable[[], sc.ImuRecord]]:
    """Return the filtered record by each start."""
    record, interval = made.record, float(made.record.dt[0])
    ahead = LOW.memory(interval)
    force = rotate(held_frame(record), record.accel)

    def by_mean(seconds: float) -> sc.ImuRecord:
        mean = force[: round(seconds / interval)].mean(axis=0)
        return started(record, np.repeat(mean[None], ahead, 0))

    def by_line() -> sc.ImuRecord:
        at = interval * np.arange(-ahead, len(force))
        line = np.polynomial.polynomial.polyfit(at[ahead:], force, 1)
        return started(record, np.polynomial.polynomial.polyval(at[:ahead], line).T)

    def by_attitude(mat_nb: np.ndarray) -> sc.ImuRecord:
        at = interval * (np.arange(-ahead, 0) + 0.5)
        start = inertial_to_local(0.0, site.latitude).T @ mat_nb
        return started(record, site.gravity * inertial_to_local(at, site.latitude)[:, 2] @ start)

    def by_triad() -> sc.ImuRecord:
        fix = sc.align(LOW(record), site, METHOD, spec, at="start")
        return by_attitude(quat_to_matrix(fix.quat_nb))

    return {
        "none": lambda: record,
        "1 s": lambda: by_mean(1.0),
        "20 s": lambda: by_mean(20.0),
        "force": by_line,
        "triad": by_triad,
        "velocity": lambda: LOW(record),
        "truth": lambda: by_attitude(quat_to_matrix(made.truth.known("quat_nb")[0])),
        "zero-phase": lambda: LowPass(0.05, zero_phase=True)(record),
    }


def spreads(seconds: float, crew: Crew | None, stream: int) -> dict[str, str]:
    """Return the azimuth's standard deviation by each start, arcmin, with its standard error."""
    site, spec = sc.Site(LATITUDE), sc.load_spec("navigation-fog")
    errors: dict[str, list[float]] = {key: [] for key in NAMES}
    for k in range(RUNS):
        rng = np.random.default_rng([stream, k])
        more = () if crew is None else (crew,)
        heading = rng.uniform(0, 360)
        motion = sc.motion.DisturbedVehicle.with_crew(rng, seconds, *more, heading=heading)
        made = sc.simulate(motion, site, seconds, RATE, spec, rng)
        for key, filtered in ways(made, site, spec).items():
            fix = sc.align(filtered(), site, METHOD, spec)
            true = made.truth.known("quat_nb")[-1]
            errors[key].append(float(misalignment(fix.quat_nb, true)[2]))
    out = {}
    for key, found in errors.items():
        squares = (np.array(found) - np.mean(found)) ** 2
        std = float(np.sqrt(squares.sum() / (RUNS - 1)))
        # The delta method on the mean square: no normal numbers are needed.
        error = float(squares.std(ddof=1)) / np.sqrt(RUNS) / (2.0 * std)
        digits = 0 if std >= 100.0 else 1
        out[key] = f"{std:.{digits}f} ± {error:.{digits}f}"
    return out


def main() -> None:
    """Run all, print it, and write the page's table."""
    crew = Crew(**conditions("guo2015")["gate"]["crew"])
    calm, hard = spreads(150.0, None, 35), spreads(100.0, crew, 44)
    lines = ["| start of the low-pass | 150 s | 100 s, hard at work |", "|---|---:|---:|"]
    lines += [f"| {name} | {calm[key]} | {hard[key]} |" for key, name in NAMES.items()]
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
