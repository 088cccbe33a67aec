"""Compile kernels ahead of their first use: ``python -m schuler.kernels.ahead``.

Which kernels, and for which types of arguments, stands in `signatures.txt` with the seconds that
each took and the commands that call it. What is in the folder already is left as it is, so that a
second call costs nothing. Several processes share the work, the costliest kernels first.

``--first`` takes only what the first commands of a new user call: half of the kernels, a quarter
of the time. Code for a wheel (``--to FOLDER``) is compiled for every x86-64 processor with AVX2 and
FMA.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

from schuler.kernels._machine_code import GENERIC

__all__ = ["compile_ahead", "signatures"]

Signature = tuple[str, tuple[str, ...]]

_MOST = 8
"""Processes: the costliest kernel takes a third of the time of all."""


def signatures(first: bool = False) -> list[Signature]:
    """Return kernels as module.name with the types of their arguments, the costliest first.

    Parameters
    ----------
    first : bool
        Only those that a command calls in its plain form.
    """
    text = Path(__file__).with_name("signatures.txt").read_text(encoding="utf-8")
    lines = []
    for line in text.splitlines():
        called, _, commands = line.partition("|")
        if called and not called.startswith("#") and (commands.strip() or not first):
            lines.append(called.split())
    lines.sort(key=lambda words: -float(words[0]))
    return [(words[1], tuple(words[2:])) for words in lines]


def _compile(signature: Signature) -> str:
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
    from schuler.kernels._cache import CACHE_FOLDER
    from schuler.kernels._jit import file_of

    if CACHE_FOLDER is None:
        return 0
    left = [
        (place, words)
        for place, words in signatures(first)
        if not (Path(CACHE_FOLDER) / file_of(place, words)).is_file()
    ]
    if not left:
        return 0
    begin = time.monotonic()
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        for k, place in enumerate(pool.map(_compile, left), 1):
            if sys.stderr.isatty():
                sys.stderr.write(f"\r\x1b[Kcompiling kernels: {k} of {len(left)} ({place})")
    if sys.stderr.isatty():
        sys.stderr.write("\r\x1b[K")
    sys.stderr.write(f"compiled {len(left)} kernels in {time.monotonic() - begin:.0f} s\n")
    return len(left)


def _processors() -> int:
    """Return how many processors this process may use, `_MOST` at most."""
    if hasattr(os, "sched_getaffinity"):
        return min(len(os.sched_getaffinity(0)), _MOST)
    return min(os.cpu_count() or 1, _MOST)


def main() -> None:
    """Compile ahead, as the options say."""
    parser = argparse.ArgumentParser(prog="python -m schuler.kernels.ahead", description=__doc__)
    parser.add_argument("--processes", type=int, default=_processors())
    parser.add_argument("--first", action="store_true", help="what the first commands call")
    parser.add_argument("--to", type=Path, help="a folder for a wheel; any processor with AVX2")
    options = parser.parse_args()
    if options.to is None:
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
