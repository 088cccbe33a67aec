"""Scenario files: the examples run, overrides win, and what is made depends on the seed alone."""

from __future__ import annotations

import json
import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schuler.config import load_scenario, parse_overrides, parse_scenario, parse_sweep
from schuler.config.load import with_overrides
from schuler.config.locate import line_of, locate
from schuler.config.override import spec_table
from schuler.errors import InputError
from schuler.motion import DisturbedVehicle, Static
from schuler.sensors import GRADES, ImuSpec
from schuler.simulation import simulate
from tests.conftest import ROOT

EXAMPLES = sorted((ROOT / "examples" / "scenarios").glob("*.toml"))

PLACE = "[site]\nlat = 40.0\n"
HEAD = f'duration = "5 s"\nrate = "20 Hz"\nseed = 4\ninstrument = "navigation-fog"\n{PLACE}'

MOTIONS = {
    "static": 'kind = "static"\nheading = "30 deg"',
    "sway": 'kind = "sway"\nbands = [{channel = "roll", rms = 0.1, low = 0.2, high = 2}]\n'
    'lines = [{channel = "up", frequency = 3, amplitude = 0.001, phase = 20}]\nlever = [0, 1, 0]',
    "vehicle": 'kind = "vehicle"\nheading = 12\nshake_mm = 3\nsway_deg = [0.1, 0.2, 0.3]\n'
    "shake_band = [0.3, 4]\nsteps = 2",
    "crew": 'kind = "vehicle"\ncrew = {idle_g = 0.01, slams_per_minute = 3}\nlever = [0, 0, 1]',
    "turntable": 'kind = "turntable"\nsteps = [{dwell = "1 s"}, {turn = "psi", angle = 90, '
    'rate = "60 deg/s", acceleration_deg_s2 = 100}]\nrepeat = true\nstart = [0, "1 deg", 0]',
    "four-position": 'kind = "rotation"\nscheme = "four-position"\ndwell = "1 s"\naxis = "gamma"',
    "two-axis-16": 'kind = "rotation"\nscheme = "two-axis-16"\ndwell = "0.5 s"\nrate = "90 deg/s"',
    "continuous": 'kind = "rotation"\nscheme = "continuous"\nrate = "20 deg/s"\nturns = 2',
    "ship": 'kind = "ship"\nheading = 200\nsea = {height = "1.5 m", period = "6 s"}\nwaves = 12\n'
    'hull = {roll_period = "9 s"}',
    "route": 'kind = "route"\nspeed = 10\nmanoeuvres = [{time = "3 s", turn = 20, speed = 2}]',
    "centrifuge": 'kind = "centrifuge"\nradius = 1.5\nrate = "100 deg/s"\nspin_up = "2 s"',
    "carried": 'kind = "ship"\nsea = {height = 1, period = "6 s"}\nmount = [0, -5, 3]\n'
    '[motion.on_board]\nkind = "rotation"\nscheme = "four-position"\ndwell = "1 s"',
    "sum": 'kind = "route"\nspeed = 10\n[[motion.with]]\nkind = "sway"\n'
    'bands = [{channel = "roll", rms = 0.1, low = 0.2, high = 2}]\n'
    '[[motion.with]]\nkind = "static"\nroll = 1',
}  # fmt: skip


def scenario(tmp_path, text, overrides=None):
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return load_scenario(path, overrides)


def same(a, b):
    return all(
        np.array_equal(getattr(a.record, x), getattr(b.record, x)) for x in ("dtheta", "dvel")
    )


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example_loads_and_runs_shortened(path):
    scene = load_scenario(path, {"duration": "2 s"})
    made = scene.run()
    assert len(made.record) == scene.samples == round(2.0 * scene.rate)
    assert np.isfinite(made.record.dvel).all()


def test_there_are_six_examples():
    assert len(EXAMPLES) == 6


@pytest.mark.parametrize("kind", MOTIONS)
def test_every_kind_of_motion_runs_and_survives_json(kind, tmp_path):
    scene = scenario(tmp_path, f"{HEAD}[motion]\n{MOTIONS[kind]}\n")
    made = scene.run()
    assert len(made.record) == 100
    again = parse_scenario(json.loads(scene.to_json()))
    assert again.digest == scene.digest
    assert same(again.run(), made)
    assert not same(scene.run(5), made)


