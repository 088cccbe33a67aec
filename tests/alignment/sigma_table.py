"""Is sigma what it says? Forty conditions, a hundred seeded records each.

``python -m tests.alignment.sigma_table`` (make validate) runs all of them and writes the table of
``docs/sigma.md``; `tests/alignment/test_sigma_table.py` holds a third of them with fewer seeds.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from schuler import Site, align
from schuler.errors import InputError
from schuler.motion import DisturbedVehicle, Static
from schuler.record import ImuRecord
from schuler.sensors import GRADES
from schuler.simulation import simulate
from tests.conftest import NORMAL_GRAVITY

PAGE = Path(__file__).resolve().parents[2] / "docs" / "sigma.md"
MARK = "<!-- table -->\n"


@dataclass(frozen=True)
class Condition:
    """What a record is like, and how it is aligned.

    Parameters
    ----------
    motion : {"rest", "truck", "settling"}
        Settling: a base that tilts and yaws away, 0.1 deg over five minutes.
    grade, method : str
    length, rate : float
        s, Hz.
    lat, pitch : float
        deg; a latitude of None is drawn between -70 and 70.
    lost : float
        Share of the samples that are lost, in gaps that are bridged.
    spike : bool
        One bad gyro sample.
    specified : bool
        Whether the specification is given.
    """

    motion: str = "rest"
    grade: str = "navigation-fog"
    length: float = 120.0
    rate: float = 50.0
    lat: float | None = 48.0
    pitch: float = 2.0
    method: str = "auto"
    lost: float = 0.0
    spike: bool = False
    specified: bool = True

    def __str__(self) -> str:
        parts = [self.motion, self.grade, f"{self.length:g} s", f"{self.rate:g} Hz"]
        parts.append("any latitude" if self.lat is None else f"{self.lat:g} deg")
        if self.pitch != 2.0:
            parts.append(f"pitch {self.pitch:g} deg")
        if self.lost:
            parts.append(f"{100 * self.lost:g} % lost")
        if self.spike:
            parts.append("one bad sample")
        if self.method != "auto":
            parts.append(self.method)
        if not self.specified:
            parts.append("no specification")
        return ", ".join(parts)


BASE = Condition()
CONDITIONS = (
    # lengths
    *(replace(BASE, length=t) for t in (20.0, 60.0, 120.0, 300.0, 900.0)),
    replace(BASE, length=3600.0, rate=10.0),
    # rates
    *(replace(BASE, rate=r) for r in (10.0, 100.0, 400.0)),
    replace(BASE, rate=1000.0, length=60.0),
    # latitudes
    *(replace(BASE, lat=lat) for lat in (0.0, -30.0, 70.0, 80.0)),
    replace(BASE, lat=None),
    # pitch
    *(replace(BASE, pitch=p) for p in (45.0, 80.0, 87.0)),
    # grades
    *(replace(BASE, grade=g) for g in ("navigation-rlg", "tactical-fog")),
    replace(BASE, grade="tactical-fog", length=300.0),
    replace(BASE, grade="industrial-mems"),
    replace(BASE, grade="industrial-mems", length=600.0, rate=20.0),
    # moving bases
    *(replace(BASE, motion="truck", length=t) for t in (20.0, 60.0, 120.0, 300.0, 600.0)),
    *(replace(BASE, motion="truck", grade=g) for g in ("navigation-rlg", "tactical-fog")),
    replace(BASE, motion="truck", lat=None),
    replace(BASE, motion="settling", length=300.0),
    replace(BASE, motion="settling", grade="navigation-rlg", length=300.0),
    # without a specification, of an instrument whose bias is small beside the disturbance
    replace(BASE, motion="truck", specified=False, grade="navigation-rlg", length=300.0),
    # gaps and bad samples
    replace(BASE, lost=0.2),
    replace(BASE, motion="truck", lost=0.02),
    replace(BASE, spike=True),
    # methods
    *(replace(BASE, motion="truck", method=m, length=200.0, rate=20.0)
      for m in ("centred", "wahba", "kalman", "kalman-velocity")),
    *(replace(BASE, method=m, length=200.0, rate=20.0) for m in ("analytic", "kalman-10")),
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """What came of one condition: normalised errors of heading and tilt, and how many flagged."""

    condition: Condition
    heading: float
    tilt: float
    flagged: int
    seeds: int


def one(condition: Condition, seed: int) -> tuple[float, float, bool]:
    """Return the normalised errors of heading and tilt, and whether the result was flagged."""
    rng = np.random.default_rng([seed, 20261127])
    c = condition
    lat = rng.uniform(-70.0, 70.0) if c.lat is None else c.lat
    site, spec = Site(lat, **NORMAL_GRAVITY), GRADES[c.grade]
    heading = rng.uniform(0, 360)
    if c.motion == "truck":
        motion = DisturbedVehicle.draw(rng, c.length, heading=heading, pitch=c.pitch)
    else:
        motion = Static(heading, c.pitch, rng.normal(0.0, 2.0))
    made = simulate(motion, site, c.length, c.rate, spec, rng)
    record = made.record
    if c.motion == "settling":
        rate = rng.normal(0.0, np.deg2rad(0.1) / 300.0, 3)
        record = _settled(record, rate)
    if c.spike:
        record = _with_spike(record, rng)
    if c.lost:
        record = _with_gaps(record, c.lost, rng)
    try:
        fix = align(record, site, c.method, spec if c.specified else None, at="start")
    except InputError as error:
        raise AssertionError(f"{condition}, seed {seed}: {error}") from None
    psi_error = (fix.heading_deg - made.heading_deg("start") + 180.0) % 360.0 - 180.0
    tilt = fix.pitch_deg - c.pitch if c.motion != "truck" else np.nan
    sigma = float(np.sqrt(0.5 * (fix.sigma_arcmin[0] ** 2 + fix.sigma_arcmin[1] ** 2)))
    return psi_error * 60.0 / fix.heading_sigma_arcmin, tilt * 60.0 / sigma, not fix.consistent


def _settled(record: ImuRecord, rate: np.ndarray) -> ImuRecord:
    """Return a record of a base that turns steadily, rad/s in body axes, to second order."""
    t = record.time - record.time[0] + record.dt
    turn = (t - 0.5 * record.dt)[:, None] * rate
    # The force and the Earth's rate are seen from a body that has turned.
    dvel = record.dvel - np.cross(turn, record.dvel)
    dtheta = record.dtheta - np.cross(turn, record.dtheta) + rate * record.dt[:, None]
    return replace(record, dtheta=dtheta, dvel=dvel)


def _with_spike(record: ImuRecord, rng: np.random.Generator) -> ImuRecord:
    dtheta = record.dtheta.copy()
    row, axis = int(rng.integers(len(record))), int(rng.integers(3))
    dtheta[row, axis] += np.deg2rad(10.0 ** rng.uniform(-1, 1))
    return ImuRecord.from_increments(record.time, dtheta, record.dvel)


def _with_gaps(record: ImuRecord, share: float, rng: np.random.Generator) -> ImuRecord:
    keep = np.ones(len(record), bool)
    while keep.mean() > 1.0 - share:
        at = int(rng.integers(300, len(record) - 60))
        keep[at : at + int(rng.integers(1, 50))] = False
    return ImuRecord.from_mean_rates(
        record.time[keep], (record.dtheta / record.dt[:, None])[keep],
        (record.dvel / record.dt[:, None])[keep], max_gap=10.0,
    )  # fmt: skip


def run(condition: Condition, seeds: int) -> Row:
    """Return the row of one condition."""
    found = np.array([one(condition, seed) for seed in range(seeds)], float)
    good = found[found[:, 2] == 0]
    return Row(
        condition, float(np.sqrt(np.mean(good[:, 0] ** 2))),
        float(np.sqrt(np.nanmean(good[:, 1] ** 2))) if condition.motion != "truck" else np.nan,
        int(found[:, 2].sum()), seeds,
    )  # fmt: skip


def table(rows: list[Row]) -> str:
    """Return the rows as a Markdown table."""
    lines = ["| condition | heading | tilt | flagged | records |", "|---|---|---|---|---|"]
    for row in rows:
        tilt = "-" if np.isnan(row.tilt) else f"{row.tilt:.2f}"
        cells = (row.condition, f"{row.heading:.2f}", tilt, row.flagged, row.seeds)
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run all conditions and write their table into the page."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    with ProcessPoolExecutor() as pool:
        rows = list(pool.map(run, CONDITIONS, [seeds] * len(CONDITIONS)))
    text = PAGE.read_text(encoding="utf-8")
    head, _, rest = text.partition(MARK)
    _, _, tail = rest.partition(MARK)
    PAGE.write_text(f"{head}{MARK}{table(rows)}{MARK}{tail}", encoding="utf-8")
    print(table(rows))


if __name__ == "__main__":
    main()
