"""The next position: half a turn on a table, and never worse than doing nothing."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.alignment import Position, position_limit, suggest_position
from schuler.alignment.next_position import Fixture
from schuler.earth import Site
from schuler.errors import InputError
from schuler.sensors import GRADES

FOG, SITE = GRADES["navigation-fog"], Site(40.0)


def test_on_a_table_half_a_turn_is_best():
    found = suggest_position(FOG, SITE, [Position(30.0)], Fixture())
    assert found.position.heading_ccw_deg % 360 == pytest.approx(210.0, abs=2.0)
    assert found.limit.sigma_arcmin[2] == pytest.approx(2.192, abs=0.002)


@pytest.mark.parametrize("yaw", [(0.0, 60.0), (-45.0, 30.0), (90.0, 90.0)])
def test_a_fixture_s_range_is_kept(yaw):
    found = suggest_position(FOG, SITE, [Position(30.0)], Fixture(yaw))
    turned = found.position.heading_ccw_deg - 30.0
    assert yaw[0] <= turned <= yaw[1]
    alone = position_limit(FOG, SITE, [Position(30.0)]).sigma_arcmin[2]
    assert found.limit.sigma_arcmin[2] <= alone
    edges = [position_limit(FOG, SITE, [Position(30.0), Position(30.0 + y)]).sigma_arcmin[2]
             for y in np.linspace(*yaw, 7)]  # fmt: skip
    assert found.limit.sigma_arcmin[2] <= min(edges) * (1 + 1e-6)


def test_tilting_helps():
    flat = suggest_position(FOG, SITE, [Position()], Fixture((0.0, 30.0)))
    tilted = suggest_position(FOG, SITE, [Position()], Fixture((0.0, 30.0), tilt_deg=60.0))
    assert tilted.limit.sigma_arcmin[2] < flat.limit.sigma_arcmin[2]


def test_a_turn_that_is_tracked_costs_level():
    known = position_limit(FOG, SITE, [Position(30.0), Position(210.0)]).sigma_arcmin
    tracked = position_limit(FOG, SITE, [Position(30.0), Position(210.0, turn=20.0)]).sigma_arcmin
    assert tracked[0] > 2 * known[0]
    assert tracked[2] == pytest.approx(known[2], rel=1e-3)


@pytest.mark.parametrize(
    ("make", "text"),
    [(lambda: Fixture((10.0, 0.0)), "low:high"), (lambda: Fixture(tilt_deg=-1.0), "tilt"),
     (lambda: suggest_position(FOG, SITE, [], Fixture()), "one that is done"),
     (lambda: Position(turn=-1.0), "turn")],
)  # fmt: skip
def test_bad_input(make, text):
    with pytest.raises(InputError, match=text):
        make()
