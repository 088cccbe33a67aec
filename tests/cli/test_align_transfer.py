"""``schuler align --master``: text, JSON, report, and wrong input."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from schuler.attitude import psi_to_heading, quat_to_euler
from schuler.constants import DEG
from schuler.io import write, write_trajectory
from tests.alignment.transfer.aircraft import DELAY, LEVER, case, errors

from .conftest import Ran

Run = Callable[..., Ran]
SIGMA = ("--master-sigma", "0.1,0.02", "--spec", "tactical-fog")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pod")
    record, master, _, _ = case("turn", 4)
    write(record, folder / "slave.parquet")
    write_trajectory(master, folder / "fog.parquet")
    # The same by names, as text, with Euler angles; and without attitude or long ago.
    psi, theta, gamma = quat_to_euler(master.quat_nb).T
    rows = np.column_stack([
        master.time, master.lat / DEG, master.lon / DEG, master.height, master.v_n,
        psi_to_heading(psi) / DEG, theta / DEG, gamma / DEG,
    ])  # fmt: skip
    head = "t,lat,lon,height,ve,vn,vu,heading,pitch,roll"
    np.savetxt(folder / "fog.csv", rows, "%.12g", ",", header=head, comments="")
    write_trajectory(replace(master, quat_nb=None), folder / "level.parquet")
    write_trajectory(replace(master, time=master.time + 1e4), folder / "late.parquet")
    return {name: folder / file for name, file in (
        ("I", "slave.parquet"), ("M", "fog.parquet"), ("T", "fog.csv"), ("N", "level.parquet"),
        ("L", "late.parquet"))}  # fmt: skip


def arguments(files: dict[str, Path], *words: object) -> list[object]:
    return [files.get(str(word), word) for word in words]


@pytest.mark.parametrize("master", ["M", "T"])
def test_json_has_how_the_slave_is_mounted(
    run: Run, files: dict[str, Path], root: Path, master: str
) -> None:
    schema = json.loads((root / "docs" / "alignment.schema.json").read_text(encoding="utf-8"))
    ran = run(*arguments(files, "align", "I", "--master", master, *SIGMA, "--to", "12s",
                         "--then-free", "5s", "--json", "-"))  # fmt: skip
    assert ran.code == 0, ran.err
    data = json.loads(ran.out)
    jsonschema.Draft202012Validator(schema).validate(data)
    found = data["transfer"]
    assert found["free"]["seconds"] == pytest.approx(5.0, abs=0.11)
    assert found["delay_s"][0] == pytest.approx(DELAY, abs=5.0 * found["delay_s"][1])
    error = np.abs(np.array(found["lever_m"]) - LEVER)
    assert np.all(error < 4.5 * np.array(found["lever_sigma_m"]))
    _, _, made, mounting = case("turn", 4)
    psi, theta, gamma = quat_to_euler(mounting)
    told = np.array([-psi, theta, gamma]) / DEG
    assert np.abs(told - found["mounting_deg"]).max() < 0.1
    assert data["time"]["end"] == pytest.approx(12.0, abs=0.02)
    assert made.record.start == 0.0


def test_text_and_report_say_what_was_found(
    run: Run, files: dict[str, Path], tmp_path: Path
) -> None:
    page = tmp_path / "pod.html"
    ran = run(*arguments(files, "align", "I", "--master", "M", *SIGMA, "--mounting", "0,0,0",
                         "--mounting-sigma", "3", "--lever", "0.6,3.3,-0.4", "--delay", "0.02",
                         "--flexure", "0.05,0.3", "--report", page))  # fmt: skip
    assert ran.code == 0, ran.err
    assert "transfer alignment by velocity and attitude" in ran.out
    assert "mounting yaw" in ran.out
    assert "lever arm to the master 0.600 ± 0" in ran.out
    assert "delay of the master 20.00 ± 0 ms" in ran.out
    assert "mounting yaw" not in page.read_text(encoding="utf-8")  # a table has it in two cells
    assert "lever arm to the master" in page.read_text(encoding="utf-8")
    assert "What the span showed" in page.read_text(encoding="utf-8")


def test_each_option_reaches_the_alignment(run: Run, files: dict[str, Path]) -> None:
    ran = run(*arguments(files, "align", "I", "--master", "M", *SIGMA, "--match", "velocity",
                         "--lever", "auto", "--delay", "auto", "--mounting", "auto", "--at",
                         "start", "--json", "-"))  # fmt: skip
    assert ran.code == 0, ran.err
    data = json.loads(ran.out)
    assert data["method"]["options"]["match"] == "velocity"
    assert list(data["aids"]["used"]) == ["master_velocity"]
    record, master, made, mounting = case("turn", 4)
    import schuler as sc
    from schuler.alignment.transfer import MasterNoise

    fix = sc.transfer(record, master, match="velocity", spec="tactical-fog", at="start",
                      noise=MasterNoise(1e-4, 0.02))  # fmt: skip
    assert data["heading_deg"] == pytest.approx(fix.heading_deg, abs=1e-5)
    assert np.abs(errors(fix, made, mounting)[1]).max() < 0.05


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--master", "N"), "has no attitude"),
        (("--master", "L"), "share too little"),
        (("--master", "M", "--match", "speed"), "match is made of"),
        (("--master", "M", "--gnss", "T"), "--gnss is of an alignment by other aids"),
        (("--master", "M", "--lat", "40"), "the place is the master's"),
        (("--master", "M", "--mounting", "1,2"), "--mounting: expected three numbers"),
        (("--master", "M", "--mounting-sigma", "1"), "say --mounting Y,P,R"),
        (("--master", "M", "--master-sigma", "0.1"), "--master-sigma: expected 2 to 3 positive"),
        (("--master", "M", "--flexure", "-1"), "--flexure: expected 1 to 2 positive"),
        (("--master", "M", "--then-free", "60s"), "must go on to"),
        (("--master", "M", "--then-free", "5s", "--at", "start"), "leave out --at start"),
        (("--master", "M", "--delay", "soon"), "is not a number"),
        (("--match", "velocity"), "--match goes with --master"),
        (("--then-free", "5s"), "--then-free goes with --master"),
        (("--gnss", "T", "--delay", "auto"), "--delay auto is for --master"),
        (("--master", "M", "--method", "kalman"), "a method of its own"),
    ],
)
def test_wrong_input_is_named(
    run: Run, files: dict[str, Path], words: tuple[str, ...], said: str
) -> None:
    ran = run(*arguments(files, "align", "I", *words))
    assert ran.code == 2
    assert said in " ".join(ran.err.split()), ran.err
    assert not ran.out
