"""Schemes as data: limits, TOML, locks, and the carrier's attitude taken back."""

from __future__ import annotations

import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from schuler.alignment import align
from schuler.attitude import multiply, quat_to_euler, quat_to_rotvec
from schuler.constants import DEG, DEG_PER_HOUR
from schuler.earth import Site
from schuler.errors import InputError
from schuler.motion import (
    SCHEMES,
    Dwell,
    Limits,
    Manoeuvre,
    Route,
    Scheme,
    Spin,
    Static,
    Turn,
    carrier_attitude,
    load_scheme,
    named_scheme,
)
from schuler.simulation import simulate


@pytest.mark.parametrize("name", list(SCHEMES))
def test_schemes_survive_their_file(name, tmp_path):
    scheme = named_scheme(name)
    file = tmp_path / "s.toml"
    file.write_text(tomli_w.dumps(scheme.to_dict()), encoding="utf-8")
    again = load_scheme(file)
    assert again == scheme
    t = np.linspace(0.0, 2.3 * scheme.period, 50)
    assert np.array_equal(again.angles(t), scheme.angles(t))


@pytest.mark.parametrize("name", [n for n in SCHEMES if n not in ("fixed", "continuous")])
def test_schemes_close_and_keep_their_travel(name):
    """Each comes back, so that slip rings are not needed; 360 deg of travel are enough."""
    scheme = named_scheme(name, limits=Limits(travel=360.0))
    assert all(net == 0.0 for _, _, net in scheme.travel().values())
    np.testing.assert_allclose(scheme.angles([0.0, scheme.period]), 0.0, atol=1e-12)


def test_what_a_table_cannot_do_is_said():
    with pytest.raises(InputError, match="more than the table's 5 deg/s"):
        Scheme("fast", (Turn("psi", 90.0, 10.0), Turn("psi", -90.0, 5.0)), Limits(5.0))
    with pytest.raises(InputError, match=r"deg/s\^2"):
        Scheme("hard", (Turn("psi", 90.0, 10.0, 30.0),), Limits(10.0, 20.0))
    with pytest.raises(InputError, match="slip ring"):
        named_scheme("continuous", limits=Limits(travel=720.0))
    with pytest.raises(InputError, match="180 deg from its start"):
        named_scheme("reciprocating", limits=Limits(travel=170.0))
    with pytest.raises(InputError, match="no step"):
        Scheme("none", (Dwell(0.0),))
    with pytest.raises(InputError, match="say one of"):
        Scheme.from_dict({"step": [{"dwell": 1, "turn": "psi"}]})
    with pytest.raises(InputError, match="angle is missing"):
        Scheme.from_dict({"step": [{"turn": "psi"}]})
    with pytest.raises(InputError, match="unknown key 'angel'"):
        Scheme.from_dict({"step": [{"turn": "psi", "angel": 90}]})
    with pytest.raises(InputError, match="neither a scheme"):
        load_scheme("waltz")


def test_a_spin_turns_evenly():
    scheme = Scheme("spin", (Spin("gamma", 3.0, 10.0),))
    t = np.array([0.0, 7.0, 10.0, 25.0])
    np.testing.assert_allclose(scheme.angles(t)[:, 2], 3.0 * DEG * t, atol=1e-12)
    track = scheme.turntable().track(t)
    np.testing.assert_allclose(track.angles[:, 0, 2, 1], 3.0 * DEG)


@given(
    st.lists(st.floats(-3.1, 3.1), min_size=3, max_size=3),
    st.lists(st.floats(-3.1, 3.1), min_size=3, max_size=3),
)
def test_the_carrier_s_attitude_is_taken_back(carrier, table):
    from schuler.attitude import euler_to_quat

    q = euler_to_quat(carrier)
    found = carrier_attitude(multiply(q, euler_to_quat(table)), table)
    np.testing.assert_allclose(
        quat_to_rotvec(multiply(found, q * [1.0, -1.0, -1.0, -1.0])), 0.0, atol=1e-12
    )


def test_an_encoder_rounds():
    limits = Limits(encoder=0.01)
    np.testing.assert_allclose(limits.read(np.array([0.1234, -0.1234]) * DEG) / DEG, [0.12, -0.12])
    assert Limits().read(0.1) == 0.1


def test_locks_on_a_turning_carrier():
    """Locked to north the IMU's heading is the scheme's; locked to the carrier both add."""
    carrier = Route([Manoeuvre(20, speed=10), Manoeuvre(40, turn=90)], heading=30.0)
    scheme = named_scheme("reciprocating", limits=Limits(6.0))
    t = np.linspace(0.0, 60.0, 61)
    mine = carrier.track(t).angles[:, 0, 0, 0]
    table = scheme.angles(t)[:, 0]
    north = quat_to_euler(scheme.on(carrier, "north").track(t).quat_nb)[:, 0]
    both = quat_to_euler(scheme.on(carrier, "carrier").track(t).quat_nb)[:, 0]
    wrap = lambda x: np.remainder(x + np.pi, 2 * np.pi) - np.pi  # noqa: E731
    np.testing.assert_allclose(wrap(north - table), 0.0, atol=1e-12)
    np.testing.assert_allclose(wrap(both - table - mine), 0.0, atol=1e-12)
    with pytest.raises(InputError, match="to the carrier or to north"):
        scheme.on(carrier, "moon")


def test_alignment_while_rotating_loses_the_level_bias():
    """0.01 deg/h to the east is 3.0' of heading at 40 deg; whole turns leave a thirtieth of it."""
    site = Site(40.0)
    bias = np.array([0.01 * DEG_PER_HOUR, 0.0, 0.0])
    scheme = named_scheme("reciprocating", limits=Limits(6.0))
    found = []
    for motion, table in (
        (Static(), None),
        (scheme.on(Static()), scheme),
    ):
        made = simulate(motion, site, 2.0 * scheme.period, 20.0, gyro_bias=bias)
        fix = align(made.record, site, "centred")
        q = fix.quat_nb
        if table is not None:
            q = carrier_attitude(q, table.angles([made.record.end])[0])
        found.append(abs(quat_to_euler(q)[0]) / DEG * 60.0)
    assert found[0] == pytest.approx(0.01 / (15.041 * np.cos(40 * DEG)) / DEG * 60.0, rel=0.01)
    assert found[1] < found[0] / 30.0