def test_values_arrive_where_they_belong(tmp_path):
    scene = scenario(tmp_path, f"{HEAD}[motion]\n{MOTIONS['static']}\n")
    motion, site = scene.build()
    assert isinstance(motion, Static)
    assert motion.heading == pytest.approx(30.0, rel=1e-15)
    assert (motion.pitch, motion.roll) == (0.0, 0.0)
    assert (site.lat, scene.duration, scene.rate, scene.seed) == (40.0, 5.0, 20.0, 4)
    assert scene.spec is GRADES["navigation-fog"]
    assert scene.align_spec is scene.spec


def test_a_vehicle_is_what_the_motion_room_draws(tmp_path):
    scene = scenario(tmp_path, f"{HEAD}[motion]\n{MOTIONS['vehicle']}\n")
    seed = np.random.SeedSequence(4, spawn_key=(2**31,))
    rng = np.random.Generator(np.random.SFC64(seed))
    drawn = DisturbedVehicle.draw(
        rng, 5.0, heading=12.0, shake_mm=(3.0, 3.0, 3.0), sway_deg=(0.1, 0.2, 0.3),
        shake_band=(0.3, 4.0), steps=2,
    )  # fmt: skip
    theirs = simulate(drawn, scene.site, 5.0, 20.0)
    ours = simulate(scene.build()[0], scene.site, 5.0, 20.0)
    assert same(ours, theirs)


def test_another_instrument_rides_through_the_same_motion(tmp_path):
    text = f"{HEAD}[motion]\n{MOTIONS['vehicle']}\n"
    fog = scenario(tmp_path, text).run()
    rlg = scenario(tmp_path, text, {"instrument": "navigation-rlg"}).run()
    assert np.array_equal(fog.truth.quat_nb, rlg.truth.quat_nb)
    # The same numbers are drawn: errors differ by the ratio of the biases alone.
    assert fog.gyro_bias / rlg.gyro_bias == pytest.approx(np.full(3, 0.01 / 0.003))


def test_running_twice_gives_the_same_bits_and_runs_differ(tmp_path):
    scene = scenario(tmp_path, f"{HEAD}[motion]\n{MOTIONS['crew']}\n")
    seed = scene.sequence(3)
    assert same(scene.run(seed), scene.run(seed))
    assert not same(scene.run(scene.sequence(2)), scene.run(seed))
    spawned = np.random.SeedSequence(4).spawn(4)[3]
    assert same(scene.run(spawned), scene.run(seed))


def test_fixed_biases_are_not_drawn(tmp_path):
    text = (
        f'{HEAD}[motion]\nkind = "static"\n[biases]\n'
        'gyro = ["0.01 deg/h", "0 deg/h", "-1 deg/h"]\naccelerometer = ["1 mg", "0 g", "0 g"]\n'
    )
    made = scenario(tmp_path, text).run()
    assert made.gyro_bias == pytest.approx(np.radians([0.01, 0.0, -1.0]) / 3600.0, rel=1e-14)
    assert made.accel_bias == pytest.approx([9.80665e-3, 0.0, 0.0])


def test_an_instrument_s_file_lies_beside_the_scenario(tmp_path, monkeypatch):
    (tmp_path / "mine.toml").write_text(
        '[gyro]\nbias = "0.02 deg/h"\n[accelerometer]\nbias = "1 mg"\n'
    )
    text = HEAD.replace("navigation-fog", "mine.toml")
    scene = scenario(tmp_path, f'{text}[motion]\nkind = "static"\n')
    assert scene.spec == ImuSpec.from_toml(tmp_path / "mine.toml")
    (tmp_path / "mine.toml").unlink()
    # The scenario carries it along: no worker needs the file.
    assert parse_scenario(json.loads(scene.to_json())).spec == scene.spec


@pytest.mark.parametrize("grade", GRADES)
def test_a_grade_written_out_is_the_same_instrument(grade):
    back = ImuSpec.from_dict(spec_table(GRADES[grade]))
    for part in ("gyro", "accelerometer"):
        for name, value in vars(getattr(GRADES[grade], part)).items():
            assert getattr(getattr(back, part), name) == pytest.approx(value, rel=1e-14)


