"""The commands `calibrate` and `plan`, and `align --calibration`."""

from __future__ import annotations

import json

import numpy as np
import pytest

import schuler as sc
from schuler.calibration import Calibration
from tests.test_docs import schema


@pytest.fixture
def cli():
    from click.testing import CliRunner

    from schuler.cli import cli as group
    from schuler.errors import SchulerError

    def run(*words):
        result = CliRunner().invoke(group, [str(w) for w in words])
        if isinstance(result.exception, SchulerError):
            return 2, str(result.exception), result.stdout
        assert result.exception is None or isinstance(result.exception, SystemExit), result.output
        return result.exit_code, result.output, result.stdout

    return run


def test_plan_gives_its_json(cli, tmp_path):
    narrow = ("plan", "centrifuge", "--rounds", 1, "--seed", 1, "--alpha", "0,60", "--gamma",
              "0,90", "--json", "-")  # fmt: skip
    code, _, out = cli(*narrow)
    assert code == 0
    data = json.loads(out)
    schema("plan").validate(data)
    assert data["objective"] < data["published_objective"]
    assert data["objective_name"] == "min-max"
    assert all(row["best"] <= row["plan"] for row in data["objectives"])
    assert len(data["positions"]) == 6
    (tmp_path / "p.json").write_text(out, encoding="utf-8")
    code, _, out = cli(*narrow, "--resume", tmp_path / "p.json", "--compare", 0)
    again = json.loads(out)
    assert all(row["best"] is None for row in again["objectives"])
    assert again["rounds"] == 2
    assert again["objective"] <= data["objective"]


def test_a_time_in_all_is_shared_whatever_the_arm_s_rate(cli):
    code, out, _ = cli(
        "plan", "centrifuge", "--positions", "4-5", "--total", "40s", "--rounds", 1, "--rate", 240,
        "--alpha", "0,90", "--gamma", "0,90", "--compare", 0, "--json", "-",
    )  # fmt: skip
    assert code == 0
    # Whole turns of 1.5 s; the 20 s that --dwell would be are none.
    assert [plan["dwell_s"] for plan in json.loads(out)["plans"]] == [9.0, 7.5]


def test_plan_draws_the_trade(cli, tmp_path):
    pytest.importorskip("plotly")
    code, text, _ = cli(
        "plan", "centrifuge", "--positions", "4-5", "--total", "40s", "--rounds", 1, "--alpha",
        "0,90", "--gamma", "0,90", "--report", tmp_path / "p.html", "--json", tmp_path / "p.json",
    )  # fmt: skip
    assert code == 0
    assert "positions" in text
    assert "optimised: largest sigma / wanted" in text
    assert "best found" in text
    table = text.partition("by every objective, * the least:\n")[2].splitlines()[:7]
    assert table[0].split() == ["positions", "4", "5"]
    plans = json.loads((tmp_path / "p.json").read_text(encoding="utf-8"))["plans"]
    for line in table[1:]:
        assert line.count("*") == 1 or line.split()[-1] == line.split()[-2]
    least = [row["plan"] for plan in plans for row in plan["objectives"] if row["name"] == "a"]
    assert f"{min(least):.4g}*" in table[2]
    page = (tmp_path / "p.html").read_text(encoding="utf-8")
    assert "The trade" in page
    assert "By every objective, for each number of positions" in page
    for each in json.loads((tmp_path / "p.json").read_text(encoding="utf-8"))["plans"]:
        schema("plan").validate(each)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--positions", "x"], "expected a number, or two"),
        (["--alpha", "3"], "expected two numbers"),
        (["--dwell", "3s"], "whole number of turns"),
        (["--objective", "luck"], "unknown objective"),
        (["--resume", "nowhere.json"], "cannot be read"),
        (["--positions", "4-5", "--resume", "x"], "one number"),
        (["--json", "no/such/folder.json"], "no folder"),
    ],
)
def test_plan_s_bad_options_are_one_sentence(cli, words, text):
    code, said, _ = cli("plan", "centrifuge", *words)
    assert code == 2
    assert text in said


