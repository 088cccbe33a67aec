"""Positions of a table recognised from the record: known schemes, repeats, turns, and refusals."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from schuler.calibration import calibrate_positions, scheme
from schuler.calibration.table_recognition import recognise
from schuler.errors import InputError
from schuler.motion.turntable import AXES, Dwell, Turn, Turntable
from schuler.simulation import simulate
from tests.calibration import test_table_test as table

SITE = table.SITE
HEADING = 320.0


def tilts_of(up):
    """Return theta and gamma, deg, of an attitude in which a body direction is up."""
    theta = np.rad2deg(np.arcsin(np.clip(up[1], -1.0, 1.0)))
    return round(theta), round(np.rad2deg(np.arctan2(-up[0], up[2])))


def attitudes_of(count, headings=(0.0,)):
    """Return psi, theta, gamma (deg) of a scheme, its headings relative to the first in turn."""
    start = -HEADING
    if count == 24:
        return [(start + 90.0 * k, *map(float, tilts_of(up))) for up in scheme(6) for k in range(4)]
    return [
        (start + headings[k % len(headings)], *map(float, tilts_of(up)))
        for k, up in enumerate(scheme(count))
    ]


def measured(attitudes, seed=1, seconds=8.0, spec=table.SPEC):
    """Return the record of a table with the instrument's errors."""
    steps = [Dwell(seconds)]
    for before, after in itertools.pairwise(attitudes):
        steps += [
            Turn(axis, b - a, 60.0, 120.0)
            for axis, a, b in zip(AXES, before, after, strict=True) if a != b
        ]  # fmt: skip
        steps.append(Dwell(seconds))
    motion = Turntable(tuple(steps), attitudes[0])
    rng = np.random.default_rng(seed)
    duration = float(np.floor(motion.period))
    return table.off(simulate(motion, SITE, duration, 50.0, spec, rng).record)


@pytest.mark.parametrize(
    ("count", "headings", "said"),
    [
        (6, (0.0, 90.0, 45.0), "6 positions; turns recognised"),
        (12, (0.0,), "12 positions; turns recognised"),
        (18, (0.0, -105.0), "18 positions; turns recognised"),
        (24, (), "24 positions; turns recognised"),
    ],
)
def test_known_schemes_are_recognised(count, headings, said):
    attitudes = attitudes_of(count, headings)
    record = measured(attitudes)
    found = recognise([record])
    relative = np.array(attitudes) - [attitudes[0][0], 0.0, 0.0]
    assert len(found.dwells) == count
    np.testing.assert_allclose(
        [table.Position(tuple(a)).mat_nb for a in found.attitude_deg],
        [table.Position(tuple(a)).mat_nb for a in relative], atol=1e-12,
    )  # fmt: skip
    test = calibrate_positions([record], SITE.gravity, positions=None, site=SITE)
    assert test.recognised.startswith(said)
    assert test.found == ("accel_bias", "accel_matrix", "gyro_bias")
    table.check_accelerometers(test)
    # As the same with a sequence that says all.
    given = [table.Position(a) for a in attitudes]
    told = calibrate_positions([record], SITE.gravity, positions=given, site=SITE)
    np.testing.assert_allclose(
        test.calibration.accel_matrix, told.calibration.accel_matrix, atol=1e-14
    )
    away = test.calibration.gyro_bias - told.calibration.gyro_bias
    assert np.abs(away / test.calibration.sigma["gyro_bias"]).max() < 3.0
    heading = float(test.recognised.rpartition("dwell's heading ")[2].split()[0])
    assert heading == pytest.approx(HEADING, abs=3.0)


def test_bias_and_heading_are_as_sure_as_they_say():
    """Squared error over variance of the gyros' bias, 16 records: within 1e-3 of chi-square."""
    spec = table.sc.ImuSpec.from_dict({
        "gyro": {"angle_random_walk": "0.05 deg/sqrt(h)"},
        "accelerometer": {"velocity_random_walk": "20 ug/sqrt(Hz)"},
    })  # fmt: skip
    # The scale is known, so that it leaves nothing of the Earth's rate in the bias.
    base = table.Calibration(gyro_matrix=np.linalg.inv(table.GYRO))
    total = 0.0
    for seed in range(16):
        record = measured(attitudes_of(12, (0.0, 90.0)), seed, 5.0, spec)
        test = calibrate_positions([record], SITE.gravity, positions=None, site=SITE, base=base)
        c = test.calibration
        total += float(np.sum(((c.gyro_bias - table.GYRO_BIAS) / c.sigma["gyro_bias"]) ** 2))
    # Chi-square of 48 at 5e-4 and 1 - 5e-4, widened by a variance that is itself estimated.
    assert 22.0 < total < 95.0


def test_repeats_and_other_sets_are_named():
    attitudes = attitudes_of(6)
    again = recognise([measured([*attitudes, attitudes[0]])])
    assert again.text.startswith("6 positions, some of them again (7 dwells)")
    mixed = [*attitudes, *attitudes_of(12)[:4]]
    assert recognise([measured(mixed)]).text.startswith(
        "10 dwells in 10 of the 18 known directions"
    )


def test_a_heading_between_the_steps_leaves_the_accelerometers():
    attitudes = attitudes_of(6)
    attitudes[3] = (attitudes[3][0] + 37.0, *attitudes[3][1:])
    test = calibrate_positions([measured(attitudes)], SITE.gravity, positions=None, site=SITE)
    assert test.found == ("accel_bias", "accel_matrix")
    assert "between dwells 3 and 4 the heading turns to 37." in test.recognised
    table.check_accelerometers(test)


def test_files_of_one_dwell_each_have_no_turns():
    record = measured(attitudes_of(12))
    parts = recognise([record]).dwells
    test = calibrate_positions(parts[::-1], SITE.gravity, positions=None, site=SITE)
    assert test.found == ("accel_bias", "accel_matrix")
    assert test.recognised == "12 positions; files of one dwell each show no turns"
    table.check_accelerometers(test)


def test_what_cannot_be_recognised_is_one_sentence():
    attitudes = attitudes_of(6)
    record = measured(attitudes)
    with pytest.raises(InputError, match="the gyros turn up to"):
        recognise([replace(record, dtheta=-record.dtheta)])
    with pytest.raises(InputError, match=r"dwell 1 \(.* s\): its force is 2\d deg from any known"):
        recognise([measured([(0.0, 22.0, 10.0), *attitudes[1:]])])
    with pytest.raises(InputError, match="axis y is not observable"):
        calibrate_positions(
            [measured([attitudes[4], *attitudes[:2], attitudes[4], attitudes[0]])], SITE.gravity,
            positions=None,
        )  # fmt: skip
