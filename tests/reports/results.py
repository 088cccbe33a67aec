"""One of each result that schuler has, small and made once."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import schuler as sc
from schuler.alignment import compare_records
from schuler.constants import DEG_PER_HOUR
from schuler.motion import Static
from schuler.sensors import GRADES
from schuler.simulation import simulate
from tests.conftest import ROOT

SITE = sc.Site(40.0, 116.0, 50.0)
FOG = "navigation-fog"


@cache
def rest() -> Any:
    """Return 60 s at rest."""
    rng = np.random.default_rng(5)
    return simulate(Static(30.0), SITE, 60.0, 20.0, GRADES[FOG], rng)


def latitude_fix() -> Any:
    from schuler.alignment import align_without_latitude

    return align_without_latitude(rest().record, FOG)


def comparison() -> Any:
    return sc.compare(rest().record, SITE, FOG, [("optimal", "none"), ("analytic", "none")])


def limits() -> Any:
    from schuler.alignment import limit_table

    return limit_table(GRADES[FOG], SITE, [60.0, 300.0])


def path_limits() -> Any:
    from schuler.alignment import PlannedAid, path_table
    from tests.in_motion.test_coarse import simulated

    truth = simulated("car", 60.0).truth
    return path_table(truth, "tactical-fog", [PlannedAid.parse("gnss=0.1m/s,3m@1Hz")], [30.0, 59.0])


def moving() -> Any:
    from tests.alignment.moving.test_align import drive

    _, record, gnss = drive()
    return sc.align(record, aiding=gnss, spec="tactical-fog")


def moving_windows() -> Any:
    from schuler.alignment import align_moving_windows
    from tests.alignment.moving.test_align import drive

    _, record, gnss = drive()
    return align_moving_windows(record, gnss, 25.0, spec="tactical-fog")


def transfer() -> Any:
    from tests.alignment.transfer.test_transfer import aligned

    return aligned("rock", 0)[0]


def north() -> Any:
    from schuler.alignment.table_north import table_north

    rng = np.random.default_rng(3)
    angles = np.array([0.0, 90.0, 180.0, 270.0])
    mean = 2.0 + 11.0 * np.cos(np.radians(angles - 30.0))
    readings = [(m + 0.1 * rng.standard_normal(30)) * DEG_PER_HOUR for m in mean]
    return table_north(angles, readings, latitude=float(np.radians(40.0)))


def noise() -> Any:
    return sc.fit_noise(sc.allan([rest().record]))


def poses() -> Any:
    from schuler.calibration import calibrate_poses
    from tests.calibration.test_poses import G, by_hand

    return calibrate_poses(*by_hand(np.random.default_rng(1)), gravity=G)


def systematic() -> Any:
    from schuler.calibration import SYSTEMATIC_NAMES, Calibration, SystematicFit

    rng = np.random.default_rng(2)
    sigma = np.full(24, 1e-6)
    sigma[SYSTEMATIC_NAMES.index("accelerometer yx")] = 0.0
    return SystematicFit(
        Calibration(name="turns"), 1e-5 * rng.standard_normal(24), sigma, np.diag(sigma**2),
        ["gyro bias z"], 1.02,
    )  # fmt: skip


def table_test() -> Any:
    from schuler.calibration import Calibration, TableTest

    rng = np.random.default_rng(4)
    truth = np.vstack([np.eye(3), -np.eye(3)]) * 9.8
    stretches = np.array([[10.0 * k, 10.0 * k + 8.0] for k in range(6)])
    return TableTest(
        "positions", Calibration(name="six"), ("accel_bias",), stretches, truth,
        1e-4 * rng.standard_normal((6, 3)), 1e-4,
    )  # fmt: skip


def doppler() -> Any:
    from schuler.calibration import fit_body_velocity
    from tests.calibration.test_doppler import log

    trajectory, dvl = log(0)
    return fit_body_velocity(dvl, trajectory)


def campaign() -> Any:
    scenario = sc.load_scenario(
        ROOT / "examples/scenarios/static_base.toml", {"duration": "20 s", "rate": "20 Hz"}
    )
    plan = sc.Campaign(scenario, 3, methods=("optimal",))
    with TemporaryDirectory() as folder:
        return sc.campaign(plan, Path(folder) / "out", workers=0)


def centrifuge() -> Any:
    from schuler.centrifuge import PUBLISHED_POSITIONS, CentrifugeScheme, Plant, identify

    return identify(Plant(), CentrifugeScheme(PUBLISHED_POSITIONS, 20.0))


def plan() -> Any:
    from schuler.centrifuge import Objective, Plant, Problem
    from schuler.centrifuge import plan as search

    return search(Problem(Plant(), 4, 20.0, Objective("sum-rho")), seed=1, time_limit=0.1)


@cache
def rotation_case() -> Any:
    from schuler.modulation import RotationCase

    return RotationCase.from_toml(ROOT / "examples/rotation/four_gyro.toml")


def rotation() -> Any:
    from schuler.modulation import compare_rotation

    return compare_rotation(rotation_case())


def rotation_hours() -> Any:
    from schuler.modulation import rotation_history

    return rotation_history(rotation_case())


@cache
def free_path() -> Any:
    return sc.navigate(rest().record, SITE, sc.align(rest().record, SITE, at="start"))


def evaluation() -> Any:
    from schuler.navigation import evaluate

    return evaluate(free_path(), rest().truth)


def free() -> Any:
    from schuler.navigation import FreeNavigation

    return FreeNavigation(free_path(), "somigliana", "free", None, evaluation())


def aided() -> Any:
    from schuler.navigation import navigate_aided
    from tests.navigation.test_aided import QUIET, SPEC, drive

    made, gnss = drive(4, length=60.0)
    return navigate_aided(made.record, gnss, spec=SPEC, options=QUIET)


def experiment() -> Any:
    from schuler.published.figures import Curve, Figure
    from schuler.published.result import Experiment, Row

    x = np.linspace(0.0, 1.0, 5)
    drawn = Figure("Errors", "time, s", "error, deg", (Curve("one", x, x), Curve("two", x, 2 * x)))
    rows = (Row("heading", "deg", 1.0, 1.1, 0.9, 0.5, "a note"),)
    return Experiment("some2020", "A title", "Some (2020)", ("one",), 3, rows, (drawn,))


def faults() -> Any:
    from schuler.sensors import scan_faults
    from tests.sensors.test_fault_scan import DT, record

    array, t, m = record("cone5", 200.0, np.random.default_rng(0), (2, 8.0, 120.5, 160.0))
    return scan_faults(array, t, m, DT)


def array() -> Any:
    from schuler.sensors import ArrayFigures, Lifetime, Reliability, named_array

    sensors = named_array("symmetric4")
    return ArrayFigures(sensors, Reliability(sensors, Lifetime(10_000.0)))


def overview() -> Any:
    from schuler.reports.overview import Overview

    document = sc.align(rest().record, SITE, spec=FOG).to_dict()
    return Overview("align", (
        {"file": "a.csv", "document": document, "error": None, "warnings": []},
        {"file": "b.csv", "document": None, "error": "b.csv: is empty", "warnings": []},
    ))  # fmt: skip


MAKERS: dict[str, Callable[[], Any]] = {
    "Alignment": lambda: sc.align(rest().record, SITE, spec=FOG),
    "MovingAlignment": moving,
    "MovingWindows": moving_windows,
    "TransferAlignment": transfer,
    "Windows": lambda: sc.align_windows(rest().record, SITE, 15.0, spec=FOG),
    "LatitudeFix": latitude_fix,
    "Comparison": comparison,
    "LimitTable": limits,
    "RecordComparison": lambda: compare_records(made("Alignment"), made("Alignment")),
    "PathTable": path_limits,
    "TableNorth": north,
    "Allan": lambda: sc.allan([rest().record]),
    "NoiseFit": noise,
    "PosesFit": poses,
    "SystematicFit": systematic,
    "TableTest": table_test,
    "BodyVelocityFit": doppler,
    "Results": campaign,
    "Scatter": lambda: campaign().scatters()[0],
    "CentrifugeTest": centrifuge,
    "Plan": plan,
    "RotationComparison": rotation,
    "RotationHistory": rotation_hours,
    "Trajectory": free_path,
    "Evaluation": evaluation,
    "FreeNavigation": free,
    "AidedNavigation": aided,
    "Experiment": experiment,
    "FaultScan": faults,
    "ArrayFigures": array,
    "Overview": overview,
}


@cache
def made(name: str) -> Any:
    """Return the result of that class."""
    return MAKERS[name]()
