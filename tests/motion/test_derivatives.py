"""Every motion's rates and accelerations are the derivatives of what it says of the position."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from schuler.motion import (
    Carried,
    DisturbedVehicle,
    Motion,
    Sea,
    Static,
    Sum,
    continuous_rotation,
    four_position,
    moored_ship,
    two_axis_16,
)

Array = NDArray[np.float64]
SPAN = 60.0


def rng() -> np.random.Generator:
    return np.random.default_rng(11)


MOTIONS: dict[str, Callable[[], Motion]] = {
    "static": lambda: Static(30.0, 1.0, -2.0),
    "vehicle": lambda: DisturbedVehicle.draw(rng(), SPAN, heading=200.0, pitch=1.0, roll=-1.0),
    "crew": lambda: DisturbedVehicle.with_crew(rng(), SPAN, heading=10.0),
    "ship": lambda: moored_ship(rng(), Sea(1.5, 7.0, 3.3), heading=45.0),
    "four positions": lambda: four_position(5.0),
    "two axes": lambda: two_axis_16(1.0),
    "rotation": lambda: continuous_rotation(12.0, turns=2),
    "sum": lambda: Sum((Static(90.0), DisturbedVehicle.draw(rng(), SPAN))),
    "table on a ship": lambda: Carried(
        moored_ship(rng(), Sea(1.5, 7.0)), four_position(5.0), (1.0, 2.0, 3.0)
    ),
}


def channels(motion: Motion, t: Array) -> Array:
    """Return all ways and angles with both derivatives, (n, channels, 3)."""
    track = motion.track(t)
    angles = track.angles.reshape(len(t), -1, 3)
    return np.concatenate([track.path, angles], axis=1)


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("order", [1, 2])
def test_derivatives(name: str, order: int) -> None:
    """Central differences of a step h are off by h^2/6 of the third derivative.

    Halving the step must quarter the error wherever it is above the rounding, so that a wrong
    formula, whose error stays, is seen at once. Turns and steps have kinks in their third
    derivative: the few instants around them may keep an error of order h.
    """
    motion = MOTIONS[name]()
    t = np.linspace(0.5, SPAN - 0.5, 4001)
    here = channels(motion, t)
    h = 1e-4
    off = (channels(motion, t + h) - channels(motion, t - h))[:, :, order - 1] / (2 * h)
    error = np.abs(off - here[:, :, order])
    scale = np.abs(here[:, :, order]).max(axis=0)
    rounding = 1e-15 * np.abs(here[:, :, order - 1]).max(axis=0) / h
    assert np.all(np.quantile(error, 0.99, axis=0) < 1e-4 * scale + 20 * rounding + 1e-12)
    assert np.all(error.max(axis=0) < 0.03 * scale + 20 * rounding + 1e-12)


@pytest.mark.parametrize("name", MOTIONS)
def test_any_times_may_be_asked(name: str) -> None:
    """What a motion says of an instant does not depend on which others are asked with it."""
    motion = MOTIONS[name]()
    t = np.linspace(0.0, SPAN, 301)
    whole = channels(motion, t)
    scale = np.abs(whole).max(axis=0)
    for part in (slice(0, 7), slice(150, 300), slice(300, 301)):
        assert np.all(np.abs(channels(motion, t[part]) - whole[part]) < 1e-9 * scale + 1e-15)


def test_a_vehicle_has_the_size_that_was_asked() -> None:
    """Rms over 600 s of each channel, 24 lines: within 10 %, which chance never makes so far."""
    motion = DisturbedVehicle.draw(
        rng(), 600.0, sway_deg=(0.1, 0.2, 0.3), shake_mm=(4.0, 3.0, 2.0), steps=0
    )
    track = motion.track(np.arange(0.0, 600.0, 0.05))
    angles = np.rad2deg(track.angles[:, 0, :, 0]).std(axis=0)
    np.testing.assert_allclose(angles, [0.1, 0.2, 0.3], rtol=0.1)
    np.testing.assert_allclose(1e3 * track.path[:, :, 0].std(axis=0), [4, 3, 2], rtol=0.1)


def test_motions_repeat_by_their_seed() -> None:
    t = np.linspace(0.0, SPAN, 200)
    for name in ("vehicle", "crew", "ship"):
        np.testing.assert_array_equal(channels(MOTIONS[name](), t), channels(MOTIONS[name](), t))
    other = DisturbedVehicle.draw(np.random.default_rng(12), SPAN, heading=200.0)
    assert not np.array_equal(channels(MOTIONS["vehicle"](), t), channels(other, t))
