"""The closed table of units, each against Pint."""

from __future__ import annotations

import math

import pint
import pytest

from schuler.errors import InputError, SchulerError
from schuler.units import UNITS, convert, dimension_of, parse, parse_factor, to_unit

#: our unit -> the same in Pint's own words; written out, so that nothing is derived from the table
PINT = {
    "s": "second",
    "ms": "millisecond",
    "us": "microsecond",
    "ns": "nanosecond",
    "min": "minute",
    "h": "hour",
    "Hz": "1 / second",
    "kHz": "1000 / second",
    "m": "meter",
    "mm": "millimeter",
    "km": "kilometer",
    "rad": "radian",
    "mrad": "milliradian",
    "urad": "microradian",
    "deg": "degree",
    "arcmin": "arcminute",
    "arcsec": "arcsecond",
    "rad/s": "radian / second",
    "mdeg/s": "millidegree / second",
    "mrad/s": "milliradian / second",
    "deg/s": "degree / second",
    "deg/h": "degree / hour",
    "rad/h": "radian / hour",
    "arcsec/s": "arcsecond / second",
    "rad/sqrt(s)": "radian / second ** 0.5",
    "rad/s/sqrt(Hz)": "radian / second / (1 / second) ** 0.5",
    "deg/sqrt(s)": "degree / second ** 0.5",
    "deg/sqrt(h)": "degree / hour ** 0.5",
    "deg/s/sqrt(Hz)": "degree / second / (1 / second) ** 0.5",
    "deg/h/sqrt(Hz)": "degree / hour / (1 / second) ** 0.5",
    "rad/s/sqrt(s)": "radian / second / second ** 0.5",
    "deg/h/h": "degree / hour / hour",
    "deg/h/sqrt(h)": "degree / hour / hour ** 0.5",
    "deg/s/sqrt(h)": "degree / second / hour ** 0.5",
    "m/s": "meter / second",
    "mm/s": "millimeter / second",
    "m/s^2": "meter / second ** 2",
    "mm/s^2": "millimeter / second ** 2",
    "g": "standard_gravity",
    "mg": "0.001 * standard_gravity",
    "ug": "1e-6 * standard_gravity",
    "mGal": "0.001 * centimeter / second ** 2",
    "g*s": "standard_gravity * second",
    "mg*s": "0.001 * standard_gravity * second",
    "ug*s": "1e-6 * standard_gravity * second",
    "m/s/sqrt(s)": "meter / second / second ** 0.5",
    "m/s^2/sqrt(Hz)": "meter / second ** 2 / (1 / second) ** 0.5",
    "m/s/sqrt(h)": "meter / second / hour ** 0.5",
    "g/sqrt(Hz)": "standard_gravity / (1 / second) ** 0.5",
    "mg/sqrt(Hz)": "0.001 * standard_gravity / (1 / second) ** 0.5",
    "ug/sqrt(Hz)": "1e-6 * standard_gravity / (1 / second) ** 0.5",
    "m/s^2/sqrt(s)": "meter / second ** 2 / second ** 0.5",
    "ug/sqrt(s)": "1e-6 * standard_gravity / second ** 0.5",
    "ug/h": "1e-6 * standard_gravity / hour",
    "ug/sqrt(h)": "1e-6 * standard_gravity / hour ** 0.5",
    "m/s^2/sqrt(h)": "meter / second ** 2 / hour ** 0.5",
    "K": "kelvin",
    "K/s": "kelvin / second",
    "K/min": "kelvin / minute",
    "K/h": "kelvin / hour",
    "deg/h/K": "degree / hour / kelvin",
    "deg/s/K": "degree / second / kelvin",
    "m/s^2/K": "meter / second ** 2 / kelvin",
    "ug/K": "1e-6 * standard_gravity / kelvin",
    "mg/K": "0.001 * standard_gravity / kelvin",
    "deg/h/g": "degree / hour / standard_gravity",
    "deg/s/g": "degree / second / standard_gravity",
    "deg/h/g^2": "degree / hour / standard_gravity ** 2",
    "deg/s/g^2": "degree / second / standard_gravity ** 2",
    "ug/g^2": "1e-6 / standard_gravity",
    "mg/g^2": "0.001 / standard_gravity",
    "ppm": "1e-6 * dimensionless",
    "%": "0.01 * dimensionless",
    "1": "dimensionless",
}

