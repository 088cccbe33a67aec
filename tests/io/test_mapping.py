"""Mapping and axes: what a user may say, and what is refused in one sentence."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schuler import InputError, Mapping, open_source, read
from schuler.io.axes import parse_axes
from schuler.record import ImuRecord
from tests.io.conftest import make_rows, make_text, same

# -- axes ------------------------------------------------------------------------------

#: where the file's x, y, z point, as vectors in right-forward-up
POINTS = {"R": (1, 0, 0), "L": (-1, 0, 0), "F": (0, 1, 0), "B": (0, -1, 0), "U": (0, 0, 1),
          "D": (0, 0, -1)}  # fmt: skip


def right_handed() -> list[str]:
    names = ["".join(p) for p in itertools.product(POINTS, repeat=3)]
    return [n for n in names if round(np.linalg.det([POINTS[c] for c in n])) == 1]


def test_there_are_24_right_handed_axes() -> None:
    assert len(right_handed()) == 24


@pytest.mark.parametrize("name", right_handed())
def test_letters_turn_a_known_vector(name: str) -> None:
    axes = parse_axes(name)
    in_file = np.array([1.0, 2.0, 3.0])
    # Independently: the sum of components along where each file axis points.
    expected = sum(v * np.array(POINTS[c]) for v, c in zip(in_file, name, strict=True))
    assert [s * in_file[k] for k, s in zip(axes.take, axes.sign, strict=True)] == list(expected)
    assert axes.name == name


@pytest.mark.parametrize("text", ["y,x,-z", "+y+x-z", " y , x , -z ", "Y X -Z", "frd"])
def test_spellings_of_frd(text: str) -> None:
    assert parse_axes(text) == parse_axes("FRD")


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("FLD", "left-handed"), ("RFD", "left-handed"), ("x,y,-z", "left-handed"),
        ("RLU", "once"), ("FFU", "once"), ("x,x,z", "once"), ("NED", "FRD if x points forward"),
        ("x,y", "not understood"), ("", "not understood"), ("x,y,z,", "not understood"),
        ("x,y,z,x", "not understood"), ("axy", "not understood"), ("x;y;z", "not understood"),
    ],
)  # fmt: skip
def test_bad_axes(text: str, part: str) -> None:
    with pytest.raises(InputError, match=part):
        parse_axes(text)


def test_axes_apply_to_gyro_and_accelerometer(csv: Path) -> None:
    plain, turned = read(csv), read(csv, axes="FRD")
    assert np.array_equal(turned.dtheta, plain.dtheta[:, [1, 0, 2]] * [1, 1, -1])
    assert np.array_equal(turned.dvel, plain.dvel[:, [1, 0, 2]] * [1, 1, -1])


# -- mapping ---------------------------------------------------------------------------

FULL = Mapping(
    columns=("t", "gx", "gy", "gz", "ax", "ay", "az"),
    gyro="0.1 arcsec",
    accel="125 ug*s",
    time="ms",
    mean_rates=False,
    axes="FRD",
    rate=100.0,
    start_time=-2.5,
    coning_corrected=True,
    sculling_corrected=False,
    array="triad",
    delimiter=";",
    comment="//",
    decimal=",",
    skip_rows=3,
    header=True,
    variables={"gyro": "w", "accel": "f", "time": "t"},
    format="kf-gins",
    topic="/imu/data",
    imu_type="LN200",
    accel_file="acc.csv",
    accel_topic="/accel",
    sensor="gyro",
)


def test_toml_round_trip(tmp_path: Path) -> None:
    assert set(FULL.said()) == set(Mapping.__dataclass_fields__)
    FULL.to_toml(tmp_path / "m.toml")
    assert Mapping.from_toml(tmp_path / "m.toml") == FULL
    Mapping().to_toml(tmp_path / "m.toml")
    assert Mapping.from_toml(tmp_path / "m.toml") == Mapping()


@given(
    st.builds(
        Mapping,
        gyro=st.sampled_from([None, "deg/s", "rad", "0.05 deg/s"]),
        axes=st.sampled_from([None, "FRD", "y,x,-z"]),
        rate=st.none() | st.floats(1e-3, 1e6),
        skip_rows=st.none() | st.integers(0, 99),
        header=st.none() | st.booleans(),
        columns=st.none() | st.just((7, 1, 2, 3, 4, 5, 6)),
    )
)
def test_toml_round_trip_of_any(tmp_path_factory: pytest.TempPathFactory, m: Mapping) -> None:
    path = tmp_path_factory.getbasetemp() / "any.toml"
    m.to_toml(path)
    assert Mapping.from_toml(path) == m


def test_merged_lets_the_other_win_and_keeps_the_rest() -> None:
    a, b = Mapping(gyro="deg/s", rate=10), Mapping(gyro="rad/s", header=False)
    assert a.merged(b) == Mapping(gyro="rad/s", rate=10, header=False)
    assert a.merged(None) == a


def test_from_cli() -> None:
    m = Mapping.from_cli(
        columns="t, gx,gy,gz,_,ax,ay,az", rate="100", skip_rows="2", start_time=None,
        variables="gyro=w, accel=f", delimiter="tab",
    )  # fmt: skip
    assert m.columns == ("t", "gx", "gy", "gz", "_", "ax", "ay", "az")
    assert (m.rate, m.skip_rows, m.start_time, m.delimiter) == (100.0, 2, None, "\t")
    assert m.variables == {"gyro": "w", "accel": "f"}
    assert Mapping.from_cli(columns="7,1,2,3,4,5,6").columns == (7, 1, 2, 3, 4, 5, 6)


@pytest.mark.parametrize(
    ("fields", "part"),
    [
        ({"gyro": "furlong"}, "unknown unit 'furlong'"),
        ({"gyro": "m/s"}, "gyro: 'm/s' is of velocity"),
        ({"accel": "deg/s"}, "accel: 'deg/s' is of angular rate"),
        ({"accel": "0 g"}, "other than zero"),
        ({"time": "deg"}, "time: 'deg' is of angle"),
        ({"time": "-1 s"}, "must be positive"),
        ({"gyro": 5}, "gyro: expected a text"),
        ({"axes": "FLD"}, "left-handed"),
        ({"rate": 0}, "positive number of Hz"),
        ({"rate": float("nan")}, "positive number of Hz"),
        ({"rate": "fast"}, "rate: expected a number"),
        ({"rate": True}, "rate: expected a number"),
        ({"start_time": float("inf")}, "start_time"),
        ({"skip_rows": -1}, "0 or more"),
        ({"skip_rows": 1.5}, "0 or more"),
        ({"header": "yes"}, "header: expected true or false"),
        ({"mean_rates": 1}, "mean_rates: expected true or false"),
        ({"delimiter": "ab"}, "delimiter"),
        ({"delimiter": "1"}, "delimiter"),
        ({"delimiter": ""}, "delimiter"),
        ({"decimal": "'"}, "decimal"),
        ({"decimal": ",", "delimiter": ","}, "cannot both"),
        ({"comment": ""}, "comment"),
        ({"comment": "-"}, "comment"),
        ({"columns": []}, "columns"),
        ({"columns": 7}, "columns"),
        ({"columns": "t,,gx"}, "empty"),
        ({"columns": [1, 2.5]}, "a name or a number"),
        ({"columns": "0,1,2,3,4,5,6"}, "count from 1"),
        ({"columns": "t,gx,gx"}, "named twice"),
        ({"variables": "w"}, "variables"),
        ({"variables": {"gyr": "w"}}, "unknown key 'gyr'"),
        ({"variables": {"gyro": 1}}, "name of an array"),
        ({"variables": {"matrix": "m", "gyro": "w"}}, "not both"),
    ],
)
def test_refuses(fields: dict[str, object], part: str) -> None:
    with pytest.raises(InputError, match=part) as error:
        Mapping(**fields)  # type: ignore[arg-type]
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        (
            "gyros = 'deg/s'",
            "m.toml: unknown key 'gyros'; did you mean 'gyro'. known: columns, gyro",
        ),
        ("gyro = deg/s", "m.toml: is not valid TOML"),
        ("gyro = 'zorkmid'", "m.toml: gyro: unknown unit 'zorkmid'"),
        (b"\xff\xfe", "m.toml: is not valid TOML"),
        (None, "m.toml: cannot be read"),
    ],
)
def test_toml_errors(tmp_path: Path, text: str | bytes | None, part: str) -> None:
    path = tmp_path / "m.toml"
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError, match=part):
        Mapping.from_toml(path)


def test_cli_errors() -> None:
    with pytest.raises(InputError, match="rate: expected a number, got 'x'"):
        Mapping.from_cli(rate="x")
    with pytest.raises(InputError, match="gyro=NAME"):
        Mapping.from_cli(variables="w")
    with pytest.raises(InputError, match="unknown key 'colour'"):
        Mapping.from_cli(colour="red")


# -- sidecars --------------------------------------------------------------------------


def test_sidecar_is_used_and_options_win(csv: Path) -> None:
    Mapping(gyro="deg/s", accel="g").to_toml(csv.with_name("truck.csv.toml"))
    source = open_source(csv)
    assert (source.mapping.gyro, source.mapping.accel) == ("deg/s", "g")
    assert source.notes == ["the mapping beside it, 'truck.csv.toml', was used"]
    assert "deg/s and g" in source.meaning
    assert open_source(csv, gyro="deg/h").mapping.gyro == "deg/h"
    assert open_source(csv, gyro="deg/h").mapping.accel == "g"


def test_folder_mapping_yields_to_file_and_sidecar(tmp_path: Path) -> None:
    Mapping(gyro="deg/s", accel="g", axes="FRD").to_toml(tmp_path / "schuler-mapping.toml")
    plain, units = tmp_path / "a.csv", tmp_path / "b.csv"
    plain.write_text(make_text(make_rows()))
    units.write_text(
        make_text(
            make_rows(),
            header="t,gx [rad/s],gy [rad/s],gz [rad/s],ax (m/s^2),ay (m/s^2),az (m/s^2)",
        )
    )
    assert "deg/s and g, axes FRD" in open_source(plain).meaning
    assert "schuler-mapping.toml" in open_source(plain).notes[0]
    assert "rad/s and m/s^2, axes FRD" in open_source(units).meaning
    Mapping(gyro="deg/h").to_toml(tmp_path / "b.csv.toml")
    assert "deg/h and m/s^2, axes FRD" in open_source(units).meaning


def test_own_files_ignore_the_folder_and_refuse_other_meanings(tmp_path: Path) -> None:
    from schuler import write

    rows = make_rows()
    record = ImuRecord.from_increments(rows[:, 0], rows[:, 1:4], rows[:, 4:])
    Mapping(gyro="deg", accel="g*s", axes="FRD").to_toml(tmp_path / "schuler-mapping.toml")
    for name in ("a.csv", "a.npz", "a.parquet"):
        write(record, tmp_path / name)
        assert same(read(tmp_path / name), record)
        with pytest.raises(InputError, match=f"{name}: schuler wrote this file.*drop 'gyro'"):
            read(tmp_path / name, gyro="deg")


def test_bad_sidecar_names_itself(csv: Path) -> None:
    csv.with_name("truck.csv.toml").write_text("giro = 'deg/s'")
    with pytest.raises(InputError, match=r"truck\.csv\.toml: unknown key 'giro'"):
        open_source(csv)
