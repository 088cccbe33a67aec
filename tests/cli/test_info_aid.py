"""``schuler info`` of a file of fixes or speeds: text, JSON against its schema, and records."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from pathlib import Path

import jsonschema
import pytest

from schuler.io import aid_kind
from tests.io import gnss_makers as make
from tests.io.conftest import make_rows, make_text
from tests.io.makers import novatel_binary, novatel_row, write_bag

from .conftest import Ran

Run = Callable[..., Ran]


@pytest.fixture
def schema(root: Path) -> dict[str, object]:
    loaded: dict[str, object] = json.loads(
        (root / "docs" / "aid.schema.json").read_text(encoding="utf-8")
    )
    return loaded


def test_fixes_in_text(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    data = bytearray(make.nmea(sigma=True))
    data[len(data) // 2 + 20] ^= 1
    path.write_bytes(data)
    ran = run("info", path)
    assert ran.code == 0, ran.err
    for words in (
        "(nmea)", "2 Hz, ", "seconds of the day in UTC (2025-11-02)", "fixed",
        "above the ellipsoid", "d(position)/dt differs by", "left out  1 with",
    ):  # fmt: skip
        assert words in ran.out, ran.out


def test_pulses_are_counted_a_second(run: Run, tmp_path: Path, schema: dict[str, object]) -> None:
    # 48 pulses a second, and 96 in the last: how long one is, no file says.
    path = tmp_path / "wheel.csv"
    counts = [*range(0, 481, 48), 576]
    rows = "".join(f"{k},{count}\n" for k, count in enumerate(counts))
    path.write_text(f"time,pulses\n{rows}", encoding="utf-8")
    data = json.loads(run("info", path, "--json", "-").out)
    jsonschema.Draft202012Validator(schema).validate(data)
    assert data["kind"] == "speeds"
    assert data["mean_pulses_s"] == pytest.approx(576 / 11)
    assert data["largest_pulses_s"] == pytest.approx(96.0)
    assert "mean_m_s" not in data
    ran = run("info", path)
    assert ran.code == 0, ran.err
    assert "pulses  52.36 a second on average, at most 96" in ran.out


def test_json_fits_its_schema(run: Run, tmp_path: Path, schema: dict[str, object]) -> None:
    files = {"a.ubx": make.ubx(), "a.gps": make.novatel_binary(), "a.csv": make.csv(),
             "a.pos": make.rtklib(), "s.csv": b"time,speed [km/h]\n0,36\n1,72\n2,0\n"}  # fmt: skip
    kinds = {"s.csv": "speeds", "h.csv": "heights", "c.csv": "headings", "d.csv": "body-velocities"}
    files["h.csv"] = b"time,pressure [hPa]\n0,1013.25\n1,1012\n"
    files["c.csv"] = b"time,heading\n0,359\n1,1\n2,\n"
    files["d.csv"] = b"time,vx,vy,vz,valid\n0,0,2,0,1\n1,0,2,0,1\n2,0,0,0,0\n"
    validator = jsonschema.Draft202012Validator(schema)
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
        ran = run("info", tmp_path / name, "--json", "-")
        assert ran.code == 0, ran.err
        data = json.loads(ran.out)
        validator.validate(data)
        assert data["kind"] == kinds.get(name, "fixes")
        assert run("info", tmp_path / name).out.startswith("      file")
        if name == "c.csv":
            assert data["largest_step_deg"] == pytest.approx(2.0)
        if name in ("c.csv", "d.csv"):
            assert sum(data["dropped"].values()) == 1
    with pytest.raises(jsonschema.ValidationError):
        validator.validate({**data, "rows": "many"})


def test_a_late_velocity_is_found(run: Run, tmp_path: Path) -> None:
    import numpy as np

    t = np.arange(0.0, 60.0, 0.25)
    north = 10.0 * t - 10.0 * (np.cos(0.5 * t) - 1.0)
    speed = 10.0 + 5.0 * np.sin(0.5 * (t - 0.2))
    rows = np.column_stack([t, 40.0 + np.degrees(north / 6.36e6), 10 + 0 * t, 0 * t, speed, 0 * t])
    head = "time,lat,lon,height,vn,ve"
    np.savetxt(tmp_path / "a.csv", rows, "%.12g", ",", header=head, comments="")
    found = json.loads(run("info", tmp_path / "a.csv", "--json", "-").out)["consistency"]
    assert found["lag_s"] == pytest.approx(0.2, abs=0.01)
    assert found["rms_at_lag_m_s"][1] < 0.3 * found["rms_m_s"][1]
    assert "+0.20" in run("info", tmp_path / "a.csv").out


def test_wrong_fixes_are_warned_of(run: Run, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(make.csv("time,lat,lon,height,vn,ve,vu"))
    ran = run("info", tmp_path / "a.csv")
    assert ran.code == 0
    assert "components seem exchanged" in ran.err


def test_records_are_records(run: Run, tmp_path: Path) -> None:
    rows = make_rows(120)
    made = {"a.csv": make_text(rows).encode(), "a.txt": make_text(rows, " ", header=None).encode()}
    made["n.gps"] = b"".join(
        novatel_binary("RAWIMUSX", novatel_row("RAWIMUSX", 2391, t, (1, 2, 3, 4, 5, 60_000)))
        for t in rows[:, 0]
    ) + make.novatel_binary()  # fmt: skip
    for name, content in made.items():
        (tmp_path / name).write_bytes(content)
        assert aid_kind(tmp_path / name) is None, name
    assert aid_kind(write_bag(tmp_path / "a.bag", {"/imu": rows}, "ros1")) is None
    assert aid_kind(tmp_path / "absent") is None
    from tests.io.makers import ulog_file, vehicle_imu

    (tmp_path / "a.ulg").write_bytes(ulog_file([("vehicle_imu", 0, vehicle_imu(rows))]))
    assert aid_kind(tmp_path / "a.ulg") is None
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(made["a.csv"]))
    (tmp_path / "cut.gz").write_bytes(gzip.compress(made["a.csv"])[:40])
    assert aid_kind(tmp_path / "a.csv.gz") is None
    assert aid_kind(tmp_path / "cut.gz") is None
    (tmp_path / "g.csv.gz").write_bytes(gzip.compress(make.csv()))
    assert aid_kind(tmp_path / "g.csv.gz") == "fixes"
    # A log with both is a record, and fixes where that is asked for.
    ran = run("info", tmp_path / "n.gps", "--kind", "fixes")
    assert ran.code == 0, ran.err
    assert "(novatel)" in ran.out


def test_what_is_of_a_record_is_refused(run: Run, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(make.csv())
    ran = run("info", tmp_path / "a.csv", "--kind", "fixes", "--axes", "FRD")
    assert ran.code == 2
    assert "--axes is for a record" in ran.err


def test_heights_above_the_geoid_are_said(run: Run, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(make.csv("t,lat,lon,altitude_msl [m],ve,vn,vu"))
    ran = run("info", tmp_path / "a.csv")
    assert "above the geoid (sea level)" in ran.out
    assert "say --gnss-height" in ran.err
