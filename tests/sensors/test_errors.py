"""Instrument specifications: grades, TOML with units, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import tomli_w

from schuler.errors import InputError
from schuler.sensors import GRADES, AccelerometerSpec, GyroSpec, ImuSpec, load_spec

DEG = math.pi / 180.0
UG = 9.80665e-6

TABLE = {
    "name": "bench unit",
    "source": "its data sheet",
    "gyro": {
        "bias": "0.01 deg/h",
        "angle_random_walk": "0.003 deg/sqrt(h)",
        "quantisation": "0.5 arcsec",
        "bias_instability": "0.005 deg/h",
        "rate_random_walk": "0.001 deg/h/sqrt(h)",
    },
    "accelerometer": {
        "bias": "50 ug",
        "velocity_random_walk": "20 ug/sqrt(Hz)",
        "quantisation": "0.2 mm/s",
        "bias_instability": "10 ug",
        "acceleration_random_walk": "5 ug/sqrt(h)",
    },
}


def check_bench_unit(spec):
    """Compare each field with a number worked out by hand."""
    gyro, accelerometer = spec.gyro, spec.accelerometer
    assert gyro.bias == pytest.approx(0.01 * DEG / 3600, rel=1e-12, abs=0)
    assert gyro.angle_random_walk == gyro.white == pytest.approx(0.003 * DEG / 60, rel=1e-12, abs=0)
    assert gyro.quantisation == pytest.approx(0.5 * DEG / 3600, rel=1e-12, abs=0)
    assert gyro.bias_instability == pytest.approx(0.005 * DEG / 3600, rel=1e-12, abs=0)
    assert (
        gyro.rate_random_walk
        == gyro.drift
        == pytest.approx(0.001 * DEG / 3600 / 60, rel=1e-12, abs=0)
    )
    assert accelerometer.bias == pytest.approx(50 * UG, rel=1e-12, abs=0)
    assert (
        accelerometer.velocity_random_walk
        == accelerometer.white
        == pytest.approx(20 * UG, rel=1e-12, abs=0)
    )
    assert accelerometer.quantisation == pytest.approx(2e-4, rel=1e-12, abs=0)
    assert accelerometer.bias_instability == pytest.approx(10 * UG, rel=1e-12, abs=0)
    assert accelerometer.acceleration_random_walk == accelerometer.drift
    assert accelerometer.drift == pytest.approx(5 * UG / 60, rel=1e-12, abs=0)
    assert (spec.name, spec.source) == ("bench unit", "its data sheet")


def test_from_dict():
    check_bench_unit(ImuSpec.from_dict(TABLE))


def test_from_toml_and_by_path(tmp_path):
    path = tmp_path / "unit.toml"
    path.write_text(tomli_w.dumps(TABLE), encoding="utf-8")
    check_bench_unit(ImuSpec.from_toml(path))
    check_bench_unit(load_spec(path))
    check_bench_unit(load_spec(str(path)))


def test_a_nameless_file_is_called_after_itself(tmp_path):
    path = tmp_path / "rooftop.toml"
    path.write_text('[gyro]\nbias = "1 deg/h"\n[accelerometer]\n', encoding="utf-8")
    spec = ImuSpec.from_toml(path)
    assert spec.name == "rooftop"
    assert spec.gyro.bias == pytest.approx(DEG / 3600, rel=1e-12, abs=0)
    assert spec.gyro == GyroSpec(bias=spec.gyro.bias)
    assert spec.accelerometer == AccelerometerSpec()


def test_describe_is_the_way_back():
    spec = ImuSpec.from_dict(TABLE)
    said = spec.describe()
    assert said["gyro"]["bias"] == "0.01 deg/h"
    assert said["accelerometer"]["velocity_random_walk"] == "20 ug/sqrt(Hz)"
    assert said == {k: TABLE[k] for k in ("gyro", "accelerometer")}
    check_bench_unit(ImuSpec.from_dict({**said, "name": spec.name, "source": spec.source}))


def test_describe_leaves_out_what_is_zero():
    assert ImuSpec(GyroSpec(), AccelerometerSpec()).describe() == {"gyro": {}, "accelerometer": {}}


@pytest.mark.parametrize("name", sorted(GRADES))
def test_grades_have_figures_and_a_source(name):
    spec = load_spec(name)
    assert spec is GRADES[name]
    assert spec.name == name
    assert len(spec.source) > 20
    assert spec.gyro.bias > 0
    assert spec.gyro.white > 0
    assert spec.accelerometer.bias > 0
    assert spec.accelerometer.white > 0


@pytest.mark.parametrize("name", ["navigation-rlg", "tactical-fog"])
def test_figures_are_those_of_the_product_sheet(name):
    spec = GRADES[name]
    said = spec.describe()
    figures = [said["gyro"]["bias"], said["gyro"]["angle_random_walk"]]
    assert all(text in spec.source for text in [*figures, said["accelerometer"]["bias"]])


def test_grades_by_hand():
    fog = GRADES["navigation-fog"]
    assert fog.gyro.bias == pytest.approx(0.01 * DEG / 3600, rel=1e-12, abs=0)
    assert fog.accelerometer.bias == pytest.approx(50 * UG, rel=1e-12, abs=0)
    tactical = GRADES["tactical-fog"]
    assert tactical.gyro.bias == pytest.approx(DEG / 3600, rel=1e-12, abs=0)
    mems = GRADES["industrial-mems"]
    assert mems.gyro.bias == pytest.approx(0.2 * DEG, rel=1e-12, abs=0)
    # 0.029 m/s/sqrt(h) is about 49 ug/sqrt(Hz).
    assert mems.accelerometer.white == pytest.approx(49.3 * UG, rel=1e-3, abs=0)
    assert fog.gyro.bias < tactical.gyro.bias < mems.gyro.bias


def test_load_spec_passes_through():
    assert load_spec(None) is None
    spec = ImuSpec.from_dict(TABLE)
    assert load_spec(spec) is spec


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"colour": "red"}, "instrument specification: unknown key 'colour'; known: name, source"),
        ({"gyro": None}, "instrument specification: the section [gyro] is missing"),
        ({"accelerometer": 3}, "instrument specification: the section [accelerometer] is missing"),
        (
            {"gyro": {"drift": "1 deg/h"}},
            "instrument specification: unknown key 'gyro.drift'; known: bias, angle_random_walk",
        ),
        ({"gyro": {"bias": "1 ug"}}, "gyro.bias: '1 ug' is of acceleration, expected angular rate"),
        ({"gyro": {"bias": 0.01}}, "gyro.bias: expected a text like '0.01 deg/h', got 0.01"),
        ({"accelerometer": {"bias": "50"}}, "accelerometer.bias: '50' has no unit; say one of"),
        (
            {"gyro": {"bias": "-1 deg/h"}},
            "instrument specification: gyro.bias = '-1 deg/h' is negative; give a 1-sigma",
        ),
    ],
)
def test_refusals(change, sentence):
    with pytest.raises(InputError) as error:
        ImuSpec.from_dict({**TABLE, **change})
    assert str(error.value).startswith(sentence)


def test_files_that_cannot_be_used(tmp_path):
    with pytest.raises(InputError, match=r"gone\.toml: cannot be read \(No such file"):
        load_spec(tmp_path / "gone.toml")
    bad = tmp_path / "bad.toml"
    bad.write_text("gyro = [", encoding="utf-8")
    with pytest.raises(InputError, match=r"bad\.toml: is not valid TOML"):
        load_spec(bad)
    bad.write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match=r"bad\.toml: is not valid TOML"):
        load_spec(bad)
    bad.write_text('[gyro]\nbias = "1 m"\n[accelerometer]\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"bad\.toml: gyro\.bias: '1 m' is of length"):
        load_spec(Path(bad))


def test_neither_grade_nor_file():
    with pytest.raises(InputError) as error:
        load_spec("navigation")
    assert str(error.value).startswith("'navigation' is neither a grade (navigation-rlg, ")
