"""Files of a centrifuge test: written and read again, and what they may not be."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.centrifuge import (
    CentrifugeScheme,
    Plant,
    identify,
    plant_from_toml,
    published_truth,
    read_outputs,
    scheme_from_toml,
    simulate_platform,
    write_outputs,
)
from schuler.centrifuge.files import simulate_test, true_coefficients
from schuler.errors import InputError

PLANT = Plant(order="yzx", servo_error=(0.0, 0.0, 0.0), noise=8.0)


@pytest.fixture(scope="module")
def outputs():
    return simulate_platform(
        PLANT, CentrifugeScheme().positions, 10.0, published_truth(), np.random.default_rng(1)
    )[0]


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz"])
def test_what_is_written_is_read_again(outputs, tmp_path, suffix):
    path = tmp_path / f"o{suffix}"
    scheme = CentrifugeScheme(dwell=10.0, forces=(10.0,) * 6)
    write_outputs(path, PLANT, scheme, outputs, published_truth())
    rows, first = read_outputs(path, PLANT, 6)
    np.testing.assert_allclose(np.array(rows), outputs, atol=1e-8)
    np.testing.assert_allclose(first, 0.02, atol=1e-9)
    truth = f"{path}.truth.toml"
    assert plant_from_toml(truth) == PLANT
    assert scheme_from_toml(truth) == scheme


def test_a_hole_in_the_time_parts_positions_and_the_arm_s_phase_is_kept(outputs, tmp_path):
    """Positions that follow on one clock, of unequal length: the estimates stay."""
    rows, t0 = [], 0.0
    for k, one in enumerate(outputs):
        # A whole number of turns later, less the ten samples that the recorder was late.
        late = 10 if k == 2 else 0
        t = t0 + 0.02 * np.arange(1, len(one) + 1)
        rows.append(np.column_stack([t, one * 9.80665])[: len(one) - late])
        t0 += 20.0
    np.savetxt(tmp_path / "o.csv", np.vstack(rows), delimiter=",", header="t,ax,ay,az", comments="")
    back, first = read_outputs(tmp_path / "o.csv", PLANT, 6, "m/s^2")
    assert [len(one) for one in back] == [500, 500, 490, 500, 500, 500]
    scheme = CentrifugeScheme(dwell=10.0)
    found = identify(PLANT, scheme, back, first=first, truth=published_truth())
    whole = identify(PLANT, scheme, outputs, truth=published_truth())
    assert found.nees == pytest.approx(whole.nees, rel=0.2)
    assert found.nees < 1.8


def test_the_phase_of_the_arm_counts(outputs):
    scheme = CentrifugeScheme(dwell=10.0)
    cut = [one[25:] for one in outputs]
    right = identify(PLANT, scheme, cut, first=[0.52] * 6, truth=published_truth())
    assert right.fit.nis < 1.1
    with pytest.raises(InputError, match="diverged"):
        identify(PLANT, scheme, cut)
    assert not right.remarks
    off = identify(Plant(order="yzx", noise=4.0), scheme, outputs)
    assert "does not fit" in off.remarks[0]
    table = right.to_pandas()
    assert list(table.index[:3]) == ["D_Fx", "D_Fy", "D_Fz"]
    assert table.loc["th_oz", "true"] == pytest.approx(260.0)


def write(path, text):
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a,b\n1,2\n", "has no column t, ax"),
        ("t,ax,ay,az\n", "holds 0 row"),
        ("t,ax,ay,az\n1,2,3,x\n", "not a table of numbers"),
        ("t,ax,ay,az\n1,2,3\n2,2,3\n", "names 4 columns, but rows have 3"),
        ("t,ax,ay,az\n0.02,1,1,1\n0.04,nan,1,1\n", "row 2 holds a value"),
        ("t,ax,ay,az\n0.02,1,1,1\n0.04,1,1,1\n", "has 1 position"),
        ("position,t,ax,ay,az\n1,0.02,1,1,1\n1,0.06,1,1,1\n2,0.02,1,1,1\n", "rows 1 and 2 are"),
    ],
)
def test_a_bad_table_is_one_sentence(tmp_path, text, said):
    with pytest.raises(InputError, match=said):
        read_outputs(write(tmp_path / "o.csv", text), Plant(), 2)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[plant]\nforec = 3", "unknown key 'plant.forec'"),
        ("force = '3 g'", "plant.force: expected a number"),
        ("d_oo = 1", "true or false"),
        ("commanded = [1, 2]", "expected 3 numbers"),
        ("order = 'xxx'", "gimbal order"),
        ("[scheme]\ndwell = 2", "has no table"),
    ],
)
def test_a_bad_plant_is_one_sentence(tmp_path, text, said):
    with pytest.raises(InputError, match=said) as caught:
        plant_from_toml(write(tmp_path / "p.toml", text))
    assert str(caught.value).startswith(str(tmp_path))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("dwell = 3", "positions is missing"),
        ("positions = [[1, 2]]", "rows of alpha, beta, gamma"),
        ("positions = [[1, 0, 2]]\ndwell = -1", "dwell must be positive"),
        ("positions = [[1, 0, 2]]\nforces = [1, 2]", "forces must be 1 positive"),
    ],
)
def test_a_bad_scheme_is_one_sentence(tmp_path, text, said):
    with pytest.raises(InputError, match=said):
        scheme_from_toml(write(tmp_path / "s.toml", text))


def test_a_test_s_file_is_simulated_with_what_is_set_from_outside(tmp_path):
    path = write(tmp_path / "t.toml", "[scheme]\npositions = [[1, 0, 2]]\n[truth]\nk0 = [1, 2, 3]")
    made = simulate_test(path, {"scheme.dwell": 4, "plant.noise": 5.0}, 9)
    assert made.outputs.shape == (1, 200, 3)
    assert made.plant.noise == 5.0
    np.testing.assert_allclose(made.truth[27:30], [1e-6, 2e-6, 3e-6])
    for overrides, said in (
        ({"seed": "x"}, "whole number"), ({"seed.x": 1, "seed.x.y": 1}, "not a table"),
        ({"truth.k9": 1}, "unknown key 'truth.k9'"),
        ({"truth.k0": 1}, "expected three numbers"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=said):
            simulate_test(path, overrides)
    assert len(true_coefficients({}, Plant(d_oo=True))) == 48