#: our dimension -> the SI unit that a factor leads to
SI = {
    "time": "second",
    "frequency": "1 / second",
    "length": "meter",
    "angle": "radian",
    "angular rate": "radian / second",
    "angular acceleration": "radian / second ** 2",
    "angle random walk": "radian / second ** 0.5",
    "rate random walk": "radian / second ** 1.5",
    "velocity": "meter / second",
    "acceleration": "meter / second ** 2",
    "velocity random walk": "meter / second ** 1.5",
    "acceleration ramp": "meter / second ** 3",
    "acceleration random walk": "meter / second ** 2.5",
    "temperature": "kelvin",
    "temperature rate": "kelvin / second",
    "angular rate per temperature": "radian / second / kelvin",
    "acceleration per temperature": "meter / second ** 2 / kelvin",
    "angular rate per acceleration": "radian / second / (meter / second ** 2)",
    "angular rate per acceleration squared": "radian / second / (meter / second ** 2) ** 2",
    "acceleration per acceleration squared": "1 / (meter / second ** 2)",
    "ratio": "dimensionless",
}


@pytest.fixture(scope="module")
def registry():
    return pint.UnitRegistry()


def test_every_unit_has_its_pint_expression():
    assert set(PINT) == set(UNITS)


@pytest.mark.parametrize("unit", sorted(PINT))
def test_factor_and_dimension_agree_with_pint(registry, unit):
    factor, dimension = UNITS[unit]
    expected = registry.Quantity(1.0) * registry.parse_expression(PINT[unit])
    # `to` raises where the dimensions do not meet.
    assert factor == pytest.approx(expected.to(SI[dimension]).magnitude, rel=1e-14, abs=0)


@pytest.mark.parametrize(
    ("spelling", "unit"),
    [
        ("°/s", "deg/s"),
        ("°/h", "deg/h"),
        ("°/hr", "deg/h"),
        ("deg/hr", "deg/h"),
        ("deg/hour", "deg/h"),
        ("deg / h", "deg/h"),
        ("deg/sec", "deg/s"),
        ("dps", "deg/s"),
        ("dph", "deg/h"),
        ("°/√h", "deg/sqrt(h)"),
        ("°/√hr", "deg/sqrt(h)"),
        ("deg/rthr", "deg/sqrt(h)"),
        ("deg/sqrt(hr)", "deg/sqrt(h)"),
        ("deg/s/rtHz", "deg/s/sqrt(Hz)"),
        ("dps/√Hz", "deg/s/sqrt(Hz)"),
        ("dps/sqrt(Hz)", "deg/s/sqrt(Hz)"),
        ("(deg/h)/sqrt(Hz)", "deg/h/sqrt(Hz)"),
        ("(m/s)/sqrt(h)", "m/s/sqrt(h)"),
        ("m/s/√h", "m/s/sqrt(h)"),
        ("m/s/√hr", "m/s/sqrt(h)"),
        ("µg", "ug"),
        ("μg", "ug"),
        ("µg/√Hz", "ug/sqrt(Hz)"),
        ("ug/rtHz", "ug/sqrt(Hz)"),
        ("mg/√Hz", "mg/sqrt(Hz)"),
        ("µs", "us"),
        ("sec", "s"),
        ("hr", "h"),
        ("m/s2", "m/s^2"),
        ("m/s²", "m/s^2"),
        ("m/s**2", "m/s^2"),
        ("m/s/s", "m/s^2"),
        ("mm/s/s", "mm/s^2"),
        ("m/s²/√Hz", "m/s^2/sqrt(Hz)"),
        ("m/s2/√Hz", "m/s^2/sqrt(Hz)"),
        ("m/s2/sqrt(Hz)", "m/s^2/sqrt(Hz)"),
        ("m/s/s/√Hz", "m/s^2/sqrt(Hz)"),
        ("m/s/s/√s", "m/s^2/sqrt(s)"),
        ("g·s", "g*s"),
    ],
)
def test_spellings(spelling, unit):
    assert parse(f"3 {spelling}", UNITS[unit][1]) == parse(f"3 {unit}", UNITS[unit][1])
    assert dimension_of(spelling) == UNITS[unit][1]


