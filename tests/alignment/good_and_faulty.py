"""Records of every kind of base, and what can be wrong with them; how many are told apart.

``python -m tests.alignment.good_and_faulty`` (make validate) writes the tables of
``docs/consistency.md``; `tests/alignment/test_good_and_faulty.py` runs a few of each.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from schuler import Site, align
from schuler.attitude import quat_to_matrix
from schuler.constants import EARTH_RATE
from schuler.errors import InputError
from schuler.motion import (
    Band,
    DisturbedVehicle,
    Dwell,
    Sea,
    Static,
    Sway,
    Turn,
    Turntable,
    moored_ship,
    quiet_crew,
)
from schuler.record import ImuRecord
from schuler.record.quality import CHANNELS
from schuler.sensors import GRADES
from schuler.simulation import Simulation, simulate

PAGE = Path(__file__).resolve().parents[2] / "docs" / "consistency.md"
MARK = "<!-- table -->\n"

BASES = (
    "level", "tilted", "truck", "shaken", "quiet crew", "ship", "sway", "turntable", "settling",
)  # fmt: skip

FAULTS = (
    "accelerometers negated", "latitude's sign", "latitude 5 deg", "latitude 18 deg",
    "bias north", "bias up", "bias of any direction", "gyros' unit",
)  # fmt: skip

MOVING_FAULTS = ("reflection", "exchange", "gyros reflected", "gyros exchanged")


@dataclass(frozen=True)
class Case:
    """A record and all that is known of it.

    Parameters
    ----------
    made : Simulation
    record : ImuRecord
        Its record, of a base that settles where it does.
    site : Site
    grade, base : str
    """

    made: Simulation
    record: ImuRecord
    site: Site
    grade: str
    base: str

    def __str__(self) -> str:
        r = self.record
        return (
            f"{self.base}, {self.grade}, {r.duration:.0f} s, {r.rate:.0f} Hz, "
            f"{self.site.lat:.1f} deg"
        )


def motion_of(base: str, rng: np.random.Generator, length: float):
    """Return a motion of a kind of base."""
    psi = rng.uniform(0, 360)
    if base in ("level", "settling"):
        return Static(psi, rng.uniform(-5, 5), rng.uniform(-5, 5))
    if base == "tilted":
        return Static(psi, rng.uniform(-60, 60), rng.uniform(-60, 60))
    if base == "truck":
        return DisturbedVehicle.with_crew(rng, length, heading=psi)
    if base == "shaken":
        return DisturbedVehicle.draw(rng, length, heading=psi)
    if base == "quiet crew":
        return DisturbedVehicle.with_crew(rng, length, quiet_crew(), heading=psi)
    if base == "ship":
        return moored_ship(rng, Sea(1.5, 8.0), heading=psi, lever=(1.0, 5.0, 3.0))
    if base == "sway":
        bands = [Band("roll", 2, 0.1, 1), Band("pitch", 1, 0.1, 1), Band("heading", 0.5, 0.1, 1)]
        return Sway.draw(rng, bands, heading=psi, lever=(0.5, 0.5, 1.0))
    turns = (Turn("psi", 90.0), Turn("theta", 45.0, 50.0, 100.0))
    rest = Dwell(length / 4.0)
    return Turntable([rest, turns[0], rest, turns[1], Dwell(length)], (psi, 0.0, 0.0))


def draw(
    seed: int, *, bases: tuple[str, ...] = BASES, grades: tuple[str, ...] = tuple(GRADES),
    length: float | None = None,
) -> Case:  # fmt: skip
    """Draw a case: base, grade, latitude, sampling rate (10 Hz to 1 kHz) and length.

    Parameters
    ----------
    seed : int
    bases, grades : tuple of str
        To draw from.
    length : float, optional
        s; 60 to 600 where it is not given.
    """
    rng = np.random.default_rng([seed, 77])
    base, grade = str(rng.choice(bases)), str(rng.choice(grades))
    rate = float(rng.choice([10, 25, 50, 100, 200, 400, 1000], p=[0.2, 0.2, 0.2, 0.2, 0.1, 0.05,
                                                                 0.05]))  # fmt: skip
    drawn = float(rng.choice([60, 120, 300, 600]))
    if length is None:
        # 30,000 samples are enough.
        length = max(60.0, 30_000.0 / rate) if drawn * rate > 30_000 else drawn
    else:
        rate = min(rate, 50.0)
    site = Site(rng.uniform(-80, 80))
    made = simulate(motion_of(base, rng, length), site, length, rate, GRADES[grade], rng)
    record = made.record
    if base == "settling":
        record = settled(record, rng.normal(0.0, np.deg2rad(0.1) / 300.0, 3))
    return Case(made, record, site, grade, base)


def settled(record: ImuRecord, rate: np.ndarray) -> ImuRecord:
    """Return a record of a base that turns steadily, rad/s in body axes, to second order."""
    t = record.time - record.time[0] + record.dt
    turn = (t - 0.5 * record.dt)[:, None] * rate
    # The force and the Earth's rate are seen from a body that has turned.
    dvel = record.dvel - np.cross(turn, record.dvel)
    dtheta = record.dtheta - np.cross(turn, record.dtheta) + rate * record.dt[:, None]
    return replace(record, dtheta=dtheta, dvel=dvel)


def spoiled(case: Case, fault: str, seed: int) -> tuple[ImuRecord, Site]:
    """Return the record and the site of a case with a fault in one of them."""
    rng = np.random.default_rng([seed, 78])
    record, site, spec = case.record, case.site, GRADES[case.grade]
    dtheta, dvel, dt = record.dtheta, record.dvel, record.dt[:, None]
    matrix = np.eye(3)
    if fault.endswith(("reflection", "reflected")):
        k = rng.integers(3)
        matrix[k, k] = -1.0
    elif fault.endswith(("exchange", "exchanged")):
        matrix = matrix[[[1, 0, 2], [0, 2, 1], [2, 1, 0]][rng.integers(3)]]
    if fault == "accelerometers negated":
        dvel = -dvel
    elif fault == "latitude's sign":
        site = Site(-site.lat)
    elif fault.startswith("latitude"):
        off = float(fault.split()[1])
        site = Site(site.lat - off if site.lat > 0 else site.lat + off)
    elif fault == "bias of any direction":
        axis = rng.normal(size=3)
        dtheta = dtheta + 30.0 * spec.gyro.bias * axis / np.linalg.norm(axis) * dt
    elif fault.startswith("bias"):
        axes = quat_to_matrix(case.made.truth.quat_nb)[:-1]
        axis = axes[:, 1 if fault.endswith("north") else 2].mean(axis=0)
        noise = spec.gyro.angle_random_walk / np.sqrt(record.duration)
        size = 5.0 * np.hypot(spec.gyro.bias, noise) * rng.choice([-1.0, 1.0])
        dtheta = dtheta + size * axis / np.linalg.norm(axis) * dt
    elif fault == "gyros' unit":
        dtheta = dtheta * (np.pi / 180.0 if rng.random() < 0.5 else 180.0 / np.pi)
    else:
        dtheta = dtheta @ matrix.T
        if not fault.startswith("gyros"):
            dvel = dvel @ matrix.T
    return replace(
        record, dtheta=np.ascontiguousarray(dtheta), dvel=np.ascontiguousarray(dvel)
    ), site


def shows(case: Case, fault: str, seed: int) -> bool:
    """Whether a record at rest can show a fault: the change is above four sigma of bias and noise.

    A base shows two numbers of the Earth's rate, its part up and the length of its horizontal part.
    The part east of a bias of any direction changes neither, and is counted as shown all the same.
    """
    gyro = GRADES[case.grade].gyro
    sigma = np.hypot(gyro.bias, gyro.angle_random_walk / np.sqrt(case.record.duration))
    lat = np.deg2rad(case.site.lat)
    north, up = EARTH_RATE * np.cos(lat), EARTH_RATE * np.sin(lat)
    if fault in ("accelerometers negated", "latitude's sign"):
        return bool(2.0 * abs(up) > 4.0 * sigma)
    if fault.startswith("latitude"):
        off = np.deg2rad(float(fault.split()[1]))
        return bool(2.0 * EARTH_RATE * np.sin(0.5 * off) > 4.0 * sigma)
    if fault == "bias north":
        record, _ = spoiled(case, fault, seed)
        axis = quat_to_matrix(case.made.truth.quat_nb)[:-1, 1].mean(axis=0)
        added = (record.dtheta - case.record.dtheta).sum(axis=0) / case.record.dt.sum()
        seen = abs(north + added @ axis / np.linalg.norm(axis))
        return bool(abs(seen - north) > 4.0 * sigma)
    return True


@dataclass(frozen=True)
class Outcome:
    """What came of one record.

    Parameters
    ----------
    case, fault : str
    told : {"consistent", "inconsistent", "refused"}
    error : float
        Heading error over its sigma.
    text : str
        What was said.
    shown : bool
        Whether a record at rest can show the fault (`shows`).
    """

    case: str
    fault: str
    told: str
    error: float
    text: str
    shown: bool = True

    @property
    def missed(self) -> bool:
        """Whether a wrong heading was given as good."""
        return self.told == "consistent" and abs(self.error) > 3.0


def run(seed: int, faults: tuple[str, ...], **drawn) -> list[Outcome]:
    """Align a case with each of some faults ("" is none)."""
    case = draw(seed, **drawn)
    out = []
    for fault in faults:
        record, site = spoiled(case, fault, seed) if fault else (case.record, case.site)
        shown = shows(case, fault, seed)
        try:
            fix = align(record, site, spec=GRADES[case.grade], at="start")
        except InputError as error:
            out.append(Outcome(str(case), fault, "refused", 0.0, str(error), shown))
            continue
        off = (fix.heading_deg - case.made.heading_deg("start") + 180.0) % 360.0 - 180.0
        told = "consistent" if fix.consistent else "inconsistent"
        text = "; ".join(fix.contradictions)
        error = off * 60.0 / fix.heading_sigma_arcmin
        out.append(Outcome(str(case), fault, told, error, text, shown))
    return out


@dataclass(frozen=True)
class Bad:
    """What came of a record with one bad sample.

    Parameters
    ----------
    told : {"consistent", "inconsistent", "refused"}
    error : float
        Heading error over its sigma.
    large : bool
        Whether the sample is above eight sigma of what neighbouring samples differ by.
    named : bool
    """

    told: str
    error: float
    large: bool
    named: bool


def bad_sample(seed: int, grade: str) -> Bad:
    """Align a case one value of which is off by 0.01 to 20 deg or 1 to 1000 m/s."""
    case = draw(seed, grades=(grade,))
    rng = np.random.default_rng([seed, 79])
    record = case.record
    row, channel = int(rng.integers(len(record.dt))), int(rng.integers(6))
    low, high = (np.deg2rad(0.01), np.deg2rad(20.0)) if channel < 3 else (1.0, 1000.0)
    size = float(np.exp(rng.uniform(np.log(low), np.log(high)))) * rng.choice([-1.0, 1.0])
    values = np.column_stack((record.dtheta, record.dvel))
    noise = np.sqrt(np.mean(np.diff(values[:, channel], 2) ** 2) / 6.0)
    values[row, channel] += size
    spoilt = replace(
        record, dtheta=np.ascontiguousarray(values[:, :3]), dvel=np.ascontiguousarray(values[:, 3:])
    )
    large = abs(size) > 8.0 * noise
    try:
        fix = align(spoilt, case.site, spec=GRADES[grade], at="start")
    except InputError as error:
        return Bad("refused", 0.0, large, CHANNELS[channel] in str(error))
    off = (fix.heading_deg - case.made.heading_deg("start") + 180.0) % 360.0 - 180.0
    named = any("left out as a spike" in said and CHANNELS[channel] in said
                and f"row {row + 1} " in said for said in fix.warnings)  # fmt: skip
    told = "consistent" if fix.consistent else "inconsistent"
    return Bad(told, off * 60.0 / fix.heading_sigma_arcmin, large, named)


def many(seeds: range, faults: tuple[str, ...], **drawn) -> list[Outcome]:
    """Run many cases side by side."""
    with ProcessPoolExecutor() as pool:
        found = pool.map(partial(run, faults=faults, **drawn), seeds, chunksize=8)
        return [outcome for outcomes in found for outcome in outcomes]


def good_table(records: int) -> str:
    """Return the table of good records, by base."""
    found = many(range(records), ("",))
    lines = ["| base | records | said to be inconsistent, or refused | rms(error / sigma) |",
             "|---|---|---|---|"]  # fmt: skip
    for base in (*BASES, ""):
        mine = [each for each in found if each.case.startswith(base)]
        wrong = sum(each.told != "consistent" for each in mine)
        errors = [each.error for each in mine if each.told == "consistent"]
        rms = np.sqrt(np.mean(np.square(errors)))
        lines.append(f"| {base or 'all'} | {len(mine)} | {wrong} | {rms:.2f} |")
    for each in found:
        if each.told != "consistent" or each.missed:
            print(each)
    return "\n".join(lines) + "\n"


def bad_sample_table(records: int) -> str:
    """Return the table of records with one bad sample, by grade."""
    columns = ("grade", "records", "above eight sigma", "of them named", "inconsistent or refused",
               "rms(error / sigma) of the others")  # fmt: skip
    lines = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    for grade in GRADES:
        with ProcessPoolExecutor() as pool:
            found = list(pool.map(partial(bad_sample, grade=grade), range(records), chunksize=8))
        large = [each for each in found if each.large]
        named = sum(each.named for each in large)
        errors = [each.error for each in found if each.told == "consistent"]
        rms = np.sqrt(np.mean(np.square(errors)))
        cells = (grade, len(found), len(large), f"{named} ({100.0 * named / len(large):.2f} %)",
                 len(found) - len(errors), f"{rms:.2f}")  # fmt: skip
        lines.append(f"| {' | '.join(map(str, cells))} |")
        print(lines[-1], flush=True)
    return "\n".join(lines) + "\n"


def fault_table(records: int) -> str:
    """Return the table of faulty records, by fault, grade and length."""
    columns = ("base", "fault", "grade", "length", "records", "told", "missed", "missed of shown")
    lines = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    # A moving base shows no small bias: gravity alone is left there.
    plain = tuple(fault for fault in FAULTS if not fault.startswith("bias"))
    at_rest, moving = ("level", "tilted"), ("truck", "shaken")
    for faults, bases in ((FAULTS, at_rest), (plain + MOVING_FAULTS, moving)):
        for grade in ("navigation-fog", "tactical-fog"):
            for length in (120.0, 600.0):
                found = many(range(records), faults, bases=bases, grades=(grade,), length=length)
                for fault in faults:
                    mine = [each for each in found if each.fault == fault]
                    told = sum(each.told != "consistent" for each in mine)
                    missed = sum(each.missed for each in mine)
                    shown = [each for each in mine if each.shown]
                    of_shown = sum(each.missed for each in shown)
                    cells = (
                        " or ".join(bases), fault, grade, f"{length:.0f} s", len(mine), told,
                        f"{missed} ({100.0 * missed / len(mine):.1f} %)",
                        f"{of_shown} of {len(shown)} ({100.0 * of_shown / len(shown):.1f} %)"
                        if shown else "none is",
                    )  # fmt: skip
                    lines.append(f"| {' | '.join(map(str, cells))} |")
                    print(lines[-1], flush=True)
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the three tables into the page."""
    good, faulty, bad = (int(x) for x in (sys.argv[1:4] if len(sys.argv) > 3 else (2000, 250, 500)))
    text = PAGE.read_text(encoding="utf-8")
    parts = text.split(MARK)
    parts[1], parts[3], parts[5] = good_table(good), bad_sample_table(bad), fault_table(faulty)
    PAGE.write_text(MARK.join(parts), encoding="utf-8")
    print(parts[1], parts[3], parts[5])


if __name__ == "__main__":
    main()
