"""`Aligner`: any chunking the same bits, clear refusals, stated warnings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from schuler.alignment import Aligner, Analytic, Inertial, align, convergence, parse_method
from schuler.earth import Site
from schuler.errors import InputError
from schuler.record import ImuRecord
from schuler.sensors import ImuSpec
from tests.alignment.conftest import SITE, WHITE
from tests.conftest import pieces

FIELDS = ("quat_nb", "covariance", "bound")


def same(a, b):
    """Tell whether two results agree in every bit."""
    return (
        all(np.array_equal(getattr(a, f), getattr(b, f)) for f in FIELDS)
        and a.budget_arcmin2 == b.budget_arcmin2
        and (a.start, a.end, a.samples, a.warnings) == (b.start, b.end, b.samples, b.warnings)
        and np.array_equal(a.history.rows, b.history.rows)
    )


@settings(max_examples=25)
@given(
    st.lists(st.integers(0, 10_000), max_size=12),
    st.sampled_from([Inertial(), Inertial(subsamples=2), Inertial(subsamples=3),
                     Inertial("wahba", 4), Inertial("instants-triad"), Analytic()]),
)  # fmt: skip
def test_any_chunking_gives_the_same_bits(truck, cuts, method):
    whole = align(truck.record, SITE, method, WHITE)
    part = Aligner(SITE, method, WHITE)
    for s in pieces(len(truck.record), cuts):
        part.update(truck.record.rows(s.start, s.stop))
        if part.samples > 100:
            part.solution()  # looking must not disturb
    assert same(part.solution(), whole)


def test_waiting_samples_are_not_lost(truck):
    """A count that is no multiple of the samples to an update uses them all."""
    short = truck.record.rows(0, 9999)
    fix = align(short, SITE, Inertial(subsamples=4))
    assert fix.samples == 9999
    assert fix.history.duration == pytest.approx(99.99)
    assert fix.end == pytest.approx(99.99)
    assert fix.history.rows[-1, 33:36] == pytest.approx(short.dvel.sum(axis=0), rel=1e-12)


def test_corrected_increments_are_not_corrected_again(truck):
    plain = align(truck.record, SITE)
    done = align(replace(truck.record, coning_corrected=True, sculling_corrected=True), SITE)
    assert not np.array_equal(plain.quat_nb, done.quat_nb)


def test_the_rate_chooses_the_algorithm(truck):
    chosen = []
    for dt in (0.01, 0.002, 0.0008, 0.0004):
        a = Aligner(SITE)
        r = truck.record.rows(0, 4)
        n = dt * np.arange(1, 5)
        a.update(ImuRecord(n, np.full(4, dt), r.dtheta, r.dvel))
        chosen.append(a._subsamples)
    assert chosen == [1, 2, 3, 4]


@pytest.mark.parametrize("lat", [89.5, -89.5])
def test_a_pole_is_refused(lat):
    with pytest.raises(InputError, match="pole"):
        Aligner(Site(lat))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda r: Aligner(SITE, "sextant"), "unknown method 'sextant'"),
        (lambda r: Aligner(SITE, at="noon"), "at must be"),
        (lambda r: Aligner(SITE, spec="no-such-grade"), "neither a grade"),
        (lambda r: Aligner(SITE).solution(), "no samples"),
        (lambda r: Inertial("magic"), "estimator must be"),
        (lambda r: Inertial(subsamples=5), "subsamples must be"),
        (lambda r: Analytic("sun"), "base must be"),
        (lambda r: Aligner(SITE).update(r.rows(0, 50)).update(r.rows(40, 60)), "not after"),
        (
            lambda r: Aligner(SITE).update(replace(r, dtheta=r.dtheta[:, :2])),
            "three gyros and three accelerometers",
        ),
        (lambda r: align(replace(r, dvel=r.dvel / 9.80665), SITE), "were in g"),
        (lambda r: align(replace(r, dvel=0 * r.dvel), SITE), "accelerometers read nothing"),
        (lambda r: align(replace(r, dtheta=0 * r.dtheta), SITE, "analytic"), "mean rate is zero"),
    ],
)
def test_refusals(truck, call, words):
    with pytest.raises(InputError, match=words) as caught:
        call(truck.record)
    assert "\n" not in str(caught.value)


def test_warnings_are_stated(still):
    fix = align(still.record, SITE)
    assert any("no instrument specification" in text for text in fix.warnings)
    assert fix.limit_arcmin is None
    # Zero noise is less than any specification has.
    fix = align(still.record, SITE, spec=WHITE)
    assert any("too little for chance" in text for text in fix.warnings)
    turned = align(replace(still.record, dtheta=57.29578 * still.record.dtheta), SITE, "analytic")
    assert any("in deg/s" in text for text in turned.warnings)
    wrong = align(still.record, Site(-40.0))
    assert not wrong.consistent
    assert "sign of the latitude" in wrong.headline()


def test_a_noisy_record_keeps_its_specification(still):
    from schuler.sensors.noise import corrupt

    rng = np.random.default_rng(2)
    r = still.record
    gyro = corrupt(r.dtheta, r.dt, WHITE.gyro, rng).increments
    accel = corrupt(r.dvel, r.dt, WHITE.accelerometer, rng).increments
    fix = align(ImuRecord(r.time, r.dt, gyro, accel), SITE, spec=WHITE)
    assert fix.spec is WHITE
    assert fix.warnings == ()


def test_an_instrument_that_cannot_tell_north_says_so(still):
    mems = ImuSpec.from_dict({"gyro": {"bias": "720 deg/h"}, "accelerometer": {"bias": "16 mg"}})
    fix = align(still.record, SITE, spec=mems)
    assert any("cannot tell north" in text for text in fix.warnings)


def test_result_is_plain(still):
    fix = align(still.record, SITE, spec=WHITE)
    assert fix.covariance == pytest.approx(sum(fix.budget.values()))
    assert fix.time == fix.end
    assert align(still.record, SITE, at="start").time == fix.start == 0.0
    assert str(fix).startswith(f"heading {fix.heading_deg:.3f} deg ± ")
    rotated = fix.rotation.apply([0.0, 1.0, 0.0])
    heading = np.degrees(np.arctan2(rotated[0], rotated[1])) % 360
    assert heading == pytest.approx(fix.heading_deg)
    assert "optimal" in str(fix)
    assert "chosen because the base is at rest" in str(fix)


def test_convergence_ends_at_the_result(truck):
    fix = align(truck.record, SITE, spec="navigation-fog")
    c = convergence(fix, 20)
    assert c.heading_deg[-1] == pytest.approx(fix.heading_deg, abs=1e-9)
    assert c.sigma_arcmin[-1] == pytest.approx(fix.sigma_arcmin[2], rel=1e-9)
    assert np.all(np.diff(c.t) > 0)
    assert c.sigma_arcmin[-1] < 0.2 * c.sigma_arcmin[0]


@pytest.mark.parametrize("name", ["centred", "Wahba", " analytic "])
def test_method_names(name):
    assert str(parse_method(name)) == name.strip().lower()


def test_a_prefilter_runs_on_the_whole_record(truck):
    from schuler.prefilter import LowPass

    prefilter = LowPass(cutoff=0.2, zero_phase=True)
    method = Inertial(prefilter=prefilter)
    by_hand = align(prefilter(truck.record), SITE)
    fix = align(truck.record, SITE, method)
    assert fix.method == method
    assert np.array_equal(fix.quat_nb, by_hand.quat_nb)
    pieces_of_it = Aligner(SITE, method)
    for chunk in truck.record.chunks(777):
        pieces_of_it.update(chunk)
    assert pieces_of_it.samples == len(truck.record)
    assert np.array_equal(pieces_of_it.solution().quat_nb, fix.quat_nb)


@pytest.mark.parametrize(
    "name", ["emd", "gate", "gate-printed", "hankel", "lowpass", "lowpass-zero-phase", "wavelet"]
)
def test_prefilter_names(name):
    from schuler.prefilter import PREFILTERS, parse_prefilter

    assert name in PREFILTERS
    assert callable(parse_prefilter(name))
    assert parse_prefilter("none") is None
    with pytest.raises(InputError, match="unknown prefilter"):
        parse_prefilter(name + "x")


def test_a_specification_without_bias_is_said_to_hold_none(still):
    spec = replace(WHITE, gyro=replace(WHITE.gyro, bias=0.0), name="from allan")
    fix = align(still.record, SITE, spec=spec)
    assert "(repeatability: no bias in it; " in fix.headline()
    assert any("'from allan' holds no gyro bias" in text for text in fix.warnings)
    assert "repeatability" not in align(still.record, SITE, spec="navigation-fog").headline()
