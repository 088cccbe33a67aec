"""Who works on chunks: this process, a pool of processes, or a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from itertools import chain, islice
from typing import Any

from schuler._processes import ONE_THREAD, cores, worker_pool
from schuler.campaigns.chunk import Chunk, run_chunk
from schuler.errors import InputError, SchulerError, installed

__all__ = ["cluster_executor", "execute", "local_cluster"]

_DEATHS = 5
"""So many chunks in a row may lose their worker before it is the campaign's fault."""

_STARTS = 4
"""So often a local cluster is started before it is given up."""

#: an executor, and how many chunks it should have at hand
Workers = AbstractContextManager[tuple[Executor, int]]


def execute(
    chunks: Iterator[Chunk], workers: int | None, scheduler: str | None
) -> Iterator[tuple[Chunk, bytes]]:
    """Work on chunks; give each with its result as it is finished, in any order.

    Parameters
    ----------
    chunks : iterator of Chunk
    workers : int or None
        None: a pool of as many processes as there are cores; 0: this process; else so many
        workers of a local Dask cluster.
    scheduler : str or None
        Address of a Dask scheduler.

    Raises
    ------
    InputError
        If the scheduler cannot be reached, or a run cannot be aligned.
    SchulerError
        If Dask is missing, or workers die again and again.
    """
    if workers == 0 and scheduler is None:
        for chunk in chunks:
            yield chunk, run_chunk(chunk)
        return
    first = next(chunks, None)
    if first is None:
        # Nothing is left to do: no workers are needed.
        return
    waiting = chain([first], chunks)
    if scheduler is None and workers is None:
        yield from _through(waiting, _pool)
    else:
        yield from _through(waiting, lambda: _dask(workers, scheduler))


def _through(
    chunks: Iterator[Chunk], start: Callable[[], Workers]
) -> Iterator[tuple[Chunk, bytes]]:
    """Keep an executor busy; start a new one where it breaks."""
    lost: list[Chunk] = []
    deaths = 0
    while True:
        open_: dict[Future[bytes], Chunk] = {}
        broken = False
        with start() as (executor, width):
            while not broken:
                source = chain(iter(lost), chunks)
                fresh = list(islice(source, max(0, width - len(open_))))
                lost = lost[len(fresh) :]
                for k, chunk in enumerate(fresh):
                    try:
                        open_[executor.submit(run_chunk, chunk)] = chunk
                    except BrokenProcessPool:
                        lost, broken = [*fresh[k:], *lost], True
                        break
                if not open_:
                    break
                done, _ = wait(open_, return_when=FIRST_COMPLETED)
                for future in done:
                    chunk = open_.pop(future)
                    try:
                        result = future.result()
                    except SchulerError:
                        raise
                    except Exception as error:
                        if not _died(error):
                            raise
                        lost.append(chunk)
                        deaths += 1
                        broken |= isinstance(error, BrokenProcessPool)
                        continue
                    deaths = 0
                    yield chunk, result
            lost += open_.values()
        if deaths > _DEATHS + len(open_) + width:
            raise SchulerError(
                "worker processes die again and again; is there memory enough for a record "
                "in each? Take fewer --workers"
            )
        if not broken:
            return


def _died(error: BaseException) -> bool:
    """Say whether an error means that a worker is gone, and not that its work is bad."""
    return isinstance(error, BrokenProcessPool) or type(error).__name__ in (
        "KilledWorker", "FutureCancelledError", "CancelledError",
    )  # fmt: skip


@contextmanager
def _pool() -> Iterator[tuple[Executor, int]]:
    count = cores()
    pool = worker_pool(count)
    try:
        yield pool, 3 * count
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _dask(workers: int | None, scheduler: str | None) -> Iterator[tuple[Executor, int]]:
    with installed("--workers and --scheduler need Dask", "campaign"):
        import dask
        from distributed import Client
    settings: dict[str, Any] = {
        # A killed worker is no reason to give its chunk up; `_through` counts in the end.
        "distributed.scheduler.allowed-failures": 20,
        # In the place of Dask's own, which hand memory back after every run only to fetch it anew:
        # a third more time.
        "distributed.nanny.pre-spawn-environ": dict(ONE_THREAD),
        "distributed.admin.large-graph-warning-threshold": "1GB",
        "distributed.logging": {"distributed": "critical"},
    }
    with dask.config.set(settings):
        if scheduler is None:
            with (
                local_cluster(workers or 1) as cluster,
                Client(cluster, set_as_default=False) as client,
                client.get_executor(pure=False) as executor,
            ):
                yield executor, 3 * (workers or 1)
            return
        try:
            client = Client(scheduler, timeout="10s", set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(
                f"--scheduler {scheduler}: cannot be reached ({str(error).splitlines()[0]})"
            ) from None
        with client, client.get_executor(pure=False) as executor:
            yield executor, max(16, 3 * sum(client.nthreads().values()))


@contextmanager
def cluster_executor(scheduler: str) -> Iterator[Executor]:
    """Give an executor on a Dask cluster that is there already.

    Raises
    ------
    InputError
        If the scheduler cannot be reached.
    SchulerError
        If Dask is missing.
    """
    with _dask(None, scheduler) as (executor, _):
        yield executor


def local_cluster(workers: int, **settings: Any) -> Any:
    """Return a Dask cluster on this machine; one whose worker fails at the start is started again.

    Parameters
    ----------
    workers : int
        Processes of one thread each.
    **settings
        Of `distributed.LocalCluster`, in the place of those that are set here.

    Raises
    ------
    SchulerError
        If it cannot be started.
    """
    from distributed import LocalCluster

    settings = {
        "n_workers": workers, "threads_per_worker": 1, "processes": True, "host": "127.0.0.1",
        "dashboard_address": None, "silence_logs": 50,
        # Without a dashboard there is still a port for the state of health: a free one, as the
        # usual one may be taken.
        "scheduler_kwargs": {"dashboard_address": "127.0.0.1:0"},
        **settings,
    }  # fmt: skip
    if settings["processes"]:
        settings.setdefault("env", dict(ONE_THREAD))
    for attempt in range(1, _STARTS + 1):
        try:
            return LocalCluster(**settings)
        except RuntimeError as error:
            if attempt == _STARTS:
                raise SchulerError(
                    f"a local cluster of {workers} worker(s) cannot be started ({error}); try "
                    "--workers 0, or leave --workers out"
                ) from None
    raise AssertionError
