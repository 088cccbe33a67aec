"""The bound of an alignment on a path: known figures, and what it depends on."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from schuler.alignment import limit, limit_on, planned_fixes, record_on
from schuler.errors import InputError
from schuler.navigation import navigate
from schuler.navigation.start import Start
from schuler.sensors import GRADES
from tests.alignment.moving.routes import ROUTES, SITE, body_speed, fixes, truth_of
from tests.in_motion.test_coarse import simulated


@cache
def heading(name, grade, length):
    made = truth_of(ROUTES[name](), float(length))
    return limit_on(made.truth, GRADES[grade], fixes(made), record=made.record).sigma_arcmin[2]


# Independent filter, other code, the same routes and grades: figures of two digits.
@pytest.mark.parametrize(
    ("name", "grade", "length", "known"),
    [
        ("car", "navigation-fog", 60, 5.6), ("car", "navigation-fog", 120, 4.0),
        ("car", "tactical-fog", 120, 4.5), ("accel", "tactical-fog", 120, 13.0),
        ("straight", "navigation-fog", 120, 94.0), ("plane", "navigation-fog", 120, 1.1),
        ("ship", "tactical-fog", 120, 100.0),
    ],
)  # fmt: skip
def test_it_has_the_figures_of_an_independent_filter(name, grade, length, known):
    # Slopes of the car's route and the plane's are read otherwise there.
    assert heading(name, grade, length) == pytest.approx(known, rel=0.09)


def test_a_path_without_samples_has_the_same_bound():
    made = simulated("car")
    with_record = limit_on(made.truth, "tactical-fog", fixes(made), record=made.record)
    alone = limit_on(made.truth, "tactical-fog", planned_fixes(made.truth))
    np.testing.assert_allclose(alone.covariance, with_record.covariance, rtol=2e-3, atol=1e-12)
    assert alone.duration == pytest.approx(60.0)
    np.testing.assert_allclose(alone.gyro_bias, with_record.gyro_bias, rtol=1e-3)


def test_samples_of_a_path_lead_back_along_it():
    made = simulated("ship")
    truth = made.truth
    start = Start(SITE, truth.quat_nb[0], truth.v_n[0])
    path = navigate(record_on(truth), start)
    np.testing.assert_allclose(path.v_n[-1], truth.v_n[-1], atol=2e-3)
    assert np.linalg.norm(path.known("quat_nb")[-1] - truth.quat_nb[-1]) < 1e-5


def test_what_is_measured_beside_lowers_it_and_what_is_not_known_raises_it():
    made = simulated("car")
    gnss = fixes(made)

    def of(*aids, **options):
        return limit_on(made.truth, "tactical-fog", aids, record=made.record, **options).phi[2, 2]

    plain = of(gnss)
    assert of(gnss, body_speed(made)) < plain
    assert of(replace(gnss, v_n=None)) > 4.0 * plain
    assert of(replace(gnss, estimate=("delay", "lever"))) > 1.02 * plain
    assert of(gnss, vibration=0.03) > plain


def test_what_is_estimated_of_an_aid_has_a_bound():
    made = simulated("car")
    found = limit_on(
        made.truth, "tactical-fog", replace(fixes(made), estimate=("delay",)), record=made.record
    )
    assert set(found.parameters) == {"gnss.delay", "gnss_velocity.delay"}
    assert 0.0 < found.parameters["gnss_velocity.delay"][0] < 0.1


def test_body_velocity_at_rest_has_the_bound_of_rest():
    """A DVL that reads nothing for 300 s knows what a method at rest knows."""
    from schuler.motion import Static

    made = truth_of(Static(40.0), 300.0, 20.0)
    speed = body_speed(made, sigma=1e-3)
    spec = GRADES["navigation-fog"]
    found = limit_on(made.truth, spec, speed, record=made.record).phi
    known = limit(spec, SITE, 300.0, 0.05)
    # White noise of 1 mm/s a second is what a method at rest does not have.
    assert 1.0 <= found[2, 2] / known[2, 2] < 1.2


def test_bad_input_is_named():
    made = simulated("car")
    gnss = fixes(made)
    with pytest.raises(InputError, match="no measurement lies on the path"):
        limit_on(made.truth, "tactical-fog", replace(gnss, time=np.asarray(gnss.time) + 1e4))
    with pytest.raises(InputError, match="has no velocity"):
        limit_on(replace(made.truth, v_n=None), "tactical-fog", gnss)
    with pytest.raises(InputError, match="three rows"):
        record_on(made.truth.rows(slice(0, 2)))
