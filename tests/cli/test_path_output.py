"""What ``schuler navigate`` writes of a path: rows, the point, formats."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import schuler as sc
from schuler.cli.path_output import _SUFFIXES
from schuler.io.trajectory_write import SUFFIXES

from .test_aided import Run, files

__all__ = ["files"]

AIDS = ("--gnss-sigma", "0.05,0.05", "--spec", "tactical-fog", "--smooth", "--stop", "60s")


def test_all_formats_of_paths_are_offered() -> None:
    assert set(_SUFFIXES) == set(SUFFIXES)


def test_rows_and_points_of_an_aided_path(
    run: Run, files: tuple[Path, Path], tmp_path: Path
) -> None:
    paths = {}
    for name, more in {
        "epochs": (), "samples": ("--every", "4"), "moved": ("--at", "0.5,1.5,-0.2"),
        "moved_samples": ("--every", "4", "--at", "0.5,1.5,-0.2"),
        "antenna": ("--lever", "0,0,0", "--at", "antenna"),
    }.items():  # fmt: skip
        out = tmp_path / f"{name}.parquet"
        ran = run("navigate", files[0], "--gnss", files[1], *AIDS, *more, "--out", out)
        assert ran.code == 0, ran.err
        paths[name] = sc.read_trajectory(out)
    epochs, samples = paths["epochs"], paths["samples"]
    assert np.all(np.isin(np.diff(samples.time).round(6), [0.04]))
    assert samples.time[-1] == epochs.time[-1]
    assert len(epochs) < len(samples)
    for at, base in (("moved", epochs), ("moved_samples", samples)):
        path = paths[at]
        assert np.array_equal(path.time, base.time)
        apart = sc.evaluate(path, base)
        np.testing.assert_allclose(
            np.linalg.norm(apart.position, axis=1), np.linalg.norm([0.5, 1.5, -0.2]), atol=1e-5
        )
        assert np.ptp(apart.velocity[:, 0]) > 0.3  # the lever swings in the turns
    np.testing.assert_allclose(
        np.interp(samples.time, epochs.time, paths["moved"].v_n[:, 0]),
        paths["moved_samples"].v_n[:, 0], atol=0.15,
    )  # fmt: skip
    np.testing.assert_allclose(paths["antenna"].position, epochs.position, atol=1e-12)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--at", "antenna"), "say --gnss"),
        (("--at", "1,2"), "--at: expected three numbers"),
        (("--out-format", "pyins"), "--out-format says the columns of --out"),
        (("--out", "a.kml", "--out-format", "pyins"), "cannot write a trajectory in the layout"),
        (("--out", "a.mat"), "cannot write a trajectory as '.mat'"),
        (("--out", "a.xml"), "ends in .xml"),
        (("--every", "0"), "a whole number from 1"),
    ],
)
def test_wrong_options_of_the_path(
    run: Run, files: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    more: tuple[str, ...], words: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    ran = run("navigate", files[0], *more)
    assert (ran.code, words in ran.err, "Traceback" in ran.err) == (2, True, False), ran.err
    assert not list(tmp_path.iterdir())


def test_a_free_path_of_another_point(run: Run, files: tuple[Path, Path], tmp_path: Path) -> None:
    start = ("--lat", "40", "--lon", "10", "--height", "100", "--heading", "40", "--stop", "40s")
    for name, more in (("imu", ()), ("bow", ("--at", "0,2,0"))):
        out = tmp_path / f"{name}.csv"
        ran = run("navigate", files[0], *start, "--every", "10", *more, "--out", out,
                  "--out-format", "pyins")  # fmt: skip
        assert ran.code == 0, ran.err
    bow, imu = (sc.read_trajectory(tmp_path / f"{name}.csv") for name in ("bow", "imu"))
    apart = sc.evaluate(bow, imu)
    assert np.array_equal(bow.time, imu.time)
    np.testing.assert_allclose(apart.radial, 2.0, atol=0.01)
