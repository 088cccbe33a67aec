"""What a caller of the Python API gets wrong is said in one sentence, at the call."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import schuler as sc
from schuler.alignment import (
    Aligner,
    Inertial,
    KalmanAlignment,
    align_windows,
    align_without_latitude,
    parse_method,
)
from schuler.campaigns import Campaign
from schuler.config import load_scenario
from schuler.errors import InputError, expect
from schuler.motion import Static
from schuler.navigation import Start, evaluate
from schuler.prefilter import Emd, Gate, Hankel, LowPass, Wavelet
from schuler.sensors import GRADES
from schuler.simulation import simulate

SITE = sc.Site(34.2, 108.9, 400.0)
MADE = simulate(
    Static(30.0, 2.0, 1.0), SITE, 60.0, 20.0, GRADES["navigation-fog"], np.random.default_rng(1)
)
RECORD = MADE.record


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: sc.Site("34.2"), "latitude: expected a number, got str"),
        (lambda: sc.align({"t": [0.0]}, SITE), "record: expected ImuRecord, got dict; read a"),
        (lambda: sc.align(RECORD, 34.2), "site: expected Site, got float; say schuler.Site"),
        (lambda: Aligner(SITE).update([1.0]), "record: expected ImuRecord, got list"),
        (lambda: align_windows(RECORD, SITE, "60s"), "window: expected a number, got str"),
        (lambda: sc.navigate(3.0, Start.from_angles(SITE, 0.0)), "record: expected ImuRecord"),
        (lambda: sc.navigate(RECORD, 3.0), "start: expected Start or Site, got float"),
        (lambda: evaluate(RECORD, MADE.truth), "path: expected Trajectory, got ImuRecord"),
        (lambda: sc.Site("34.2"), "latitude: expected a number, got str; give it in deg, as Site("),
        (lambda: sc.allan("truck.csv"), "record: expected ImuRecord, got str; read a file"),
        (lambda: sc.allan(RECORD.to_pandas()), "record: expected ImuRecord, got DataFrame; read"),
        (lambda: sc.compare("truck.csv", SITE), "record: expected ImuRecord, got str"),
        (lambda: sc.compare(RECORD, 40.0), "site: expected Site, got float; say schuler.Site"),
        (lambda: sc.fit_noise(RECORD), "found: expected Allan, got ImuRecord; it is what schuler"),
        (lambda: sc.limit("navigation-fog", 40.0, 60.0), "spec: expected ImuSpec, got str"),
        (lambda: sc.calibrate_poses(RECORD, RECORD, gravity=9.8), "time: expected numbers"),
        (lambda: sc.read(3), "path: expected str or Path, got int; a table in memory is read by"),
        (lambda: sc.simulate(3, SITE, 60.0, 20.0), "motion: expected a motion, got int; schuler.m"),
        (lambda: sc.report(RECORD, "x.html"), "a report is made of a result, got ImuRecord"),
        (lambda: Emd(threshold=-1), "threshold and siftings must be positive"),
        (lambda: Emd(ends="nowhere"), "ends must be one of"),
        (lambda: Hankel(rank=0), "rank must be 1 or more"),
        (lambda: Hankel(channels="all"), "channels must be accel, gyro or both"),
        (lambda: LowPass(frame="earth"), "frame must be inertial or body"),
        (lambda: Wavelet(levels=0), "levels must be 1 or more"),
        (lambda: Gate(gravity=-9.8), "positive gravity"),
    ],
)  # fmt: skip
def test_a_wrong_argument_is_named(call, told):
    with pytest.raises(InputError) as caught:
        call()
    assert str(caught.value).startswith(told) or told in str(caught.value)


def test_numbers_of_numpy_are_numbers():
    expect(np.float32(1.0), (float, np.floating), "x")
    assert sc.Site(np.float64(34.2)).lat == 34.2


def test_the_order_of_chunks_is_checked_with_a_prefilter_too():
    half = len(RECORD) // 2
    aligner = Aligner(SITE, Inertial(prefilter=LowPass(cutoff=1.0)))
    aligner.update(RECORD.rows(half, len(RECORD)))
    with pytest.raises(InputError, match="not after the last sample"):
        aligner.update(RECORD.rows(0, half))


def test_a_large_azimuth_gives_no_gyro_bias():
    fix = sc.align(RECORD, SITE, "kalman-large", "navigation-fog")
    assert fix.gyro_bias is None
    assert fix.to_dict()["gyro_bias_deg_h"] is None


def test_a_path_is_evaluated_against_the_truth_of_its_simulation():
    fix = sc.align(RECORD, SITE, at="start")
    path = sc.navigate(RECORD, SITE, fix)
    found = evaluate(path, MADE.truth)
    assert found.reference == "truth"
    assert np.all(found.radial < 100.0)
    assert np.all(np.abs(found.phi) < np.deg2rad(1.0))


def test_every_result_that_says_so_makes_a_report(tmp_path: Path):
    pytest.importorskip("plotly")
    fix = sc.align(RECORD, SITE, at="start")
    for name, result in (
        ("fix", fix), ("path", sc.navigate(RECORD, SITE, fix)),
        ("latitude", align_without_latitude(RECORD, "navigation-fog")),
    ):  # fmt: skip
        there = sc.report(result, tmp_path / f"{name}.html")
        assert there.stat().st_size > 10_000


def test_a_campaign_keeps_the_options_of_a_method():
    scenario = load_scenario(Path(__file__).parents[1] / "examples/scenarios/static_base.toml")
    campaign = Campaign(scenario, 2, methods=(KalmanAlignment(passes=3), KalmanAlignment()))
    assert campaign.methods == ("kalman(passes=3)", "kalman")
    assert parse_method(campaign.methods[0]) == KalmanAlignment(passes=3)


def test_a_dataset_takes_no_unit_that_it_would_pass_over():
    pytest.importorskip("xarray")
    from schuler.io import from_xarray

    with pytest.raises(TypeError, match="gyro"):
        from_xarray(RECORD.to_xarray(), gyro="deg/s")