def test_plan_refuses_another_plan(cli, tmp_path):
    path = tmp_path / "p.json"
    for content in ("{}", "[1]", "nothing"):
        path.write_text(content, encoding="utf-8")
        code, said, _ = cli("plan", "centrifuge", "--resume", path)
        assert code == 2
        assert "is not a plan" in said
    path.write_text(json.dumps({"positions": [[0, 0, 0]], "rounds": 1, "objective_name": "a",
                                "dwell_s": 20.0}))  # fmt: skip
    assert "another number" in cli("plan", "centrifuge", "--resume", path)[1]


def test_centrifuge_prints_the_table_and_its_json(cli, tmp_path):
    pytest.importorskip("plotly")
    code, text, _ = cli("calibrate", "centrifuge", "--simulate", 1, "--dwell", "10s", "--json",
                        tmp_path / "c.json", "--report", tmp_path / "c.html")  # fmt: skip
    assert code == 0
    assert text.count("\n") == 48 + len(("wrote c.json", "wrote c.html"))
    data = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
    schema("calibrate-centrifuge").validate(data)
    for row in data["rows"]:
        assert abs(row["estimate"] - row["published_true"]) < 6 * row["sigma"]
    page = (tmp_path / "c.html").read_text(encoding="utf-8")
    assert "Weakest combinations" in page
    assert cli("calibrate", "centrifuge", "--positions", "a,b")[0] == 2


def test_a_simulated_centrifuge_test_is_identified_from_its_file(cli, tmp_path):
    test = tmp_path / "test.toml"
    test.write_text(
        'seed = 3\n[plant]\norder = "yzx"\nd_oo = true\ncommanded = [30, -20, 10]\n[scheme]\n'
        "dwell = 4\npositions = [[45,0,167],[350,0,325],[209,0,182],[134,0,141],[106,0,338],"
        "[142,0,269],[45,0,167],[350,0,325],[209,0,182],[134,0,141],[106,0,338],[142,0,269]]\n"
        "forces = [10,10,10,10,10,10,5,5,5,5,5,5]\n",
        encoding="utf-8",
    )
    code, text, out = cli("simulate", test, "--out", tmp_path / "o.csv", "--json", "-")
    assert code == 0, text
    schema("centrifuge-simulation").validate(json.loads(out))
    code, text, out = cli("calibrate", "centrifuge", tmp_path / "o.csv", "--json", "-")
    assert code == 0, text
    data = json.loads(out)
    schema("calibrate-centrifuge").validate(data)
    assert len(data["rows"]) == 48
    assert 0.4 < data["nees_per_coefficient"] < 1.8
    assert data["gimbal_order"] == "yzx"
    # Another plant than the one that was simulated does not fit.
    (tmp_path / "plain.toml").write_text('order = "zyx"\nd_oo = true\n', encoding="utf-8")
    code, text, _ = cli("calibrate", "centrifuge", tmp_path / "o.csv", "--plant",
                        tmp_path / "plain.toml")  # fmt: skip
    assert code == 3
    assert "the plant does not fit the outputs" in text
    (tmp_path / "plain.toml").write_text(
        'order = "yzx"\nd_oo = true\nnoise = 2.0\ncommanded = [30, -20, 10]\n', encoding="utf-8"
    )
    code, text, out = cli("calibrate", "centrifuge", tmp_path / "o.csv", "--json", "-", "--plant",
                          tmp_path / "plain.toml")  # fmt: skip
    assert code == 3
    assert json.loads(out)["mean_squared_innovation"] > 10.0
    for words, said in (
        (["--positions", "1,0,2"], "has 12 position"), (["--simulate", 1], "of its own"),
        (["--scheme", test, "--positions", "1,0,2"], "say one"), (["--accel", "s"], "--accel"),
    ):  # fmt: skip
        code, text, _ = cli("calibrate", "centrifuge", tmp_path / "o.csv", *words)
        assert code == 2
        assert said in text
    assert cli("simulate", test, "--truth", tmp_path / "t.parquet")[0] == 2


