"""Transfer alignment on simulated flights: figures, consistency, what straight flight hides."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import schuler as sc
from schuler.alignment.transfer import Flexure, MasterNoise, TransferAlignment
from schuler.attitude import multiply, quat_to_rotvec, rotvec_to_quat
from schuler.errors import InputError
from schuler.sensors import CONSUMER_MEMS, GRADES
from tests.alignment.moving.routes import car, truth_of
from tests.alignment.transfer.aircraft import (
    ATTITUDE,
    DELAY,
    LEVER,
    VELOCITY,
    case,
    clean,
    errors,
    master_of,
    with_errors,
)
from tests.conftest import ROOT, chi_square_band

NOISE = MasterNoise(ATTITUDE, VELOCITY)
RUNS = 12


def aligned(path, seed, **options):
    """Return the result of a seeded run with its errors."""
    record, master, made, mounting = case(path, seed, flexure=options.pop("bends", 0.0))
    fix = sc.transfer(record, master, spec="tactical-fog", noise=NOISE, **options)
    return fix, errors(fix, made, mounting)


@pytest.mark.parametrize("path", ["rock", "turn", "straight"])
def test_errors_of_attitude_and_mounting_are_as_large_as_their_sigma(path):
    phi, mount, late = [], [], []
    for seed in range(RUNS):
        fix, (p, m, _, dt) = aligned(path, seed)
        assert fix.consistent
        phi.append(p @ np.linalg.solve(fix.covariance, p))
        mount.append(m @ np.linalg.solve(fix.mounting_covariance, m))
        late.append((dt / fix.delay[1]) ** 2)
    low, high = chi_square_band(3 * RUNS, 0.002)
    assert low < np.sum(phi) < high
    # The mounting of straight flight is nearer to the prior's mean than its 5 deg: no lower bound.
    assert np.sum(mount) < high
    assert np.sum(late) < chi_square_band(RUNS, 0.002)[1]


def test_wing_rock_and_a_turn_reach_the_figures_and_straight_flight_says_what_it_hides():
    """Per axis within what the instrument and the master's noise allow, mrad."""
    for path, most, delay in (("rock", (0.36, 0.59, 0.11), 3.6e-4), ("turn", (0.2, 0.06, 0.08),
                                                                     3.6e-4)):  # fmt: skip
        found = [aligned(path, seed) for seed in range(10)]
        rms = 1e3 * np.sqrt(np.mean([e[0] ** 2 for _, e in found], axis=0))
        assert np.all(rms < most), rms
        assert np.sqrt(np.mean([e[3] ** 2 for _, e in found])) < delay
        for fix, _ in found:
            seen = set(fix.remaining) - set(fix.not_observable)
            assert {
                "heading",
                "mounting about right",
                "mounting about forward",
                "mounting about up",
                "delay",
                "lever arm right",
                "lever arm up",
            } <= seen
    fix, (phi, _, _, _) = aligned("straight", 3)
    assert {"heading", "mounting about up", "lever arm forward"} <= set(fix.not_observable)
    assert "tilt about east" not in fix.not_observable
    assert np.all(np.abs(phi[:2]) < 1.5e-3)
    assert any("rock the wings" in text for text in fix.warnings)
    # The same span with a turn before it is another thing: a lever across it is then seen.
    assert "lever arm forward" not in aligned("turn", 3)[0].not_observable


def test_flexure_as_states_is_consistent_where_plain_noise_is_too_sure():
    bends = 1e-3
    squares = {True: [], False: []}
    for seed in range(RUNS):
        for states in squares:
            fix, (_, m, _, _) = aligned(
                "rock", seed, bends=bends, flexure=Flexure(bends, 0.5, states)
            )
            squares[states].append(m @ np.linalg.solve(fix.mounting_covariance, m))
    low, high = chi_square_band(3 * RUNS, 0.002)
    assert low < np.sum(squares[True]) < high
    assert np.sum(squares[False]) > high