@pytest.mark.parametrize("unit", sorted(UNITS))
def test_to_unit_is_the_way_back(unit):
    assert to_unit(parse(f"-12.5 {unit}", UNITS[unit][1]), unit) == pytest.approx(
        -12.5, rel=1e-15, abs=0
    )


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0.01 deg/h", 0.01 * math.pi / 180 / 3600),
        ("0.01deg/h", 0.01 * math.pi / 180 / 3600),
        ("  1e-2 deg/h  ", 0.01 * math.pi / 180 / 3600),
        ("+.5 deg/h", 0.5 * math.pi / 180 / 3600),
        ("-5. deg/h", -5 * math.pi / 180 / 3600),
        ("1E+1 deg/h", 10 * math.pi / 180 / 3600),
    ],
)
def test_ways_to_write_a_number(text, value):
    assert parse(text, "angular rate") == pytest.approx(value, rel=1e-15, abs=0)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("0.01", "bias: '0.01' has no unit; say one of rad/s, mrad/s, deg/s"),
        ("deg/h", "bias: expected a number and a unit of angular rate, got 'deg/h'"),
        ("", "bias: expected a number and a unit of angular rate, got ''"),
        ("0.01 furlong", "bias: unknown unit 'furlong'; known units: rad/s, mrad/s, deg/s"),
        ("1 through", "bias: unknown unit 'through'"),
        ("0.01 ug", "bias: '0.01 ug' is of acceleration, expected angular rate (rad/s"),
        ("1e999 deg/h", "bias: '1e999 deg/h' is not a finite number"),
        ("nan deg/h", "bias: expected a number and a unit"),
        ("1,5 deg/h", "bias: unknown unit ',5 deg/h'"),
        (0.01, "bias: expected a text like '0.01 deg/h', got 0.01"),
    ],
)
def test_error_sentences(text, sentence):
    with pytest.raises(InputError) as error:
        parse(text, "angular rate", "bias")
    assert str(error.value).startswith(sentence)


def test_input_error_is_a_schuler_error_and_a_value_error():
    assert issubclass(InputError, SchulerError)
    assert issubclass(InputError, ValueError)


def test_unknown_unit_lists_every_known_one():
    with pytest.raises(InputError) as error:
        dimension_of("parsec")
    assert all(unit in str(error.value) for unit in UNITS)


def test_parse_factor_with_and_without_number():
    assert parse_factor("deg/s", ("angular rate",), "gyro") == (math.pi / 180, "angular rate")
    factor, dimension = parse_factor("-0.05 deg/s", ("angle", "angular rate"), "gyro")
    assert (factor, dimension) == (pytest.approx(-0.05 * math.pi / 180), "angular rate")
    assert parse_factor("1", ("ratio",), "scale") == (1.0, "ratio")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("m", "gyro: 'm' is of length, expected angle (rad, mrad"),
        ("0 deg/s", "gyro: the scale '0 deg/s' must be a finite number other than zero"),
        ("1e999 deg/s", "gyro: the scale '1e999 deg/s' must be a finite number"),
        ("bogus", "gyro: unknown unit 'bogus'"),
    ],
)
def test_parse_factor_error_sentences(text, sentence):
    with pytest.raises(InputError) as error:
        parse_factor(text, ("angle", "angular rate"), "gyro")
    assert str(error.value).startswith(sentence)


def test_convert():
    assert convert(1.0, "deg/s", "deg/h") == pytest.approx(3600.0, rel=1e-15, abs=0)
    assert convert(1.0, "mGal", "ug") == pytest.approx(1e-5 / 9.80665e-6, rel=1e-15, abs=0)
    assert convert(60.0, "deg/h/sqrt(Hz)", "deg/sqrt(h)") == pytest.approx(1.0, rel=1e-14, abs=0)
    with pytest.raises(InputError, match=r"cannot convert angle \('deg'\) to length \('m'\)"):
        convert(1.0, "deg", "m")