@pytest.mark.realdata
def test_poses_on_the_real_record(cli, data_dir, tmp_path):
    pytest.importorskip("plotly")
    folder = data_dir / "imu_tk_xsens_multipos"
    code, text, _ = cli(
        "calibrate", "poses", folder / "xsens_acc.mat", folder / "xsens_gyro.mat", "--gravity",
        9.8066, "--initial", "50s", "--gyro-scale", "0.01 deg/s", "--json", tmp_path / "p.json",
        "--out", tmp_path / "p.toml", "--report", tmp_path / "p.html",
    )  # fmt: skip
    assert code == 0
    assert "38 poses, 38 used" in text
    data = json.loads((tmp_path / "p.json").read_text(encoding="utf-8"))
    schema("calibrate-poses").validate(data)
    assert data["residual_rms_m_s2"] <= 1.05e-3
    assert Calibration.from_toml(tmp_path / "p.toml").input == "counts"
    assert "Not observable from these poses" in (tmp_path / "p.html").read_text(encoding="utf-8")


def test_poses_from_one_record(cli, tmp_path):
    from tests.calibration.test_poses import BIAS, by_hand

    t, f, w = by_hand(np.random.default_rng(1), poses=14)
    rows = np.column_stack([t, w, f])
    np.savetxt(tmp_path / "r.csv", rows, delimiter=",", header="t,gx,gy,gz,ax,ay,az", comments="")
    code, text, _ = cli("calibrate", "poses", tmp_path / "r.csv", "--gyro", "rad/s", "--accel",
                        "m/s^2", "--gravity", 9.80665, "--out", tmp_path / "c.toml")  # fmt: skip
    assert code == 0, text
    found = Calibration.from_toml(tmp_path / "c.toml")
    np.testing.assert_allclose(found.accel_bias, BIAS, atol=0.02)


def test_gravity_of_the_poses_is_said(cli, tmp_path):
    from tests.calibration.test_poses import MATRIX, by_hand

    t, f, w = by_hand(np.random.default_rng(1), poses=14)
    rows = np.column_stack([t, np.degrees(w), f / 9.80665])
    path = tmp_path / "r.csv"
    np.savetxt(path, rows, delimiter=",", header="t,gx,gy,gz,ax,ay,az", comments="")
    units = ("--gyro", "deg/s", "--accel", "g", "--axes", "RFU", "--json", "-")
    code, text, _ = cli("calibrate", "poses", path, *units)
    assert code == 2
    assert "say --lat (and --height), or --gravity" in text
    for words, gravity, said in (
        (("--gravity", 9.80665), 9.80665, "as given"),
        (("--lat", 0, "--height", 1000), 9.77724, "latitude 0 deg, height 1000 m"),
    ):
        code, text, out = cli("calibrate", "poses", path, *units, *words)
        assert code == 0, text
        data = json.loads(out)
        schema("calibrate-poses").validate(data)
        assert data["gravity_m_s2"] == pytest.approx(gravity, abs=1e-5)
        assert said in data["gravity_from"]
        # Gravity is the scale: the matrix is in proportion to it.
        expected = MATRIX[0, 0] * gravity / 9.80665
        assert (
            abs(data["accelerometer"]["matrix"][0][0] - expected)
            < 5 * data["accelerometer"]["matrix_sigma"][0][0]
        )


def test_align_applies_a_calibration(cli, tmp_path, rng):
    from dataclasses import replace

    from schuler.motion import Static
    from schuler.simulation import simulate

    site = sc.Site(40.0)
    record = simulate(Static(heading=50.0), site, 30.0, 100.0).record
    bias = np.array([0.02, -0.03, 0.01])
    sc.write(record, tmp_path / "true.parquet")
    sc.write(replace(record, dvel=1.01 * record.dvel + 0.01 * bias), tmp_path / "bad.parquet")
    Calibration(accel_bias=bias, accel_matrix=np.eye(3) / 1.01).to_toml(tmp_path / "c.toml")
    fixes = []
    for words in (["true.parquet"], ["bad.parquet"],
                  ["bad.parquet", "--calibration", tmp_path / "c.toml"]):  # fmt: skip
        code, text, out = cli("align", tmp_path / words[0], *words[1:], "--lat", 40, "--json", "-")
        assert code == 0, text
        fixes.append(json.loads(out))
    pitch = [f["pitch_deg"] for f in fixes]
    assert pitch[2] == pytest.approx(pitch[0], abs=1e-6)
    assert abs(pitch[1] - pitch[0]) > 0.1
    Calibration(input="counts").to_toml(tmp_path / "c.toml")
    code, said, _ = cli("align", tmp_path / "bad.parquet", "--lat", 40, "--calibration",
                        tmp_path / "c.toml")  # fmt: skip
    assert code == 2
    assert "raw counts" in said


