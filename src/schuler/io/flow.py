"""Blocks made one ahead, records joined without being held twice, pipes asked before a read."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import IO

import numpy as np

from schuler.errors import InputError
from schuler.io.content import Array, Block
from schuler.io.limits import ROW_BYTES, available_memory
from schuler.record import ImuRecord, Quality

__all__ = ["Whole", "pieces", "prefetch", "readable"]

_FEW = 64
"""Samples that are no piece of their own."""


class Whole:
    """Joins records into arrays of about the right size, so that nothing is held twice."""

    def __init__(self) -> None:
        self.first: ImuRecord | None = None
        self._n = 0
        self._arrays: list[Array] = []
        self._row_bytes = ROW_BYTES

    def add(self, part: ImuRecord, progress: float) -> None:
        """Take the next record, after which this fraction of all has been read (0 unknown)."""
        n = self._n + len(part)
        if self.first is None:
            self.first = part
            self._arrays = [np.empty(0), np.empty(0), np.empty((0, 3)), np.empty((0, 3))]
            if part.values is not None:
                # One row more: the values at the start of the first sample.
                self._arrays.append(part.values[:1].copy())
                self._row_bytes += 8 * part.values.shape[1]
        if n > len(self._arrays[0]):
            # What is never touched takes no memory, so the guess may be generous.
            guess = int(n / progress * 1.05) if 0.0 < progress < 1.0 else n
            # A damaged count must not ask for more than there is.
            guess = min(guess, available_memory() // self._row_bytes)
            capacity = max(n, guess if self._n == 0 else n + n // 2)
            if n * self._row_bytes > available_memory():
                raise InputError(
                    f"its {n} rows and more do not fit into memory; take a part with --start and "
                    "--stop"
                )
            for i, old in enumerate(self._arrays):
                more = i // 4
                self._arrays[i] = np.empty((capacity + more, *old.shape[1:]))
                self._arrays[i][: self._n + more] = old[: self._n + more]
        sources = [part.time, part.dt, part.dtheta, part.dvel]
        if len(self._arrays) > 4:
            assert part.values is not None
            sources.append(part.values[1:])
        for i, piece in enumerate(sources):
            self._arrays[i][self._n + i // 4 : n + i // 4] = piece
        self._n = n

    def record(self, quality: Quality | None) -> ImuRecord:
        """Return all that was taken."""
        assert self.first is not None
        time, dt, dtheta, dvel = (array[: self._n] for array in self._arrays[:4])
        whole = replace(self.first, time=time, dt=dt, dtheta=dtheta, dvel=dvel, quality=quality)
        return whole.with_values(self._arrays[4][: self._n + 1] if len(self._arrays) > 4 else None)


def prefetch(blocks: Iterator[Block]) -> Iterator[Block]:
    """Yield the same blocks while a thread makes the next one, and only that one."""
    ready: queue.SimpleQueue[tuple[Block | None, BaseException | None]] = queue.SimpleQueue()
    wanted = threading.Semaphore(1)
    closed = threading.Event()

    def work() -> None:
        """Read the next block whenever one is wanted."""
        try:
            while wanted.acquire() and not closed.is_set():
                block = next(blocks, None)
                ready.put((block, None))
                if block is None:
                    return
                del block
        except BaseException as error:
            ready.put((None, error))

    thread = threading.Thread(target=work, name="schuler-read", daemon=True)
    thread.start()
    try:
        while True:
            block, error = ready.get()
            if error is not None:
                raise error
            if block is None:
                return
            wanted.release()
            yield block
    finally:
        closed.set()
        wanted.release()
        thread.join()
        close = getattr(blocks, "close", None)
        if close is not None:
            close()


def pieces(records: Iterable[ImuRecord], size: int) -> Iterator[ImuRecord]:
    """Yield records cut to at most `size` samples, without pieces of a few at an end.

    The last rows of a file, which wait for none to follow, so belong to the piece before them.
    """
    held: ImuRecord | None = None
    for record in records:
        for piece in record.chunks(size):
            if held is None:
                held = piece
            elif len(piece) <= _FEW and len(held) + len(piece) <= size:
                held = ImuRecord.concatenate([held, piece])
            else:
                yield held
                held = piece
    if held is not None:
        yield held


def readable(file: IO[bytes], seconds: float) -> bool:
    """Say whether a pipe has something to read, or has ended, within so many seconds.

    True where the system cannot tell: the read itself will wait then.
    """
    import math
    import select

    try:
        found = select.select([file], [], [], seconds if math.isfinite(seconds) else None)[0]
    except (OSError, ValueError, TypeError):
        return True
    return bool(found)
