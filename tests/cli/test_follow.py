"""``schuler align --follow``: files that grow, pipes that stay open, Ctrl-C."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from .conftest import PLACE, Ran, as_text, found

Array = NDArray[np.float64]
Run = Callable[..., Ran]

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals and pipes of POSIX")


def listen_to_interrupts() -> None:
    """Undo what a caller may have said: a test in the background ignores Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@contextmanager
def schuler(*arguments: object) -> Iterator[subprocess.Popen[str]]:
    """Run a command beside the test; end it if the test has not."""
    with subprocess.Popen(
        [sys.executable, "-W", "error", "-m", "schuler", *map(str, arguments)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=listen_to_interrupts,
    ) as process:  # fmt: skip
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()


def expected(run: Run, csv: Path) -> dict[str, object]:
    ran = run("align", csv, *PLACE, "--json", "-")
    data: dict[str, object] = found(ran.out)
    return data


def test_a_file_that_does_not_grow(run: Run, csv: Path) -> None:
    ran = run("align", csv, *PLACE, "--follow", "--idle", "0.1s", "--json", "-")
    assert ran.code == 0
    assert found(ran.out) == expected(run, csv)
    assert any("± " in line for line in ran.err.splitlines())


def test_a_file_that_grows_from_nothing(run: Run, csv: Path, tmp_path: Path) -> None:
    """Empty, then half a header, half a row, then all: the result is that of the whole file."""
    path, out = tmp_path / "live.csv", tmp_path / "live.json"
    path.touch()
    text = csv.read_text()
    cuts = [0, 7, len("t,gx,gy,gz,ax,ay,az\n") + 9, 20_000, 60_000, len(text)]
    with schuler("align", path, *PLACE, "--follow", "--idle", "3s", "--json", out) as process:
        for begin, end in pairwise(cuts):
            time.sleep(0.5)
            assert process.poll() is None
            with path.open("a") as file:
                file.write(text[begin:end])
        out_text, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    assert "Traceback" not in err
    assert found(out.read_text()) == expected(run, csv)
    assert out_text.splitlines()[-1].startswith("heading budget")


def test_nothing_comes(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "live.csv"
    path.touch()
    ran = run("align", path, *PLACE, "--follow", "--idle", "0.3")
    assert (ran.code, ran.err) == (2, f"schuler: {path}: is empty\n")
    path.write_text("t,gx,gy,gz,ax,ay,az\n")
    ran = run("align", path, *PLACE, "--follow", "--idle", "0.3")
    assert (ran.code, ran.err) == (2, f"schuler: {path}: has a header but no data rows\n")


def test_a_pipe_that_stays_open(run: Run, csv: Path) -> None:
    with schuler("align", "-", *PLACE, "--follow", "--idle", "2s", "--json", "-") as process:
        assert process.stdin is not None
        process.stdin.write(csv.read_text())
        process.stdin.flush()
        assert process.stdout is not None
        # Nobody closes the pipe: the command ends by itself.
        out = process.stdout.read()
        assert process.wait(60) == 0
    assert found(out) == expected(run, csv)


def test_a_pipe_that_says_nothing() -> None:
    with schuler("align", "-", *PLACE, "--follow", "--idle", "0.2s") as process:
        assert process.stderr is not None
        err = process.stderr.read()
        assert process.wait(60) == 2
    assert err == "schuler: standard input: nothing came in 0.2 s\n"


def test_a_pipe_that_ends(run: Run, csv: Path) -> None:
    with schuler("align", "-", *PLACE, "--follow", "--json", "-") as process:
        out, _ = process.communicate(csv.read_text(), timeout=300)
    assert process.returncode == 0
    assert found(out) == expected(run, csv)


def test_interrupt_gives_the_result_so_far(csv: Path) -> None:
    with schuler("align", csv, *PLACE, "--follow") as process:
        assert process.stdout is not None
        first = process.stdout.readline()  # it is at work: the way to end is Ctrl-C
        assert "heading" in first
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    assert "Traceback" not in err
    # The last rows wait for others to follow: whether they are bad samples is not known yet.
    found = re.search(r"(\d+) samples", out)
    assert found is not None
    assert 1180 <= int(found[1]) <= 1199
    assert out.splitlines()[-1].startswith("heading budget")


def test_interrupt_before_the_first_row(tmp_path: Path) -> None:
    path = tmp_path / "live.csv"
    path.touch()
    with schuler("align", path, *PLACE, "--follow") as process:
        time.sleep(6.0)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=300)
    assert process.returncode == 130
    assert err == "\nschuler: stopped\n"


def test_a_bad_row_while_following(csv: Path, tmp_path: Path) -> None:
    path = tmp_path / "live.csv"
    path.write_text(csv.read_text() + "60.05,1,2,x,4,5,6\n")
    with schuler("align", path, *PLACE, "--follow") as process:
        _, err = process.communicate(timeout=300)
    assert process.returncode == 2
    assert err.startswith(f"schuler: {path}: line 1202, column 'gz': 'x'")


def test_what_a_live_reader_sees(run: Run, original: Array, tmp_path: Path) -> None:
    """Each live line is time used, heading and sigma; the last one is nearly the result."""
    path = tmp_path / "live.csv"
    path.write_text(as_text(original))
    ran = run("align", path, *PLACE, "--follow", "--idle", "0.1")
    assert ran.code == 0
    live = ran.out.splitlines()[0].split()
    assert live[1:3] == ["s", "heading"]
    assert live[5] == "±"