def test_a_master_noisier_than_it_is_taken_for_is_found_out():
    squares = []
    for seed in range(4):
        record, master, made, mounting = case("turn", seed)
        rng = np.random.default_rng(100 + seed)
        count = len(master)
        noisier = replace(
            master, v_n=master.v_n + 0.2 * rng.standard_normal((count, 3)),
            quat_nb=np.asarray(
                multiply(rotvec_to_quat(2e-3 * rng.standard_normal((count, 3))), master.quat_nb)
            ),
        )  # fmt: skip
        fix = sc.transfer(record, noisier, spec="tactical-fog")
        assert fix.consistent
        assert fix.mean_square == pytest.approx(1.0, abs=0.3)
        assert any("noise was taken for" in text for text in fix.warnings), fix.warnings
        phi = errors(fix, made, mounting)[0]
        squares.append(phi @ np.linalg.solve(fix.covariance, phi))
    assert np.sum(squares) < chi_square_band(12, 0.002)[1]
    # What is said of it is kept, and contradicts.
    told = sc.transfer(record, noisier, spec="tactical-fog", noise=NOISE)
    assert not told.consistent


@pytest.mark.parametrize("spec", [GRADES["industrial-mems"], CONSUMER_MEMS], ids=lambda s: s.name)
def test_noisy_gyros_make_neither_lever_nor_delay_look_observable(spec):
    """A car, MEMS beside a precise master: rates are the master's, and flicker is a walk."""
    made = truth_of(car(), 60.0)
    lever, squares, mounts = np.array([0.5, 1.0, 0.2]), [], []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        mounting = rotvec_to_quat(0.05 * rng.standard_normal(3))
        record = with_errors(made, spec, rng)
        master = master_of(made, mounting, rng=rng, lever=lever, delay=0.03)
        fix = sc.transfer(record, master, spec=spec, noise=NOISE)
        assert fix.consistent, fix.contradictions
        phi, wrong, _, _ = errors(fix, made, mounting)
        squares.append(phi @ np.linalg.solve(fix.covariance, phi))
        mounts.append(wrong @ np.linalg.solve(fix.mounting_covariance, wrong))
        assert np.all(np.abs(fix.lever - lever) < 4.0 * fix.lever_sigma)
        assert abs(fix.delay[0] - 0.03) < 4.0 * fix.delay[1]
    most = chi_square_band(9, 0.002)[1]
    assert np.sum(squares) < most
    assert np.sum(mounts) < most
    # Velocities alone would not tell the delay of such a unit, and it is said.
    fix = sc.transfer(
        record, master, spec=CONSUMER_MEMS, noise=NOISE, match="velocity", lever=lever
    )
    assert fix.delay == (0.0, 0.1)
    assert "delay" in fix.not_observable


def test_without_noise_the_mounting_is_found_whatever_its_size_and_the_lever_and_delay_too():
    made = clean("turn", 20.0)
    mounting = rotvec_to_quat(np.array([0.02, -0.3, 1.6]))
    master = master_of(made, mounting, every=5)
    fix = sc.transfer(made.record, master, spec="navigation-fog", noise=NOISE)
    phi, wrong, lever, delay = errors(fix, made, mounting)
    assert np.abs(phi).max() < 2e-6
    assert np.abs(wrong).max() < 2e-6
    assert np.abs(lever).max() < 2e-3
    assert abs(delay) < 2e-6
    assert any("turned by about 9" in text for text in fix.warnings)


@pytest.mark.parametrize(
    "match",
    ["velocity", "attitude", "velocity+attitude+position", "velocity+attitude+rate",
     "velocity+rate"],
)  # fmt: skip
def test_each_mode_is_consistent_in_a_turn(match):
    squares = []
    for seed in range(6):
        # A given lever and delay: position shows them together with where the slave is.
        fix, (phi, _, _, _) = aligned("turn", seed, match=match, lever=LEVER, delay=DELAY)
        assert fix.consistent, fix.contradictions
        squares.append(phi @ np.linalg.solve(fix.covariance, phi))
        assert set(fix.used) == {f"master_{part}" for part in match.split("+")}
    assert np.sum(squares) < chi_square_band(18, 0.002)[1]


