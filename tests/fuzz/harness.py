"""Files damaged at random, and a worker that must survive them.

Everything follows from seeds. `SCHULER_FUZZ_SCALE` multiplies how many mutations are made;
`SCHULER_FUZZ_KEEP` names a folder that takes each file that something was found with.
"""

from __future__ import annotations

import json
import os
import select
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from schuler.errors import printable

ROOT = Path(__file__).resolve().parents[2]
#: no hang: the worker ends itself after ten seconds of computing; this is for one that waits
PATIENCE = 60.0
#: bytes
MOST_MEMORY = 600 << 20

#: nested without end, numbers without end, orders to a terminal, ends of texts
FORGED = (b"[" * 100_000, b'{"a":' * 50_000, b"9" * 6000, b"1e999", b"nan", b"-", b"\x1b[31m",
          b"\x00", b"\n", b"\r", b'"', b",", b"\xff\xfe", b"\xe2\x80\xae")  # fmt: skip
_MARKS = (b"=", b":", b",", b" ", b"\n", b"{", b"[", b"1")


def scale() -> float:
    """Return how many times the short leg is asked for."""
    return float(os.environ.get("SCHULER_FUZZ_SCALE", "1"))


def mutate(rng: np.random.Generator, data: bytes) -> bytes:
    """Damage some bytes in one of the ways in which files are damaged or forged."""
    out = bytearray(data)
    n = len(out)
    # Half of the slips are near an end, where most of what matters stands.
    reach = [(0, n), (0, n), (0, min(n, 1024)), (max(0, n - 1024), n)][rng.integers(4)]

    def place() -> int:
        return int(rng.integers(reach[0], max(reach[0] + 1, reach[1])))

    def block() -> tuple[int, int]:
        at = place()
        return at, min(n, at + int(2.0 ** rng.uniform(0, 12)))

    kind = rng.integers(10)
    if kind == 0:
        for _ in range(rng.integers(1, 9)):
            out[place() % n] ^= 1 << rng.integers(8)
    elif kind == 1:
        for _ in range(rng.integers(1, 5)):
            out[place() % n] = rng.integers(256)
    elif kind == 2:
        del out[place() :]
    elif kind == 3:
        at = place()
        out[at:at] = rng.bytes(int(2.0 ** rng.uniform(0, 10)))
    elif kind == 4:
        a, b = block()
        out[place() : place()] = out[a:b]
    elif kind == 5:
        a, b = block()
        out[a:b] = bytes(b - a)
    elif kind == 6:
        a, b = block()
        c, d = block()
        out[a:b], out[c:d] = out[c:d], out[a:b]
    elif kind == 7:
        # A length or a count that is extreme.
        width = int(rng.choice([1, 2, 4, 8]))
        value = [b"\xff" * width, b"\xff" * (width - 1) + b"\x7f", bytes(width - 1) + b"\x80",
                 bytes(width), bytes(max(0, width - 2)) + b"\x10\x00"][rng.integers(5)]  # fmt: skip
        at = place() // width * width if rng.integers(2) else place()
        out[at : at + width] = value[:width]
    elif kind == 8:
        a, b = block()
        del out[a:b]
    else:
        # After a mark of a text, if there is one: what a parser may choke on.
        at = out.find(_MARKS[rng.integers(len(_MARKS))], place())
        at = place() if at < 0 else at + 1
        out[at:at] = FORGED[rng.integers(len(FORGED))]
    return bytes(out)


@dataclass
class Answer:
    """How one request ended: used, refused, traceback, or died."""

    end: str
    text: str
    peak: int = 0


class Worker:
    """The process of `tests.fuzz.worker`, started anew when it ends."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    def ask(self, work: str, path: Path, options: dict[str, Any] | None = None) -> Answer:
        """Have one file worked on."""
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.fuzz.worker"], cwd=ROOT, text=True,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                env={**os.environ, "NUMBA_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            )  # fmt: skip
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        request = {"work": work, "path": str(path), "options": options or {}}
        process.stdin.write(json.dumps(request) + "\n")
        process.stdin.flush()
        if not select.select([process.stdout], [], [], PATIENCE)[0]:
            self.stop()
            return Answer("died", f"no answer in {PATIENCE:g} s")
        line = process.stdout.readline()
        if not line:
            code = process.wait()
            self._process = None
            return Answer("died", f"the process ended with {code} (-27: ten seconds of computing)")
        answer = Answer(**json.loads(line))
        if answer.peak > MOST_MEMORY:
            self.stop()
        return answer


def judge(answer: Answer, unchanged: set[str] | None = None) -> str | None:
    """Say what is wrong with an answer; None where nothing is.

    `unchanged` are the answers that a file with a checksum may give when it is used at all.
    """
    if answer.end in ("died", "traceback"):
        return f"{answer.end}: {answer.text}"
    if answer.peak > MOST_MEMORY:
        return f"took {answer.peak >> 20} MB ({answer.end}: {answer.text[:200]})"
    if answer.end == "refused":
        text = answer.text
        if "\n" in text or text != printable(text) or len(text) > 4100:
            return f"is no sentence: {text[:300]!r}"
    elif unchanged is not None and answer.text not in unchanged:
        return "changed without a word"
    return None


def keep(path: Path, name: str) -> None:
    """Keep a file or folder that something was found with, where that is asked for."""
    folder = os.environ.get("SCHULER_FUZZ_KEEP")
    if folder:
        there = Path(folder) / name
        there.parent.mkdir(parents=True, exist_ok=True)
        copy = shutil.copytree if path.is_dir() else shutil.copy
        copy(path, there)
