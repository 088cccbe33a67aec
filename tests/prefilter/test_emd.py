"""Decomposition: exact sums, agreement with another library, ends, stop rules, noise split."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from schuler.errors import InputError
from schuler.prefilter import Emd, ceemdan, decompose, split_index
from schuler.record import ImuRecord

N = 2000
T = np.arange(N) / 100.0

SIGNALS = {
    "two tones": np.sin(2 * np.pi * T) + np.sin(2 * np.pi * 0.13 * T),
    "tone and trend": np.sin(2 * np.pi * 0.7 * T) + 0.02 * T**1.5,
    "modulated": (1 + 0.5 * np.sin(2 * np.pi * 0.05 * T)) * np.sin(4 * np.pi * T)
    + np.sin(2 * np.pi * 0.3 * T),
    "chirp": np.sin(2 * np.pi * (1 + 0.05 * T) * T) + np.sin(2 * np.pi * 0.1 * T),
    "three tones": np.sin(8 * np.pi * T) + 0.7 * np.sin(2 * np.pi * 0.9 * T)
    + 1.5 * np.sin(2 * np.pi * 0.15 * T),
}  # fmt: skip


def correlation(a, b):
    return abs(float(np.corrcoef(a, b)[0, 1]))


@settings(max_examples=40)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from(["mirror", "predict", "linear"]),
    st.sampled_from(["fixed", "standard-deviation", "evolved"]),
)
def test_modes_add_up(seed, ends, stop):
    rng = np.random.default_rng(seed)
    x = np.cumsum(rng.standard_normal(rng.integers(8, 400))) + rng.standard_normal()
    modes = decompose(x, ends=ends, stop=stop, siftings=10)
    np.testing.assert_allclose(modes.sum(axis=0), x, atol=1e-9 * np.abs(x).max())
    assert np.all(np.isfinite(modes))


@pytest.mark.parametrize("name", list(SIGNALS))
def test_mirrored_ends_agree_with_another_library(name):
    """The two strongest modes match those of EMD-signal with ten fixed siftings."""
    pyemd = pytest.importorskip("PyEMD")
    x = SIGNALS[name]
    ours = decompose(x, ends="mirror", stop="fixed", siftings=10)
    theirs = pyemd.EMD(FIXE=10).emd(x)
    for mode in ours[:2]:
        assert max(correlation(mode, other) for other in theirs) >= 0.99


def test_two_tones_come_apart():
    modes = decompose(SIGNALS["two tones"])
    assert correlation(modes[0], np.sin(2 * np.pi * T)) > 0.999
    assert max(correlation(m, np.sin(2 * np.pi * 0.13 * T)) for m in modes) > 0.99


def noisy_tone(n=20_000):
    t = np.arange(n) / 100.0
    tone = np.sin(np.pi * t)
    return tone, tone + 0.5 * np.random.default_rng(1).standard_normal(n) + 1e-3 * t


def test_the_default_stop_rule_keeps_a_tone_whole():
    tone, x = noisy_tone()
    best = max(correlation(m, tone) for m in decompose(x))
    loose = max(correlation(m, tone) for m in decompose(x, threshold=0.3))
    fixed = max(correlation(m, tone) for m in decompose(x, stop="fixed", siftings=10))
    assert best > 0.95
    assert best > loose
    assert best > fixed


def end_error(x, tone, ends):
    """Return the rms error of the mode nearest to a tone over its last period."""
    modes = decompose(x, ends=ends, stop="fixed", siftings=10)
    mode = max(modes, key=lambda m: correlation(m, tone))
    return float(np.sqrt(np.mean((mode - tone)[-100:] ** 2)))


def test_prediction_improves_the_end():
    """Over many phases of a slowly growing tone on a drift, against mirror and line."""
    errors = {ends: [] for ends in ("mirror", "predict", "linear")}
    for seed in range(40):
        rng = np.random.default_rng(seed)
        phase, tilt = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 1.5)
        tone = (1 + 0.02 * T) * np.sin(2 * np.pi * 0.97 * T + phase)
        x = tone + tilt * T + 0.3 * np.sin(2 * np.pi * 0.11 * T)
        for ends, found in errors.items():
            found.append(end_error(x, tone, ends))
    medians = {ends: np.median(found) for ends, found in errors.items()}
    assert medians["predict"] < 0.8 * medians["mirror"]
    assert medians["predict"] < medians["linear"]


def test_split_is_after_the_least_energetic_mode():
    modes = np.array([np.full(4, v) for v in (3.0, 1.0, 0.5, 2.0, 7.0)])
    assert split_index(modes) == 3
    two = np.array([np.full(4, v) for v in (3.0, 1.0, 2.0, 0.5, 7.0)])
    assert split_index(two) == 2
    assert split_index(two, first=False) == 4
    assert split_index(modes[-1:]) == 0


def test_ceemdan_adds_up_and_mixes_less():
    """A tone that comes and goes over a slow one: the ensemble keeps the slow one cleaner."""
    slow = np.sin(2 * np.pi * 0.2 * T)
    burst = np.where((T % 5) < 1.0, 0.3 * np.sin(2 * np.pi * 6 * T), 0.0)
    x = slow + burst
    found = ceemdan(x, np.random.default_rng(2), realisations=40)
    np.testing.assert_allclose(found.sum(axis=0), x, atol=1e-9)
    plain = decompose(x, ends="mirror", stop="fixed", siftings=10)
    assert max(correlation(m, slow) for m in found) > 0.95
    assert max(correlation(m, burst) for m in found) > max(correlation(m, burst) for m in plain)


def test_filter_takes_vibration_away():
    rng = np.random.default_rng(3)
    n, dt = 6000, 0.01
    t = dt * np.arange(1, n + 1)
    shake = 0.5 * np.sin(2 * np.pi * 12 * t) + 0.1 * rng.standard_normal(n)
    accel = np.column_stack([0.02 * np.sin(2 * np.pi * 0.01 * t), 0 * t, 9.8 + 0 * t])
    rough = accel + shake[:, None]
    record = ImuRecord(t, np.full(n, dt), np.zeros((n, 3)), rough * dt)
    smooth = Emd(channels="accel")(record).accel
    assert np.sqrt(np.mean((smooth - accel) ** 2)) < 0.15 * np.sqrt(np.mean((rough - accel) ** 2))
    cleaned = Emd(channels="accel", clean=6)(record).accel
    assert np.sqrt(np.mean((cleaned - accel) ** 2)) < 0.15 * np.sqrt(np.mean((rough - accel) ** 2))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: decompose(np.zeros(3)), "8 samples"),
        (lambda: decompose([1.0, 2.0, np.nan] * 5), "not a number, at sample 2"),
        (lambda: decompose(T, ends="sideways"), "ends must be"),
        (lambda: decompose(T, stop="soon"), "stop must be"),
        (lambda: decompose(T, threshold=0.0), "must be positive"),
        (lambda: ceemdan(T, np.random.default_rng(1), realisations=0), "must be positive"),
    ],
)
def test_errors(call, words):
    with pytest.raises(InputError, match=words):
        call()
