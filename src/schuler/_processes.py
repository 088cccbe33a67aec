"""Work on several processes. What a worker imports first is here, so that it is little."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

__all__ = ["ONE_THREAD", "cores", "each", "start", "worker_pool"]

T = TypeVar("T")

#: jobs are independent: more threads inside one only get in the way of the others
ONE_THREAD = dict.fromkeys(
    ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"
)


def cores() -> int:
    """Return how many processor cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def start() -> None:
    """Take one thread, leave Ctrl-C to the driver, and end when the driver does."""
    from multiprocessing import parent_process

    os.environ.update(ONE_THREAD)
    if "numpy" in sys.modules:
        # The driver's main module has loaded it here: the environment comes too late.
        from threadpoolctl import threadpool_limits

        threadpool_limits(1, user_api="blas")
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    driver = parent_process()

    def watch() -> None:
        if driver is not None:
            driver.join()
            # A driver that was killed has closed nothing: its workers would wait for ever.
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def worker_pool(count: int) -> ProcessPoolExecutor:
    """Return a pool of worker processes, which `start` has prepared."""
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    # Forked processes would inherit locks of the threads that Arrow has started.
    return ProcessPoolExecutor(count, mp_context=get_context("spawn"), initializer=start)


def each(function: Callable[..., T], jobs: Iterable[tuple[Any, ...]], workers: int) -> Iterator[T]:
    """Give what a function makes of each job, in their order; on processes where there are many.

    Parameters
    ----------
    function : callable
        At the top of a module, so that a process can find it.
    jobs : iterable of tuple
        Arguments.
    workers : int
        Processes; this one alone where there is one, or one job.

    Examples
    --------
    >>> from schuler._processes import each
    >>> list(each(pow, [(2, 3), (3, 2)], workers=1))
    [8, 9]
    """
    todo = list(jobs)
    workers = min(workers, len(todo))
    if workers <= 1:
        for job in todo:
            yield function(*job)
        return
    pool = worker_pool(workers)
    try:
        for future in [pool.submit(function, *job) for job in todo]:
            yield future.result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
