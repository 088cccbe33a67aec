"""The estimators: exact on truth, for any attitude and latitude, and steady under disturbance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from schuler.alignment import align
from schuler.alignment.stationary.inertial import solve, weights
from schuler.alignment.stationary.uncertainty import BLOCKS
from schuler.earth import Site
from schuler.errors import InputError
from schuler.kernels.states import TrackerNode
from schuler.motion import Static
from schuler.simulation import simulate
from tests.alignment.conftest import INERTIAL, SITE, WHITE, phi_of


@pytest.mark.parametrize("at", ["start", "end"])
@pytest.mark.parametrize("method", [*INERTIAL, "analytic", "analytic-earth-rate"])
def test_truth_is_found_exactly_at_rest(still, method, at):
    fix = align(still.record, SITE, method, at=at)
    assert np.abs(phi_of(fix, still.euler[-1])).max() < 1e-9
    assert fix.heading_deg == pytest.approx(30.0, abs=1e-7)
    assert fix.pitch_deg == pytest.approx(2.0, abs=1e-7)
    assert fix.roll_deg == pytest.approx(-3.0, abs=1e-7)


@settings(max_examples=20)
@given(
    st.floats(-85, 85), st.floats(0, 360), st.floats(-89, 89), st.floats(-179, 179),
)  # fmt: skip
def test_any_attitude_and_latitude(lat, heading, pitch, roll):
    site = Site(lat)
    made = simulate(Static(heading, pitch, roll), site, 60.0, 10.0)
    fix = align(made.record, site)
    # Digits are lost as the Earth's rotation loses its level part.
    assert np.abs(phi_of(fix, made.euler[-1])).max() < 3e-8 / np.cos(site.latitude)


@pytest.mark.parametrize(("subsamples", "bound"), [(1, 3e-6), (2, 3e-6), (3, 3e-6), (4, 1e-5)])
def test_angular_sway_drops_out(subsamples, bound):
    from schuler.alignment import Inertial
    from schuler.motion import DisturbedVehicle

    motion = DisturbedVehicle.draw(
        np.random.default_rng(1), 100.0, heading=77.0, sway_deg=(0.5, 2.0, 2.0),
        shake_mm=(0.0, 0.0, 0.0), steps=0,
    )  # fmt: skip
    made = simulate(motion, SITE, 100.0, 400.0)
    fix = align(made.record, SITE, Inertial(subsamples=subsamples))
    assert np.abs(phi_of(fix, made.euler[-1])).max() < bound
    # The analytic method takes the sway in full.
    assert np.abs(phi_of(align(made.record, SITE, "analytic"), made.euler[-1])).max() > 1e-3


def test_centring_beats_the_others_under_disturbance(truck):
    error = {
        m: abs(phi_of(align(truck.record, SITE, m), truck.euler[-1])[2])
        for m in (*INERTIAL, "analytic")
    }
    assert error["centred"] < 3e-3
    for method in ("wahba", "integral-triad", "instants-triad", "analytic"):
        assert error[method] > 3 * error["centred"], method


@pytest.mark.parametrize("method", INERTIAL)
def test_weights_are_the_derivative_of_the_estimator(still, method):
    """phi_0 predicted from velocity errors equals phi_0 found with these errors put in."""
    from dataclasses import replace

    from schuler.alignment import Aligner

    h = Aligner(SITE).update(still.record).history()
    g, lat = SITE.gravity, SITE.latitude
    clean = solve(h, g, lat, method)
    w, thin = weights(h, g, lat, method, BLOCKS)
    # An error of v that grows as a smooth random series, given in i0; its block sums follow.
    rng = np.random.default_rng(3)
    steps = 1e-5 * rng.standard_normal((len(thin), 3))
    grow = np.cumsum(steps, axis=0)
    every = np.column_stack([np.interp(h.t, thin.t, grow[:, k]) for k in range(3)])
    rows = h.rows.copy()
    rows[:, 6:9] += every @ clean
    n = np.diff(h.updates)[:, None]
    mean = 0.5 * (every[1:] + every[:-1]) @ clean
    rows[1:, 9:12] += np.cumsum(n * mean, axis=0)
    b = h.block_means(TrackerNode.sum_gravity)
    rows[1:, 15:24] += np.cumsum(n[:, :, None] * b[:, :, None] * mean[:, None, :], axis=0).reshape(
        -1, 9
    )
    shifted = solve(replace(h, rows=rows), g, lat, method) @ clean.T
    found = -0.5 * np.array(
        [
            shifted[2, 1] - shifted[1, 2],
            shifted[0, 2] - shifted[2, 0],
            shifted[1, 0] - shifted[0, 1],
        ]
    )
    predicted = np.einsum("iab,ib->a", w.nodal(), grow)
    assert found == pytest.approx(predicted, rel=0.02, abs=0.005 * np.abs(predicted).max())


@pytest.mark.parametrize("method", ["centred", "wahba", "integral-triad", "analytic"])
def test_too_few_samples(still, method):
    """A span in which no disturbance could show is refused: its sigma would be nothing."""
    for n in (1, 3, 9):
        with pytest.raises(InputError, match=f"only {n} sample.* too few to align"):
            align(still.record.rows(0, n), SITE, method)


def test_the_shortest_span_does_not_feign_certainty(rng):
    """White noise alone, 10 samples: the error is nowhere near five times the stated sigma."""
    made = simulate(Static(30.0, 1.0, -2.0), SITE, 0.5, 20.0, WHITE, rng)
    fix = align(made.record, SITE)
    assert abs((fix.heading_deg - 30.0 + 180.0) % 360.0 - 180.0) * 60 < 5 * fix.sigma_arcmin[2]