def test_overrides_win_and_make_what_was_not_there(tmp_path):
    text = f"{HEAD}[motion]\n{MOTIONS['sum']}\n"
    scene = scenario(
        tmp_path, text,
        {"site.height": 100, "motion.with.1.roll": 3, "instrument.gyro.bias": "7 deg/h",
         "align.method": ["wahba"]},
    )  # fmt: skip
    assert scene.site.height == 100.0
    assert scene.build()[0].parts[2].roll == 3.0
    assert scene.spec.gyro.bias == pytest.approx(np.radians(7.0) / 3600.0)
    assert scene.spec.gyro.angle_random_walk == GRADES["navigation-fog"].gyro.angle_random_walk
    assert scene.spec.name == "navigation-fog, changed"
    assert scene.methods == ("wahba",)
    assert with_overrides(scene, {"site.height": 5}).site.height == 5.0


def test_words_of_the_command_line():
    said = parse_overrides(["a.b=3", "c=60 s", "d=[1, 2]", 'e="x,y"', "f=true", "g=one=two"])
    assert said == {"a.b": 3, "c": "60 s", "d": [1, 2], "e": "x,y", "f": True, "g": "one=two"}
    swept = parse_sweep(["k=1,2.5", "m=[1,2],[3,4]", "t=10 s,20 s"])
    assert swept == {"k": (1, 2.5), "m": ([1, 2], [3, 4]), "t": ("10 s", "20 s")}


@pytest.mark.parametrize("text", ["heading", "=3", "a=", "a= "])
def test_a_word_that_is_no_pair_is_refused(text):
    with pytest.raises(InputError, match="expected key=value"):
        parse_overrides([text])


@pytest.mark.parametrize("text", ["a=1,,2", "a=1,", "a=1,1"])
def test_a_sweep_with_a_hole_or_twice_the_same_is_refused(text):
    with pytest.raises(InputError, match="a=1"):
        parse_sweep([text])


TOML = """# a comment with [brackets] and = signs
a = 1
"b c" = 'x = y'
d.e = \"\"\"two
lines "[no.table]" \\\"\"\" more\"\"\"
f = [
  1,
  # between
  { g = 2, "h" = [3, 4] },
]
[t]
u = { v = { w = 1 } }
[t.x] # after
y = 1979-05-27T07:32:00Z
[[m]]
n = 1
[[m]]
n = 2
[m.o]
p = 3
"""


def test_every_key_has_its_line():
    tomllib.loads(TOML)
    lines = locate(TOML)
    wanted = {
        ("a",): 2, ("b c",): 3, ("d",): 4, ("d", "e"): 4, ("f",): 6, ("f", 0): 7, ("f", 1): 9,
        ("f", 1, "g"): 9, ("f", 1, "h", 1): 9, ("t",): 11, ("t", "u", "v", "w"): 12,
        ("t", "x"): 13, ("t", "x", "y"): 14, ("m",): 15, ("m", 0, "n"): 16, ("m", 1): 17,
        ("m", 1, "n"): 18, ("m", 1, "o", "p"): 20,
    }  # fmt: skip
    assert {key: lines.get(key) for key in wanted} == wanted
    assert line_of(lines, ("t", "missing", "deeper")) == 11
    assert line_of(lines, ("nowhere",)) == 1


names = st.text("abc-_1", min_size=1, max_size=4)
leaves = st.one_of(
    st.integers(-99, 99), st.booleans(), st.text('ab"\'\\#[]{}=,.\n é', max_size=8),
    st.lists(st.integers(0, 9), max_size=3),
)  # fmt: skip
tables = st.recursive(
    st.dictionaries(names, leaves, max_size=4),
    lambda inner: st.dictionaries(
        names, st.one_of(leaves, inner, st.lists(inner, min_size=1, max_size=2)), max_size=4
    ),
    max_leaves=12,
)


@given(tables)
def test_the_locator_finds_each_key_that_the_parser_finds(data):
    import tomli_w

    text = tomli_w.dumps(data)
    found = locate(text)

    def keys(value, path):
        if isinstance(value, dict):
            for name, inner in value.items():
                yield (*path, name)
                yield from keys(inner, (*path, name))
        elif isinstance(value, list):
            for k, inner in enumerate(value):
                yield (*path, k)
                yield from keys(inner, (*path, k))

    wanted = set(keys(tomllib.loads(text), ()))
    assert wanted == set(found)
    rows = text.split("\n")
    for path in wanted:
        if isinstance(path[-1], str):
            assert path[-1] in rows[found[path] - 1]
