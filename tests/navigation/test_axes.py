"""Misalignments as states of an aided navigation: sigma holds them, and they are found."""

from __future__ import annotations

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from scipy.stats import chi2

from schuler.navigation import AidingOptions, navigate_aided
from schuler.navigation.aided_setup import sensor_groups
from schuler.sensors import GRADES
from tests.alignment.moving.routes import car, fixes, truth_of
from tests.navigation.aided_table import MISALIGNED, misaligned_drive
from tests.test_docs import schema

RUNS = 16


def test_nees_of_a_misaligned_mems_is_in_its_band():
    perfect = truth_of(car(), 150.0)
    plain = AidingOptions(vibration=1e-6)
    found = [misaligned_drive(perfect, seed, plain, 149.0, smooth=False)[0] for seed in range(RUNS)]
    # A good filter is outside once in a thousand draws of so many runs.
    low, high = chi2.ppf([5e-4, 1.0 - 5e-4], 9 * RUNS) / (9 * RUNS)
    assert low < np.mean(found) < high
    # Without the states the errors are several sigma.
    blind = misaligned_drive(perfect, 0, replace(plain, axes=False), 149.0, smooth=False)[0]
    assert blind > 2.0


def test_misalignments_are_found_and_told():
    perfect = truth_of(car(), 150.0)
    dtheta = perfect.record.dtheta.copy()
    true = np.radians(0.3)
    dtheta[:, 0] += true * perfect.record.dtheta[:, 2]  # x reads some of the turns about z
    gnss = fixes(perfect, sigma=0.02, v_sigma=0.005, rng=np.random.default_rng(1), first=1.0)
    gyro = replace(MISALIGNED.gyro, misalignment=5e-3)
    result = navigate_aided(
        replace(perfect.record, dtheta=dtheta), gnss, spec=replace(MISALIGNED, gyro=gyro),
        options=AidingOptions(vibration=1e-4),
    )  # fmt: skip
    value, sigma = (np.array(each) for each in result.estimated["gyro_axes_deg"])
    # x by z is the second of x by y, x by z, y by x ...
    assert abs(value[1] - 0.3) < 3.0 * sigma[1]
    assert sigma[1] < 0.5 * np.degrees(5e-3)
    assert value[1] > 0.1
    assert len(result.estimated["accel_axes_deg"][0]) == 6
    whole = schema("navigation").schema
    part = {**whole["properties"]["estimated"], "$defs": whole["$defs"]}
    estimated = json.loads(json.dumps(result.to_dict()["estimated"]))
    jsonschema.Draft202012Validator(part).validate(estimated)
    assert {"gyro_axes_deg", "accel_axes_deg", "gyro_scale"} <= set(estimated)


@pytest.mark.parametrize(
    ("options", "spec", "groups"),
    [
        (AidingOptions(), None, []),
        (AidingOptions(), GRADES["industrial-mems"], []),
        (AidingOptions(), MISALIGNED, ["gyro_matrix", "accelerometer_matrix"]),
        (AidingOptions(axes=False, scale=True), MISALIGNED, ["gyro_scale", "accelerometer_scale"]),
        (AidingOptions(axes=True), None, ["gyro_matrix", "accelerometer_matrix"]),
    ],
)
def test_the_specification_decides_unless_told(options, spec, groups):
    assert sensor_groups(options, spec) == groups
