"""Figures that differ from axis to axis: read, written, drawn, and in the filters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from schuler.allan_variance import allan, fit_noise
from schuler.allan_variance.output import save_spec
from schuler.config.override import spec_table
from schuler.constants import DEG_PER_HOUR
from schuler.earth import Site
from schuler.errors import InputError
from schuler.ins import Layout, ProcessNoise, instrument_noise, instrument_prior
from schuler.motion import Static
from schuler.sensors import ImuSpec
from schuler.sensors.draw import draw
from schuler.sensors.noise import NoiseTrain
from schuler.simulation import simulate

TABLE = {
    "gyro": {
        "bias": "1, 2, 2 deg/h",
        "angle_random_walk": ["0.1 deg/sqrt(h)", "0.2 deg/sqrt(h)", "12 deg/h/sqrt(Hz)"],
        "bias_instability": "3, 0, 4 deg/h",
    },
    "accelerometer": {"bias": "50 ug", "acceleration_random_walk": "10, 20, 30 ug/sqrt(h)"},
}


@pytest.fixture
def spec() -> ImuSpec:
    return ImuSpec.from_dict(TABLE)


def test_a_figure_is_its_rms_and_its_ratios(spec: ImuSpec) -> None:
    assert spec.gyro.bias == pytest.approx(np.sqrt(3.0) * DEG_PER_HOUR, rel=1e-12)
    np.testing.assert_allclose(spec.gyro.by_axis("bias") / DEG_PER_HOUR, [1.0, 2.0, 2.0])
    walk = spec.gyro.by_axis("angle_random_walk") / (DEG_PER_HOUR * 60.0)
    np.testing.assert_allclose(walk, [0.1, 0.2, 0.2])
    assert spec.accelerometer.by_axis("bias") == spec.accelerometer.bias
    # What scales the figure scales each axis.
    doubled = replace(spec.gyro, bias=2.0 * spec.gyro.bias)
    np.testing.assert_allclose(doubled.by_axis("bias"), 2.0 * spec.gyro.by_axis("bias"))
    assert hash(spec) == hash(ImuSpec.from_dict(TABLE))


def test_what_is_written_reads_back(spec: ImuSpec) -> None:
    assert spec.describe()["gyro"]["bias"] == "1, 2, 2 deg/h"
    assert spec.describe()["accelerometer"]["bias"] == "50 ug"
    back = ImuSpec.from_dict({k: v for k, v in spec_table(spec).items() if k != "source"})
    for part, other in ((spec.gyro, back.gyro), (spec.accelerometer, back.accelerometer)):
        for name in ("bias", "bias_instability", part.WHITE, part.DRIFT):
            np.testing.assert_allclose(part.by_axis(name), other.by_axis(name), rtol=1e-12)
    equal = ImuSpec.from_dict({"gyro": {"bias": "2, 2, 2 deg/h"}, "accelerometer": {}})
    assert equal.gyro.ratios == ()


@pytest.mark.parametrize(
    ("value", "sentence"),
    [
        ("1, -2, 2 deg/h", "is negative"), ("1, x, 2 deg/h", "gyro.bias"),
        ("1, 2, 2", "has no unit"), (["1 deg/h", "2 deg/h"], "expected one value, or three"),
        ("1 deg/h, 2 m/s^2, 3 deg/h", "expected angular rate"),
    ],
)  # fmt: skip
def test_refusals(value: object, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        ImuSpec.from_dict({"gyro": {"bias": value}, "accelerometer": {}})


def test_figures_of_the_triad_have_one_value() -> None:
    with pytest.raises(InputError, match="misalignment has one value"):
        ImuSpec.from_dict({"gyro": {"misalignment": "1, 2, 3 arcsec"}, "accelerometer": {}})


def test_noise_and_bias_are_drawn_by_axis(spec: ImuSpec) -> None:
    """Spread of 4,000 biases, and of the sums of many seconds of noise."""
    rng = np.random.default_rng(5)
    biases = np.array([draw(spec.gyro, rng).bias for _ in range(4000)])
    # A standard deviation of so many is known to 1.1 %; five of these.
    np.testing.assert_allclose(biases.std(axis=0) / DEG_PER_HOUR, [1.0, 2.0, 2.0], rtol=0.056)
    quiet = replace(spec.gyro, bias_instability=0.0)
    out = np.empty((20_000, 3))
    NoiseTrain(quiet, 0.01, 3, rng, 200.0).make(out)
    wanted = np.array([0.1, 0.2, 0.2]) * 60.0 * DEG_PER_HOUR * 0.1
    np.testing.assert_allclose(out.std(axis=0), wanted, rtol=0.025)
    flicker = replace(quiet, angle_random_walk=0.0, bias_instability=spec.gyro.bias_instability)
    NoiseTrain(flicker, 0.01, 3, rng, 200.0).make(out)
    spread = np.abs(out).max(axis=0)
    assert spread[1] == 0.0
    assert min(spread[0], spread[2]) > 0.0
    with pytest.raises(InputError, match="there are 4 sensors"):
        NoiseTrain(spec.gyro, 0.01, 4, rng, 200.0)


def test_one_value_for_all_axes_draws_what_it_drew() -> None:
    """Ratios of one are the plain path, bit for bit."""
    one = ImuSpec.from_dict({"gyro": {"angle_random_walk": "0.1 deg/sqrt(h)"}, "accelerometer": {}})
    same = ImuSpec.from_dict(
        {"gyro": {"angle_random_walk": "0.1, 0.1, 0.1 deg/sqrt(h)"}, "accelerometer": {}}
    )
    first, second = (
        simulate(Static(0.0), Site(40.0), 5.0, 100.0, s, np.random.default_rng(1)).record
        for s in (one, same)
    )
    assert np.array_equal(first.dtheta, second.dtheta)


def test_the_filter_has_prior_and_walk_of_each_axis(spec: ImuSpec) -> None:
    layout = Layout(["phi", "velocity", "gyro_bias", "accelerometer_bias"])
    prior = instrument_prior(layout, spec)
    np.testing.assert_allclose(prior["gyro_bias"], spec.gyro.by_axis("bias"))
    noise = ProcessNoise.of(layout, instrument_noise(layout, spec))
    walk = noise.walk[layout["accelerometer_bias"]]
    np.testing.assert_allclose(walk / walk[0], [1.0, 4.0, 9.0])
    # Axes of the navigation frame turn against those of the instrument: the rms.
    np.testing.assert_allclose(noise.walk[layout["phi"]], spec.gyro.angle_random_walk**2)


def test_an_allan_fit_is_saved_by_axis(spec: ImuSpec, tmp_path) -> None:
    truth = ImuSpec.from_dict(
        {
            "gyro": {"angle_random_walk": "0.1, 0.2, 0.4 deg/sqrt(h)"},
            "accelerometer": {"velocity_random_walk": "60, 60, 120 ug/sqrt(Hz)"},
        }
    )
    rng = np.random.default_rng(3)
    record = simulate(Static(0.0), Site(40.0), 900.0, 20.0, truth, rng).record
    fit = fit_noise(allan(record))
    save_spec(fit, tmp_path / "unit.toml", by_axis=True)
    back = ImuSpec.from_toml(tmp_path / "unit.toml")
    for part in ("gyro", "accelerometer"):
        found, wanted = getattr(back, part), getattr(truth, part)
        each = found.by_axis(found.WHITE) / wanted.by_axis(wanted.WHITE)
        np.testing.assert_allclose(each, 1.0, atol=0.05)
    assert back.gyro.angle_random_walk == pytest.approx(fit.to_spec().gyro.white, rel=1e-3)
    assert fit.to_spec().gyro.ratios == ()
    gyros = replace(fit, channels={c: f for c, f in fit.channels.items() if c != "gyro_z"})
    with pytest.raises(InputError, match="needs three channels"):
        gyros.to_spec(by_axis=True)