@pytest.mark.slow
def test_systematic_finds_biases_from_turns(cli, tmp_path):
    from schuler.calibration import SYSTEMATIC_NAMES
    from schuler.constants import DEG_PER_HOUR, MICRO_G
    from schuler.motion.turntable import Dwell, Turntable
    from schuler.simulation import simulate
    from tests.calibration.test_turntable import sequence

    table = {
        "gyro": {"bias": "0.02 deg/h", "angle_random_walk": "0.002 deg/sqrt(h)"},
        "accelerometer": {"bias": "50 ug", "velocity_random_walk": "5 ug/sqrt(Hz)"},
    }
    (tmp_path / "s.toml").write_text(
        "\n".join(f"[{k}]\n" + "\n".join(f'{a} = "{b}"' for a, b in v.items())
                  for k, v in table.items())
    )  # fmt: skip
    turns = Turntable((Dwell(100.0), *sequence().steps))
    gyro = np.array([0.02, -0.03, 0.01]) * DEG_PER_HOUR
    accel = np.array([50.0, -60.0, 30.0]) * MICRO_G
    made = simulate(turns, sc.Site(34.0), np.floor(turns.period), 50.0,
                    sc.ImuSpec.from_dict(table), np.random.default_rng(3), gyro_bias=gyro,
                    accel_bias=accel)  # fmt: skip
    sc.write(made.record, tmp_path / "turns.parquet")
    code, text, _ = cli(
        "calibrate", "systematic", tmp_path / "turns.parquet", "--lat", 34, "--spec",
        tmp_path / "s.toml", "--align", "100s", "--out", tmp_path / "c.toml", "--json",
        tmp_path / "c.json",
    )  # fmt: skip
    assert code == 0, text
    data = json.loads((tmp_path / "c.json").read_text(encoding="utf-8"))
    schema("calibrate-systematic").validate(data)
    true = dict.fromkeys(SYSTEMATIC_NAMES, 0.0)
    true |= {f"gyro bias {a}": v for a, v in zip("xyz", gyro, strict=True)}
    true |= {f"accelerometer bias {a}": v for a, v in zip("xyz", accel, strict=True)}
    for name, row in data["values"].items():
        assert abs(row["value"] - true[name]) <= 4.5 * row["sigma"], name
    np.testing.assert_allclose(Calibration.from_toml(tmp_path / "c.toml").accel_bias, accel,
                               atol=5 * MICRO_G)  # fmt: skip
    assert cli("calibrate", "systematic", tmp_path / "turns.parquet", "--spec",
               "navigation-fog")[0] == 2  # fmt: skip


@pytest.mark.parametrize(
    ("content", "text"),
    [("", "expected 100 rows"), ("1 2 x 4\n", "not a table of numbers"),
     ("1 2 3\n" * 200, "expected 100 rows"), (None, "cannot be read")],
)  # fmt: skip
def test_bad_tables_are_one_sentence(cli, tmp_path, content, text):
    path = tmp_path / "a.txt"
    if content is not None:
        path.write_text(content, encoding="utf-8")
    code, said, _ = cli("calibrate", "poses", path, path, "--gyro-scale", "1 deg/s", "--lat", 48)
    assert code == 2
    assert text in said


def test_poses_bad_options(cli, tmp_path):
    good = tmp_path / "a.txt"
    t = 0.01 * np.arange(200)
    np.savetxt(good, np.column_stack([t, np.ones((200, 3))]))
    late = tmp_path / "b.txt"
    np.savetxt(late, np.column_stack([t + 1, np.ones((200, 3))]))
    for words, text in (
        ((good, good, "--gravity", 9.8, "--lat", 48), "not both"),
        ((good, good, "--lat", 48, "--axes", "FRD"), "--axes goes with one record"),
        ((good, good), "say --lat (and --height), or --gravity"),
        ((good, good, "--lat", 48), "say roughly what a count"),
        ((good, late, "--lat", 48, "--gyro-scale", "1 deg/s"), "same instants"),
        ((good, good, good), "one record or two tables"),
        ((good, good, "--gravity", "98"), "--gravity"),
        ((good, "--gyro-scale", "1 deg/s"), "two tables of counts"),
    ):
        code, said, _ = cli("calibrate", "poses", *words)
        assert code == 2
        assert text in said


