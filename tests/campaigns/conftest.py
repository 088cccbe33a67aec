"""A small scenario, kernels that are compiled before anybody compares bits, and starts to kill."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from schuler.config import load_scenario

SCENE = """duration = "20 s"
rate = "20 Hz"
seed = 9
instrument = "navigation-fog"

[site]
lat = 40.0

[motion]
kind = "vehicle"
heading = 30
shake_mm = 2

[align]
method = ["centred", "analytic"]
"""

WARM = """
import sys
from schuler import campaigns
from schuler.campaigns import Campaign
from schuler.config import load_scenario
campaigns.campaign(Campaign(load_scenario(sys.argv[1]), 1), sys.argv[2], workers=0)
"""


@pytest.fixture(scope="session")
def scene_file(tmp_path_factory) -> Path:
    """Return the scenario's file, once its kernels are in the cache of compiled code.

    Code that was compiled a moment ago and code that comes from the cache may round differently
    where a helper was linked twice; a campaign's workers all take it from the cache.
    """
    folder = tmp_path_factory.mktemp("campaign")
    path = folder / "scene.toml"
    path.write_text(SCENE)
    subprocess.run(
        [sys.executable, "-c", WARM, str(path), str(folder / "warm")], check=True, timeout=300
    )
    return path


@pytest.fixture(scope="session")
def scene(scene_file):
    return load_scenario(scene_file)


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def start(scene_file: Path, out: Path, *more: str) -> subprocess.Popen[str]:
    """Start ``schuler campaign`` in a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "schuler", "campaign", str(scene_file), "--out", str(out), *more],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        env={**os.environ},
    )  # fmt: skip
