"""Heights, headings, Doppler velocities and given rest in the filter, on simulated drives."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from schuler.aiding import BodyVelocity, HeadingFixes, Height, ZeroRate
from schuler.aiding.checks import check_clock
from schuler.attitude import multiply, quat_to_matrix, quat_to_rotvec, rotvec_to_quat
from schuler.constants import DEG
from schuler.errors import InputError
from schuler.navigation import navigate_aided
from schuler.navigation.aid_measurements import aid_noise, aid_priors
from tests.conftest import chi_square_band
from tests.navigation.test_aided import QUIET, SPEC, drive

LENGTH = 100.0
RUNS = 8
SCALE_SIGMA, MOUNT_SIGMA, LEVER = 0.01, 0.05, np.array([0.5, -1.0, 0.3])
BASELINE = np.array([1.0, 0.5, 0.05])
#: nominal mounting of the Doppler log: an eighth of a turn about up
NOMINAL = np.array([0.0, 0.0, 0.25 * np.pi])
OFFSET_SIGMA, OFFSET_TIME = 30.0, 600.0


@cache
def made(seed):
    """Return a drive with its fixes, the aids, and what is true of them."""
    sim, gnss = drive(seed + 40, sigma=0.5, length=LENGTH)
    rng = np.random.default_rng(seed + 900)
    truth, record = sim.truth, sim.record
    t = np.arange(2.0, LENGTH - 1.0, 0.5)
    rows = np.searchsorted(truth.time, t - 1e-9)
    t = truth.time[rows]
    # Of a barometer: an offset that wanders.
    offset = np.empty(len(t))
    offset[0] = OFFSET_SIGMA * rng.standard_normal()
    keep = np.exp(-0.5 / OFFSET_TIME)
    for k in range(1, len(t)):
        step = OFFSET_SIGMA * np.sqrt(1.0 - keep**2) * rng.standard_normal()
        offset[k] = keep * offset[k - 1] + step
    # The estimate is that of the record's end.
    keep = np.exp(-(LENGTH - t[-1]) / OFFSET_TIME)
    end = keep * offset[-1] + OFFSET_SIGMA * np.sqrt(1.0 - keep**2) * rng.standard_normal()
    height = truth.height[rows] + offset + 0.3 * rng.standard_normal(len(t))
    turn = quat_to_matrix(truth.quat_nb[rows])
    baseline = turn @ BASELINE
    heading = np.arctan2(baseline[:, 0], baseline[:, 1]) + 0.2 * DEG * rng.standard_normal(len(t))
    scale = SCALE_SIGMA * rng.standard_normal()
    mount = multiply(rotvec_to_quat(MOUNT_SIGMA * rng.standard_normal(3)), rotvec_to_quat(NOMINAL))
    rate = np.column_stack([np.interp(t, record.time - 0.5 * record.dt, w) for w in record.gyro.T])
    body = np.einsum("iba,ib->ia", turn, truth.v_n[rows]) + np.cross(rate, LEVER)
    seen = (1.0 + scale) * body @ quat_to_matrix(mount).T + 0.02 * rng.standard_normal((len(t), 3))
    aids = {
        "height": Height(t, height, 0.3, OFFSET_SIGMA, OFFSET_TIME),
        "heading": HeadingFixes(t, heading + 2 * np.pi * rng.integers(-1, 2, len(t)), 0.2 * DEG,
                                BASELINE),
        "dvl": BodyVelocity(t, seen, 0.02, scale_sigma=SCALE_SIGMA, mount=NOMINAL,
                            mount_sigma=MOUNT_SIGMA, lever=LEVER, estimate=("scale", "mount")),
    }  # fmt: skip
    return sim, gnss, aids, {"offset": end, "scale": scale, "mount": mount}


@cache
def found(seed):
    sim, gnss, aids, _ = made(seed)
    return navigate_aided(
        sim.record, gnss, spec=SPEC, options=QUIET, aids=list(aids.values())
    )  # fmt: skip


def test_estimates_of_aids_are_as_good_as_their_sigma_says():
    """8 runs: normalised squares of offset, scale and mounting within the 99.9 % band each."""
    squares = np.zeros(5)
    for seed in range(RUNS):
        told, true = found(seed).estimated, made(seed)[3]
        offset, sigma = told["offset_m"]["height"]
        squares[0] += ((offset - true["offset"]) / sigma) ** 2
        scale, sigma = told["doppler_scale"]["dvl"]
        squares[1] += ((scale - true["scale"]) / sigma) ** 2
        assert sigma < 0.5 * SCALE_SIGMA
        mount, sigma = (np.array(x) * DEG for x in told["doppler_mount_deg"]["dvl"])
        off = quat_to_rotvec(multiply(rotvec_to_quat(mount), true["mount"] * [1, -1, -1, -1]))
        squares[2:] += (off / sigma) ** 2
        # About the axis of travel, which lies between x and y, a mounting does not show.
        assert sigma[2] < 0.05 * MOUNT_SIGMA
    low, high = chi_square_band(RUNS, 0.001)
    assert np.all((low < squares) & (squares < high)), squares


@pytest.mark.parametrize(("aid", "axes"), [("height", 1), ("heading", 1), ("dvl", 3)])
def test_innovations_are_as_large_as_their_sigma_says(aid, axes):
    total = count = 0.0
    for seed in range(RUNS):
        result = found(seed)
        time, z, sigma, weight = result.innovations[aid]
        late = time > 20.0
        assert np.mean(weight > 0.0) > 0.99
        total += np.sum((z[late, :axes] / sigma[late, :axes]) ** 2)
        count += axes * late.sum()
        assert result.used[aid] > 150
        assert result.consistent, result.contradictions
    low, high = chi_square_band(int(count), 0.001)
    assert low < total < high


def test_position_and_heading_gain_and_stay_consistent():
    """Errors at the end over 8 runs within the 99.9 % band, and a heading far better by the aid."""
    square, headings = 0.0, []
    for seed in range(RUNS):
        sim, *_ = made(seed)
        path = found(seed).path
        truth = sim.truth
        k = int(np.searchsorted(truth.time, path.time[-1] - 1e-9))
        off = np.array([
            (path.lon[-1] - truth.lon[k]) * 6.386e6 * np.cos(truth.lat[k]),
            (path.lat[-1] - truth.lat[k]) * 6.36e6, path.height[-1] - truth.height[k],
        ])  # fmt: skip
        square += np.sum(off**2 / path.variances[-1, 6:9])
        turn = multiply(path.quat_nb[-1], truth.quat_nb[k] * [1, -1, -1, -1])
        headings.append(quat_to_rotvec(turn)[2] / np.sqrt(path.variances[-1, 2]))
        assert np.sqrt(path.variances[-1, 2]) < 0.1 * DEG
    low, high = chi_square_band(3 * RUNS, 0.001)
    assert low < square < high
    low, high = chi_square_band(RUNS, 0.001)
    assert low < np.sum(np.square(headings)) < high


def test_a_doppler_log_bridges_an_outage():
    sim, gnss, aids, _ = made(0)
    gap = (np.asarray(gnss.time) < 60.0) | (np.asarray(gnss.time) > 95.0)
    errors = []
    for more in ([], [aids["dvl"]]):
        path = navigate_aided(
            sim.record, gnss.rows(gap), spec=SPEC, options=QUIET, aids=more
        ).forward  # fmt: skip
        k = int(np.searchsorted(path.time, 94.0))
        t = path.time[k]
        north = (np.interp(t, sim.truth.time, sim.truth.lat) - path.lat[k]) * 6.36e6
        east = (np.interp(t, sim.truth.time, sim.truth.lon) - path.lon[k]) * 4.9e6
        errors.append(np.hypot(north, east))
    assert errors[1] < 0.5 * errors[0]


def test_given_rest_shows_the_gyro_bias():
    sim, gnss, *_ = made(1)
    sigmas = []
    for more in ([], [ZeroRate([(3.0, 14.0), (200.0, 300.0)])]):
        result = navigate_aided(sim.record, gnss, spec=SPEC, options=QUIET, aids=more)
        sigmas.append(np.array(result.estimated["gyro_bias_deg_h"][1]))
    assert result.used["zero_rate_given"] == 11
    assert np.all(sigmas[1] < [0.95, 0.95, 0.85] * sigmas[0])


def test_means_of_given_rest():
    time = np.arange(1, 1001) * 0.01
    rate = np.zeros((1000, 3))
    rate[500:] = 1.0
    ends, means, sigma = ZeroRate([(0.0, 3.0), (2.5, 4.2), (6.0, 8.0)]).means(time, rate)
    assert ends.tolist() == pytest.approx([1.0, 2.0, 3.0, 4.0, 7.0, 8.0])
    assert means[:, 0].tolist() == [0, 0, 0, 0, 1, 1]
    assert sigma.tolist() == [1e-9] * 3
    assert len(ZeroRate([(20.0, 30.0)]).means(time, rate)[0]) == 0


def test_aids_outside_or_unlike_the_record_are_refused():
    sim, gnss, aids, _ = made(2)

    def run(*some):
        return navigate_aided(sim.record, gnss, spec=SPEC, options=QUIET, aids=some)

    with pytest.raises(InputError, match=r"height: its times, .* share too little"):
        run(replace(aids["height"], time=np.asarray(aids["height"].time) + 1e5))
    with pytest.raises(InputError, match="two aids have the name 'height'"):
        run(aids["height"], aids["height"])
    with pytest.raises(InputError, match=r"say its frame, as FRD|its axes are not right"):
        run(BodyVelocity(aids["dvl"].time, np.tile([12.0, 0.0, 0.0], (len(aids["dvl"]), 1))))
    with pytest.raises(InputError, match="none of its spans"):
        run(ZeroRate([(1000.0, 1010.0)]))


@pytest.mark.parametrize("off", [18.0, -1.5, -3.0, -18.0])
def test_clocks_apart_are_found_by_the_turns(off):
    sim, gnss = drive(51, sigma=0.5)
    check_clock(sim.record, gnss)
    check_clock(sim.record, replace(gnss, time=np.asarray(gnss.time) + 0.3))
    apart = replace(gnss, time=np.asarray(gnss.time) + off)
    words = f"An offset of \\{-off:+.1f} s" if off < 0 else f"An offset of {-off:+.1f} s"
    with pytest.raises(InputError, match=words) as caught:
        navigate_aided(sim.record, apart, spec=SPEC, options=QUIET)
    check_clock(sim.record, replace(apart, delay=off) if abs(off) < 10.0 else gnss)
    assert ("leap seconds" in str(caught.value)) == (abs(off) == 18.0)


def test_without_turns_no_clock_is_doubted():
    sim, gnss = drive(52, sigma=0.5, length=40.0)
    check_clock(sim.record, replace(gnss, time=np.asarray(gnss.time) + 18.0))
    check_clock(sim.record, replace(gnss, v_n=None))


def test_a_doppler_log_that_is_turned_contradicts():
    sim, gnss, aids, _ = made(3)
    log = replace(aids["dvl"], mount=NOMINAL - [0.0, 0.0, 0.6], mount_sigma=0.1)
    result = navigate_aided(sim.record, gnss, spec=SPEC, options=QUIET, aids=[log])
    assert not result.consistent
    assert any("the axes of dvl are turned by" in text for text in result.contradictions)


def test_priors_and_noise_are_those_of_the_aids():
    height = Height([0.0, 1.0], [1.0, 2.0], offset_time=np.inf)
    plain = Height([0.0, 1.0], [1.0, 2.0], offset_sigma=0.0, name="plain")
    log = BodyVelocity([0.0, 1.0], np.zeros((2, 3)), estimate=("scale", "mount", "lever"))
    assert aid_priors([height, plain, log]) == {
        "height.offset": 100.0, "dvl.scale": 0.01, "dvl.mount": 0.05, "dvl.lever": 1.0,
    }  # fmt: skip
    assert set(aid_noise([height, plain, log])) == {"height.offset"}
