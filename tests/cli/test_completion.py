"""Completion in a real shell, and the lines it comes from."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest
from click.testing import CliRunner

from schuler.cli import cli

SCHULER = f"{sys.executable} -m schuler"


def completed(words: str, place: int, folder=None) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-m", "schuler"], capture_output=True, text=True, timeout=120, cwd=folder,
        env={**os.environ, "_SCHULER_COMPLETE": "bash_complete", "COMP_WORDS": words,
             "COMP_CWORD": str(place)},
    )  # fmt: skip
    assert done.stderr == ""
    return done.stdout.split()


def test_names_are_completed(tmp_path):
    (tmp_path / "ours.toml").touch()
    (tmp_path / "sub").mkdir()
    assert completed("schuler al", 1) == ["plain,align", "plain,allan"]
    assert "plain,--report" in completed("schuler align x --rep", 3)
    assert completed("schuler align x --method kalman-l", 4) == ["plain,kalman-large"]
    assert completed("schuler align x --prefilter h", 4) == ["plain,hankel"]
    assert completed("schuler align x --spec ", 4, tmp_path) == [
        "plain,navigation-rlg", "plain,navigation-fog", "plain,tactical-fog",
        "plain,industrial-mems", "plain,ours.toml", "plain,sub/",
    ]  # fmt: skip
    assert completed("schuler align tru", 2) == ["file,tru"]
    assert completed("schuler simulate ./o", 2, tmp_path) == ["plain,./ours.toml"]
    assert completed("schuler simulate none/o", 2, tmp_path) == []


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_shell_accepts_its_lines(shell):
    said = CliRunner().invoke(cli, ["completion", shell])
    assert said.exit_code == 0, said.output
    assert "_SCHULER_COMPLETE" in said.output
    found = shutil.which(shell)
    if found is None:
        pytest.skip(f"{shell} is not here")
    done = subprocess.run([found, "-n", "/dev/stdin"], input=said.output, text=True,
                          capture_output=True)  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_another_shell_is_refused():
    assert CliRunner().invoke(cli, ["completion", "csh"]).exit_code == 2