def test_what_is_given_is_kept_and_costs_nothing():
    record, master, made, mounting = case("turn", 0)
    plain = sc.transfer(record, master, spec="tactical-fog", noise=NOISE)
    told = sc.transfer(
        record, master, spec="tactical-fog", noise=NOISE, mounting=mounting, lever=LEVER,
        delay=DELAY,
    )  # fmt: skip
    np.testing.assert_array_equal(told.mounting, mounting)
    np.testing.assert_array_equal(told.lever, LEVER)
    assert told.delay == (DELAY, 0.0)
    assert np.all(told.sigma_arcmin < plain.sigma_arcmin)
    assert not [name for name in told.remaining if name.startswith(("mounting", "lever", "delay"))]
    near = multiply(mounting, rotvec_to_quat(np.array([0.002, 0.0, 0.0])))
    about = sc.transfer(
        record, master, spec="tactical-fog", noise=NOISE, mounting=near, mounting_sigma=0.005
    )
    assert np.abs(errors(about, made, mounting)[1]).max() < 5e-4


def test_the_slave_navigates_on_alone_and_is_compared_with_its_master():
    record, master, made, _ = case("turn", 1)
    fix = sc.transfer(
        record, master, spec="tactical-fog", noise=NOISE, span=(None, 12.0), then_free=6.0
    )
    assert isinstance(fix, TransferAlignment)
    free = fix.free
    assert free.seconds == pytest.approx(6.0, abs=0.11)
    # Six seconds with a tilt of half a milliradian, and the noise of one row.
    assert np.abs(free.velocity[-1]).max() < 0.15
    assert np.abs(free.position[-1]).max() < 1.5
    assert np.abs(free.attitude[-1]).max() < 1.5e-3
    # Without an end it aligns as long as it can.
    last = sc.transfer(record, master, spec="tactical-fog", noise=NOISE, then_free=6.0)
    assert last.end == pytest.approx(record.end - 6.5, abs=0.11)
    assert last.free.seconds == pytest.approx(6.0, abs=0.11)
    out = fix.to_dict()
    assert out["transfer"]["free"]["seconds"] == free.seconds
    start = sc.Start.from_alignment(fix)
    path = sc.navigate(record.between(fix.end, None), start, spec="tactical-fog")
    k = -1
    off = quat_to_rotvec(
        multiply(path.quat_nb[k], made.truth.quat_nb[k] * np.array([1.0, -1.0, -1.0, -1.0]))
    )
    assert np.abs(off).max() < 2e-3


def test_the_result_is_one_in_motion_with_its_schema():
    from jsonschema import Draft202012Validator

    fix, _ = aligned("turn", 2)
    data = json.loads(fix.to_json())
    schema = json.loads((ROOT / "docs" / "alignment.schema.json").read_text())
    Draft202012Validator(schema).validate(data)
    assert data["aids"]["form"] == "master"
    assert data["transfer"]["delay_s"][0] == pytest.approx(DELAY, abs=1e-3)
    for axis in data["transfer"]["lever_m"]:
        assert np.isfinite(axis)
    assert "mounting yaw" in str(fix)
    begin, _ = aligned("turn", 2)
    assert sc.transfer(
        *case("turn", 2)[:2], spec="tactical-fog", noise=NOISE, at="start"
    ).time == pytest.approx(begin.start)


def test_impossible_requests_are_refused_in_a_sentence():
    record, master, _, _ = case("turn", 0)

    def refused(text, *, of=None, **options):
        with pytest.raises(InputError, match=text):
            sc.transfer(record, of or master, spec="tactical-fog", **options)

    refused("has no attitude", of=replace(master, quat_nb=None))
    refused("has no velocity", of=replace(master, v_n=None))
    refused("share too little", of=replace(master, time=master.time + 5000.0))
    refused("match is made of", match="speed")
    refused("rates alone", match="rate")
    refused("must go on to", then_free=60.0)
    refused("must go on to", then_free=10.0, span=(None, record.end - 5.0))
    refused("unit quaternion", mounting=(1.0, 1.0, 0.0, 0.0))
    refused("three finite", lever=(1.0, np.nan, 0.0))
    refused("delay", delay=60.0)
    with pytest.raises(InputError, match="1-sigma"):
        MasterNoise(velocity=0.0)
    with pytest.raises(InputError, match="flexure"):
        Flexure(0.0)
    few = master.rows(slice(0, 3))
    refused("needs 5", of=few)
    gap = master.rows(np.r_[0:30, 150:190])
    refused("no row for", of=gap)
