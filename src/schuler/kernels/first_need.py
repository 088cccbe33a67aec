"""Compile on all cores what a command is going to call, once the first of it has to be compiled.

A kernel that is in no folder is compiled when it is called; others of the same command would be
compiled after it, one by one. `compile_together` has the list of kernels by command
(`schuler.kernels.ahead`) and shares what is missing between this process and others.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Lock, Thread
from typing import Any

__all__ = ["compile_together", "tell"]

Signature = tuple[str, tuple[str, ...]]

ENOUGH = 2.0
"""Seconds of compilation, as the list has them, that are shared: another process costs one."""

COSTLY = 1.0
"""Seconds of a kernel that says what a program is about to do."""


def _to_nobody(text: str) -> None:
    """Take what nobody is to read."""


_command: str | None = None
_say: Callable[[str], None] = _to_nobody


def tell(command: str | None, say: Callable[[str], None]) -> None:
    """Say which command runs, and how a person is told what takes some seconds.

    Parameters
    ----------
    command : str or None
        None where it is not known: then the one that needs least of those that call a costly kernel
        is taken for it. Cheap kernels serve many purposes.
    say : callable
        Takes one sentence.
    """
    global _command, _say
    _command, _say = command, say


def compile_together(place: str, words: tuple[str, ...]) -> None:
    """Compile a kernel with all that a command calls beside it, where that is worth it.

    Parameters
    ----------
    place : str
        module.name of the kernel, which is not compiled.
    words : tuple of str
        Types of its arguments.
    """
    from schuler.kernels._cache import CACHE_FOLDER
    from schuler.kernels.ahead import processors

    others = processors() - 1
    if CACHE_FOLDER is None or others < 1 or _is_worker():
        return
    missing = _missing(place, words)
    if sum(seconds for seconds, _ in missing) < ENOUGH:
        return
    todo = [signature for _, signature in missing]
    _say(f"compiling {len(todo)} kernels for their first use, which takes some seconds")
    _share(todo, min(others, len(todo) - 1))


def _is_worker() -> bool:
    """Say whether this is one of several processes that share the cores already."""
    if "multiprocessing" not in sys.modules:
        return False
    from multiprocessing import parent_process

    return parent_process() is not None


def _missing(place: str, words: tuple[str, ...]) -> list[tuple[float, Signature]]:
    """Return what is not compiled of the command that calls a kernel, the costliest first."""
    from schuler.kernels._cache import has_code
    from schuler.kernels._jit import file_of
    from schuler.kernels.ahead import entries

    listed = entries()
    own = next((entry for entry in listed if entry.signature == (place, words)), None)
    if own is None or not (_command in own.commands or own.seconds >= COSTLY):
        return []
    ways = [_command] if _command in own.commands else sorted(own.commands)
    there = {e.signature: has_code(file_of(*e.signature)) for e in listed if e.commands}
    missing = [
        [(e.seconds, e.signature) for e in listed if way in e.commands and not there[e.signature]]
        for way in ways
    ]
    return min(missing, key=lambda each: sum(seconds for seconds, _ in each), default=[])


def _share(todo: list[Signature], others: int) -> None:
    """Compile kernels in this process and others, each the next one of the list."""
    from schuler.kernels.ahead import compile_one

    lock = Lock()
    left = iter(todo)

    def following() -> Signature | None:
        with lock:
            return next(left, None)

    workers = [worker for _ in range(others) if (worker := _worker()) is not None]
    threads = [Thread(target=_serve, args=(worker, following), daemon=True) for worker in workers]
    try:
        for thread in threads:
            thread.start()
        while (signature := following()) is not None:
            compile_one(signature)
        for thread in threads:
            thread.join()
    finally:
        for worker in workers:
            worker.kill()
            worker.wait()
            for pipe in (worker.stdin, worker.stdout):
                with suppress(OSError):
                    pipe.close()


def _worker() -> Any:
    """Return a process that compiles what it is told (`schuler.kernels.ahead`), or None."""
    import subprocess

    if not sys.executable or getattr(sys, "frozen", False):
        # A program that Python is built into is no interpreter.
        return None
    here = str(Path(__file__).parents[2])
    paths = os.pathsep.join([here, *filter(None, [os.environ.get("PYTHONPATH")])])
    try:
        return subprocess.Popen(
            # The folder that the user stands in is none to import from.
            [sys.executable, "-P", "-m", "schuler.kernels.ahead", "--serve"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": paths}, text=True,
        )  # fmt: skip
    except OSError:
        return None


def _serve(worker: Any, following: Callable[[], Signature | None]) -> None:
    """Give a process one kernel after the other.

    What it could not compile is in no folder, and is compiled here when it is called.
    """
    try:
        while (signature := following()) is not None:
            place, words = signature
            worker.stdin.write(" ".join([place, *words]) + "\n")
            worker.stdin.flush()
            if not worker.stdout.readline():
                return
    except OSError:
        return
