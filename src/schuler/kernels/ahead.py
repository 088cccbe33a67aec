"""Compile kernels ahead of their first use: ``python -m schuler.kernels.ahead``.

Which kernels, and for which types of arguments, stands in `signatures.txt` with the seconds that
each took and the commands that call it. What is in the folder already is left as it is, so that a
second call costs nothing. Several processes share the work, the costliest kernels first.

``--first`` takes only what the first commands of a new user call (`FIRST`): two fifths of the
kernels, a quarter of the time. Code for a wheel (``--to FOLDER``) is compiled for every x86-64
processor with AVX2 and FMA.
"""

from __future__ import annotations

import argparse
import gc
import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from schuler.kernels._machine_code import GENERIC

__all__ = ["Entry", "compile_ahead", "compile_one", "entries", "processors", "signatures"]

Signature = tuple[str, tuple[str, ...]]


FIRST = frozenset({"align", "demo", "info"})
"""Commands that a new user begins with."""


class Entry(NamedTuple):
    """A line of the list: a kernel, its cost, and the commands that call it in their plain form."""

    seconds: float
    signature: Signature
    commands: frozenset[str]


_MOST = 8
"""Processes: the costliest kernel takes a third of the time of all."""


def entries() -> list[Entry]:
    """Return the list, the costliest kernel first."""
    text = Path(__file__).with_name("signatures.txt").read_text(encoding="utf-8")
    found = []
    for line in text.splitlines():
        if line and not line.startswith("#"):
            called, _, commands = line.partition("|")
            seconds, place, *words = called.split()
            found.append(Entry(float(seconds), (place, tuple(words)), frozenset(commands.split())))
    return sorted(found, key=lambda entry: -entry.seconds)


def signatures(first: bool = False) -> list[Signature]:
    """Return kernels as module.name with the types of their arguments, the costliest first.

    Parameters
    ----------
    first : bool
        Only those that one of `FIRST` calls in its plain form.
    """
    return [
        entry.signature for entry in entries() if not (first and FIRST.isdisjoint(entry.commands))
    ]


def compile_one(signature: Signature) -> str:
    """Compile a kernel, unless it is in the folder; return its module and name."""
    place, words = signature
    module, _, name = place.rpartition(".")
    getattr(import_module(f"schuler.kernels.{module}"), name).compile_for(words)
    return place


def compile_ahead(processes: int, first: bool = False) -> int:
    """Compile what is not in the folder of compiled kernels; return how many kernels that were.

    Parameters
    ----------
    processes : int
        To share the work.
    first : bool
        See `signatures`.
    """
    from schuler.kernels._cache import CACHE_FOLDER, has_code
    from schuler.kernels._jit import file_of

    if CACHE_FOLDER is None:
        return 0
    left = [each for each in signatures(first) if not has_code(file_of(*each))]
    if not left:
        return 0
    begin = time.monotonic()
    # Looking for garbage, of which there is none, takes a tenth of the time of Numba's import.
    with ProcessPoolExecutor(processes, get_context("spawn"), initializer=gc.disable) as pool:
        for k, place in enumerate(pool.map(compile_one, left), 1):
            if sys.stderr.isatty():
                sys.stderr.write(f"\r\x1b[Kcompiling kernels: {k} of {len(left)} ({place})")
    if sys.stderr.isatty():
        sys.stderr.write("\r\x1b[K")
    sys.stderr.write(f"compiled {len(left)} kernels in {time.monotonic() - begin:.0f} s\n")
    return len(left)


def processors() -> int:
    """Return how many processors this process may use, `_MOST` at most."""
    if hasattr(os, "sched_getaffinity"):
        return min(len(os.sched_getaffinity(0)), _MOST)
    return min(os.cpu_count() or 1, _MOST)


def main() -> None:
    """Compile ahead, as the options say."""
    parser = argparse.ArgumentParser(prog="python -m schuler.kernels.ahead", description=__doc__)
    parser.add_argument("--processes", type=int, default=processors())
    parser.add_argument("--first", action="store_true", help="what the first commands call")
    parser.add_argument("--to", type=Path, help="a folder for a wheel; any processor with AVX2")
    parser.add_argument("--serve", action="store_true", help="what standard input names")
    options = parser.parse_args()
    if options.serve:
        _serve()
    elif options.to is None:
        compile_ahead(options.processes, options.first)
    elif os.environ.get("NUMBA_CPU_NAME") == GENERIC:
        compile_ahead(options.processes, options.first)
        _collect(options.to)
    else:
        # The processor is read when the first kernel is imported: begin again, for another one.
        with TemporaryDirectory() as folder:
            told = {"NUMBA_CPU_NAME": GENERIC, "NUMBA_CPU_FEATURES": "",
                    "SCHULER_CACHE_DIR": folder}  # fmt: skip
            again = [sys.executable, "-m", "schuler.kernels.ahead", *sys.argv[1:]]
            sys.exit(subprocess.run(again, env={**os.environ, **told}, check=False).returncode)


def _serve() -> None:
    """Compile one kernel for each line of standard input, and answer with its name."""
    # The process that asked ends this one; Ctrl-C is for it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.disable()
    for line in sys.stdin:
        place, *words = line.split()
        sys.stdout.write(compile_one((place, tuple(words))) + "\n")
        sys.stdout.flush()


def _collect(folder: Path) -> None:
    """Copy the machine code that was compiled into a folder, and say of what sources it is."""
    from schuler.kernels._cache import CACHE_FOLDER, read_code, sources_digest

    assert CACHE_FOLDER is not None
    folder.mkdir(parents=True, exist_ok=True)
    for file in Path(CACHE_FOLDER).glob("*.kernel"):
        kept = read_code(file.name)
        if kept is not None and kept[1]:
            shutil.copy(file, folder / file.name)
    (folder / "sources").write_text(sources_digest(), encoding="ascii")


if __name__ == "__main__":
    main()
