"""Low-pass, gate, Hankel and wavelet filters: what they keep, what they take, how they start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from schuler.errors import InputError
from schuler.prefilter import Gate, Hankel, LowPass, Wavelet
from schuler.prefilter.hankel import truncate
from schuler.record import ImuRecord
from tests.conftest import pieces

N, DT = 6000, 0.01
TIME = DT * np.arange(1, N + 1)


def record_of(force, rate=None):
    """Return a record with one column given to every axis."""
    rate = np.zeros(N) if rate is None else rate
    return ImuRecord(
        TIME,
        np.full(N, DT),
        np.repeat(rate[:, None], 3, 1) * DT,
        np.repeat(force[:, None], 3, 1) * DT,
    )


BOTH = LowPass(start_span=1.0, channels="both", frame="body")

FILTERS = [
    LowPass(), LowPass(zero_phase=True), LowPass(kind="fir", cutoff=0.5),
    LowPass(kind="fir", cutoff=0.5, zero_phase=True), Hankel(), Wavelet(),
]  # fmt: skip


@pytest.mark.parametrize("prefilter", FILTERS, ids=str)
def test_a_constant_passes_from_the_first_sample_on(prefilter):
    out = prefilter(record_of(np.full(N, 9.8)))
    np.testing.assert_allclose(out.accel, 9.8, rtol=1e-9)
    np.testing.assert_array_equal(out.time, TIME)


@pytest.mark.parametrize("prefilter", FILTERS, ids=str)
def test_slow_stays_and_fast_goes(prefilter):
    slow = 9.8 + 0.01 * np.sin(2 * np.pi * 0.005 * TIME + 0.3)
    noise = 0.05 * np.random.default_rng(1).standard_normal(N)
    out = prefilter(record_of(slow + noise)).accel[:, 0]
    assert np.std((out - slow)[N // 4 : -N // 4]) < 0.3 * np.std(noise)


def test_zero_phase_does_not_delay():
    slow = np.sin(2 * np.pi * 0.02 * TIME)
    inside = slice(N // 4, -N // 4)
    late = LowPass(cutoff=0.1)(record_of(slow)).accel[inside, 0]
    prompt = LowPass(cutoff=0.1, zero_phase=True)(record_of(slow)).accel[inside, 0]
    assert np.abs(prompt - slow[inside]).max() < 0.01
    assert np.abs(late - slow[inside]).max() > 0.1


@pytest.mark.parametrize("frequency", [0.02, 0.05, 0.2])
def test_butterworth_has_its_attenuation(frequency):
    """1 / sqrt(1 + (f / fc)^2n), from the steady amplitude."""
    time = DT * np.arange(1, 60_001)
    tone = np.sin(2 * np.pi * frequency * time)
    record = ImuRecord(time, np.full(len(time), DT), np.zeros((len(time), 3)),
                       np.repeat(tone[:, None], 3, 1) * DT)  # fmt: skip
    out = LowPass(cutoff=0.05, order=2)(record).accel[30_000:, 0]
    gain = np.sqrt(2.0) * out.std()
    assert gain == pytest.approx(1 / np.sqrt(1 + (frequency / 0.05) ** 4), rel=0.01)


@settings(max_examples=20)
@given(st.lists(st.integers(0, N), max_size=8))
def test_a_stream_gives_the_same_whatever_the_chunks(cuts):
    rng = np.random.default_rng(5)
    record = record_of(9.8 + rng.standard_normal(N), rng.standard_normal(N))
    stream = BOTH.stream()
    parts = [stream.push(record.rows(s.start, s.stop)) for s in pieces(N, cuts)]
    joined = ImuRecord.concatenate([p for p in parts if len(p)])
    whole = BOTH(record)
    np.testing.assert_allclose(joined.dvel, whole.dvel, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(joined.dtheta, whole.dtheta, rtol=1e-12, atol=1e-14)


def test_gate():
    force = np.full(N, 9.8)
    force[1000:1005] = 10.5
    force[2000] = 9.0
    record = ImuRecord(
        TIME, np.full(N, DT), np.zeros((N, 3)), np.outer(force * DT, [0.0, 0.0, 1.0])
    )
    both = Gate(gravity=9.8)
    assert np.flatnonzero(both.rejected(record)).tolist() == [*range(1000, 1005), 2000]
    np.testing.assert_allclose(both(record).accel[:, 2], 9.8)
    printed = Gate(gravity=9.8, two_sided=False)(record).accel[:, 2]
    assert printed[2000] == pytest.approx(9.0)
    assert printed[1002] == pytest.approx(9.8)
    with pytest.raises(InputError, match="rejects every sample"):
        Gate(gravity=8.0)(record)


def test_hankel_keeps_what_its_matrix_says():
    """Against the singular value decomposition itself, on a series short enough for it."""
    rng = np.random.default_rng(4)
    x = np.sin(0.2 * np.arange(300)) + 0.01 * np.arange(300) + 0.3 * rng.standard_normal(300)
    window = 60
    matrix = np.lib.stride_tricks.sliding_window_view(x, 300 - window + 1)
    u, s, vt = np.linalg.svd(matrix, full_matrices=False)
    low = (u[:, :4] * s[:4]) @ vt[:4]
    total, count = np.zeros(300), np.zeros(300)
    for i in range(window):
        total[i : i + low.shape[1]] += low[i]
        count[i : i + low.shape[1]] += 1
    np.testing.assert_allclose(truncate(x, 4, window), total / count, atol=1e-9)


def test_hankel_is_feasible_for_sixty_thousand_samples():
    x = np.random.default_rng(1).standard_normal(60_000)
    assert truncate(x, 4, 400).shape == x.shape


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda r: LowPass(cutoff=60.0)(r), "below half the sampling rate"),
        (lambda r: LowPass(kind="bessel"), "kind must be"),
        (lambda r: LowPass(cutoff=-1.0), "must be positive"),
        (lambda r: LowPass(channels="some")(r), "channels must be"),
        (lambda r: LowPass(zero_phase=True).stream(), "only the causal"),
        (lambda r: LowPass(frame="moon")(r), "frame must be"),
        (lambda r: LowPass()(r.rows(0, 3)), "16 samples"),
        (lambda r: Gate(gravity=-9.8), "positive gravity"),
        (lambda r: Hankel(rank=0)(r), "rank"),
        (lambda r: Wavelet("unheard-of")(r), "unknown discrete wavelet"),
        (lambda r: Wavelet(levels=99)(r), "levels must be"),
        (
            lambda r: LowPass()(replace(r, dt=np.where(np.arange(N) == 70, 0.05, DT))),
            "even sampling",
        ),
    ],
)
def test_errors(call, words):
    with pytest.raises(InputError, match=words):
        call(record_of(np.full(N, 9.8)))


def test_in_the_inertial_frame_sway_is_no_disturbance():
    """A rocking body under gravity: filtered in the held frame its force stays gravity."""
    from schuler.earth import Site
    from schuler.motion import Lines, Sway
    from schuler.simulation import simulate

    rocking = Sway(lines=(Lines("pitch", 0.5, 2.0, 0.0), Lines("roll", 0.3, 3.0, 1.0)))
    made = simulate(rocking, Site(40.0), 60.0).record
    held, body = (LowPass(frame=f, zero_phase=True)(made) for f in ("inertial", "body"))
    assert np.abs(held.accel - made.accel).max() < 4e-3
    assert np.abs(body.accel - made.accel).max() > 0.2


def test_the_low_pass_starts_from_gravity_alone():
    """A motion of the vehicle in the first second leaves no transient behind."""
    time = 0.01 * np.arange(1, 12_001)
    gravity = 9.8 - 5e-4 * time
    force = gravity + 0.2 * np.cos(2.0 * np.pi * 0.3 * time)
    dt = np.full(len(time), 0.01)
    dvel = np.outer(force * dt, [0.0, 0.0, 1.0])
    record = ImuRecord(time, dt, np.zeros((len(time), 3)), dvel)
    error = {
        span: np.abs(LowPass(start_span=span)(record).accel[:2000, 2] - gravity[:2000]).max()
        for span in (1.0, 300.0)
    }
    assert error[1.0] > 0.05
    assert error[300.0] < 0.2 * error[1.0]


def test_the_start_is_the_line_that_gravity_makes():
    """A step of the displacement at any time leaves the line within a fraction of its share."""
    from schuler.prefilter.lowpass import _line

    n, ahead = 15_000, 6000
    k = np.arange(n)
    exact = 9.8 - 3e-6 * np.arange(-ahead, 0)
    np.testing.assert_allclose(_line(9.8 - 3e-6 * k, ahead), exact, rtol=1e-9)
    rng = np.random.default_rng(1)
    errors: dict[str, list[float]] = {"velocity": [], "force": []}
    for _ in range(40):
        # A bounded velocity: the force of a vehicle that shakes and stays.
        shaking = np.diff(rng.standard_normal(n + 1))
        force = 9.8 - 3e-6 * k + shaking
        errors["velocity"].append(_line(force, ahead)[0] - exact[0])
        slope = np.polynomial.Polynomial.fit(k, force, 1)
        errors["force"].append(float(slope(-ahead)) - exact[0])
    assert np.std(errors["velocity"]) < 0.2 * np.std(errors["force"])