def test_table_tests_end_in_one_calibration_file(cli, tmp_path):
    pytest.importorskip("plotly")
    from tests.calibration import test_table_test as table

    motion, attitudes = table.table(table.SIX)
    made = table.simulate(motion, table.SITE, np.floor(motion.period), 100.0, table.SPEC,
                          np.random.default_rng(1))  # fmt: skip
    record = table.off(made.record)
    sc.write(record, tmp_path / "seven.parquet")
    sc.write(table.turned(table.RATES, table.AXES), tmp_path / "turns.parquet")
    (tmp_path / "seven.toml").write_text(
        "".join(f"[[position]]\nattitude = {list(a)}\n" for a in attitudes), encoding="utf-8"
    )
    (tmp_path / "rates.toml").write_text(
        "".join(
            f'[[turn]]\naxis = {a.tolist()}\nrate = "{r} deg/s"\n'
            for r, a in zip(table.RATES, table.AXES, strict=True)
        ),
        encoding="utf-8",
    )
    dwells = []
    for k, part in enumerate(table.dwells_of(record, attitudes)):
        if k != 4:
            dwells.append(tmp_path / f"d{k}.npz")
            sc.write(part, dwells[-1])
    place = ("--lat", 48, "--height", 500)
    code, text, _ = cli("calibrate", "sixpos", *dwells, *place, "--out", tmp_path / "six.toml")
    assert code == 0, text
    assert "accelerometer x: bias 30" in text
    code, text, _ = cli(
        "calibrate", "rate", tmp_path / "turns.parquet", "--sequence", tmp_path / "rates.toml",
        "--lat", 48, "--base", tmp_path / "six.toml", "--out", tmp_path / "both.toml",
    )  # fmt: skip
    assert code == 0, text
    both, six = (Calibration.from_toml(tmp_path / f"{name}.toml") for name in ("both", "six"))
    np.testing.assert_array_equal(both.accel_matrix, six.accel_matrix)
    np.testing.assert_allclose(both.gyro_matrix, np.linalg.inv(table.GYRO), atol=2e-5)
    seven = ("calibrate", "turntable", tmp_path / "seven.parquet")
    code, text, out = cli(*seven, "--sequence", tmp_path / "seven.toml", *place, "--base",
                          tmp_path / "both.toml", "--report", tmp_path / "t.html", "--json",
                          "-")  # fmt: skip
    assert code == 0, text
    data = json.loads(out)
    schema("calibrate-table").validate(data)
    assert data["found"] == ["accel_bias", "accel_matrix", "gyro_bias"]
    assert "Stretches" in (tmp_path / "t.html").read_text(encoding="utf-8")
    assert data["recognised"] is None
    code, text, out = cli(*seven, *place, "--base", tmp_path / "both.toml", "--report",
                          tmp_path / "r.html", "--json", "-")  # fmt: skip
    assert code == 0, text
    own = json.loads(out)
    schema("calibrate-table").validate(own)
    assert own["recognised"].startswith("6 positions, some of them again (7 dwells); turns recogn")
    assert own["found"] == data["found"]
    assert "some of them again" in (tmp_path / "r.html").read_text(encoding="utf-8")
    for words, said in (
        ((*seven, "--positions", 6, "--sequence", tmp_path / "seven.toml", *place), "not both"),
        ((*seven, "--positions", 18, *place), "found 7"),
        ((*seven, "--positions", 6), "say --lat"),
        (("calibrate", "rate", dwells[0], "--sequence", tmp_path / "rates.toml"), "say --lat"),
        (("calibrate", "rate", dwells[0], "--sequence", tmp_path / "rates.toml", "--lat", 48),
         "found 0 stretches"),
    ):  # fmt: skip
        code, text, _ = cli(*words)
        assert code == 2
        assert said in text
