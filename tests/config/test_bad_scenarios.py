"""Malformed scenarios: one sentence with the file, the line, the key and what was expected."""

from __future__ import annotations

import pytest

from schuler.config import load_scenario
from schuler.errors import InputError

GOOD = """duration = "60 s"
rate = "20 Hz"
seed = 4

[site]
lat = 40.0
height = 50

[instrument.gyro]
bias = "0.01 deg/h"

[instrument.accelerometer]
bias = "50 ug"

[motion]
kind = "vehicle"
heading = 30
shake_mm = [4, 4, 2]
shake_band = [0.2, 5.0]

[[motion.with]]
kind = "static"

[align]
method = "centred"
"""

#: what is replaced by what; the line; words of the sentence
CASES = {
    "no unit": ('"60 s"', "60", 1, ["duration", "'300 s'", "60"]),
    "other unit": ('"20 Hz"', '"20 deg"', 2, ["rate", "of angle", "frequency"]),
    "unknown unit": ('"20 Hz"', '"20 hz"', 2, ["rate", "unknown unit 'hz'"]),
    "no number": ('"60 s"', '"a minute"', 1, ["duration", "a number and a unit of time"]),
    "negative time": ('"60 s"', '"-60 s"', 1, ["duration", "more than 0"]),
    "seed with a point": ("seed = 4", "seed = 4.5", 3, ["seed", "whole number", "4.5"]),
    "negative seed": ("seed = 4", "seed = -4", 3, ["seed", "at least 0"]),
    "latitude": ("lat = 40.0", "lat = 140.0", 6, ["site.lat", "at most 90", "140"]),
    "latitude as text": ("lat = 40.0", 'lat = "north"', 6, ["site.lat", "number and a unit"]),
    "no latitude": ("lat = 40.0\n", "", 5, ["site.lat", "is missing"]),
    "no site": ("[site]\nlat = 40.0\nheight = 50\n", "", 1, ["site", "is missing"]),
    "slip of the pen": ("height = 50", "hight = 50", 7, ["site.hight", "did you mean 'height'"]),
    "unknown key": ("height = 50", "zzz = 50", 7, ["site.zzz", "known: lat, lon, height"]),
    "unknown kind": ('"vehicle"', '"lorry"', 16, ["motion.kind", "'vehicle'", "'lorry'"]),
    "no kind": ('kind = "vehicle"\n', "", 15, ["motion.kind", "is missing", "'vehicle'"]),
    "two numbers": ("[4, 4, 2]", "[4, 4]", 18, ["motion.shake_mm", "three numbers"]),
    "text among numbers": ("[4, 4, 2]", '[4, "a", 2]', 18, ["motion.shake_mm.1", "a number"]),
    "negative rms": ("[4, 4, 2]", "[4, -4, 2]", 18, ["motion.shake_mm.1", "at least 0"]),
    "band upside down": ("[0.2, 5.0]", "[5.0, 0.2]", 19, ["motion.shake_band", "low <= high"]),
    "nested kind": ('kind = "static"', 'kind = "statics"', 22, ["motion.with.0.kind", "'static'"]),
    "nested key": ('kind = "static"', 'kind = "static"\nyaw = 3', 23, ["motion.with.0.yaw"]),
    "bias with a wrong unit": ('"0.01 deg/h"', '"0.01 m"', 10, ["instrument.gyro.bias", "length"]),
    "instrument's key": ('bias = "50 ug"', 'bais = "50 ug"', 13,
                         ["instrument.accelerometer.bais", "unknown key"]),
    "instrument in a table": ('[instrument.gyro]\nbias = "0.01 deg/h"\n\n'
                              '[instrument.accelerometer]\nbias = "50 ug"\n',
                              'instrument = "gold"\n', 9, ["unknown key"]),
    "method": ('"centred"', '"centered"', 25, ["align.method", "unknown method", "wahba"]),
    "not TOML": ("seed = 4", "seed = ", 3, ["not valid TOML"]),
    "twice": ("seed = 4", "seed = 4\nseed = 5", 4, ["not valid TOML"]),
    "a date": ("seed = 4", "seed = 2020-01-01", 3, ["seed", "date"]),
    "table for a number": ("seed = 4", "seed = {a = 1}", 3, ["seed", "whole number", "a table"]),
    "number for a table": ("[[motion.with]]\nkind = \"static\"", "with = 3", 21,
                           ["motion.with", "an array", "3"]),
    "crew and shake": ("heading = 30", "crew = {}", 15, ["motion", "either crew or shake"]),
    "mount of nothing": ("heading = 30", "mount = [0, 0, 1]", 15, ["motion", "no on_board"]),
    "too many samples": ('"60 s"', '"60000 h"', 1, ["samples"]),
    "frames": ('kind = "static"', 'kind = "centrifuge"\nradius = 1\nrate = "1 deg/s"', 15,
               ["motion", "as many frames"]),
    "on board travels": ("[align]", "[motion.on_board]\nkind = \"vehicle\"\n[align]", 24,
                         ["motion.on_board", "may turn but not travel"]),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_malformed_scenario(name, tmp_path):
    old, new, line, words = CASES[name]
    assert old in GOOD
    path = tmp_path / "scene.toml"
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        load_scenario(path)
    text = str(caught.value)
    assert f"scene.toml, line {line}: " in text, text
    assert "\n" not in text
    for word in words:
        assert word in text, text


def test_the_good_one_is_good(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(GOOD)
    assert load_scenario(path).samples == 1200


def test_several_errors_are_counted_and_the_first_is_said(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(GOOD.replace("lat = 40.0", "lat = 140").replace("seed", "sead")
                    .replace("heading = 30", "heading = true"))  # fmt: skip
    with pytest.raises(InputError, match=r"line 3: sead: unknown key.*'seed'.* \(and 2 more\)$"):
        load_scenario(path)


def test_what_was_set_outside_is_blamed_outside(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(GOOD)
    with pytest.raises(InputError, match=r"as set from outside: motion\.headin: unknown key; did"):
        load_scenario(path, {"motion.headin": 3})
    with pytest.raises(InputError, match=r"motion\.with\.3\.roll: expected a number from 0 to 0"):
        load_scenario(path, {"motion.with.3.roll": 3})
    with pytest.raises(InputError, match=r"instrument: expected a grade \(.*got 'gold'"):
        load_scenario(path, {"instrument": "gold"})
    with pytest.raises(InputError, match=r"seed\.x: cannot be set, because seed is 4"):
        load_scenario(path, {"seed.x": 3})


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load_scenario(tmp_path / "none.toml")
    with pytest.raises(InputError, match="cannot be read"):
        load_scenario(tmp_path)
    path = tmp_path / "latin.toml"
    path.write_bytes('name = "é"'.encode("latin-1"))
    with pytest.raises(InputError, match="UTF-8"):
        load_scenario(path)
    path.write_text(
        GOOD.replace("[instrument.gyro]", "[instrument.gyro]\n")
        .replace("seed = 4", 'seed = 4\nalign = {spec = "gone.toml"}')
        .replace("[align]\nmethod", "#")
    )
    with pytest.raises(InputError, match=r"gone\.toml: cannot be read"):
        load_scenario(path)
