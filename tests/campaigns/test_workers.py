"""Whoever works, and whoever is killed on the way: the same bytes."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import time

import psutil
import pytest

from schuler import campaigns
from schuler.campaigns import Campaign
from schuler.errors import InputError

from .conftest import digest, start

pytestmark = pytest.mark.slow

RUNS = ("--runs", "48")


@pytest.fixture(scope="module")
def undisturbed(scene_file, tmp_path_factory):
    """Return the digest of an undisturbed campaign in one process, with code from the cache."""
    out = tmp_path_factory.mktemp("undisturbed") / "out"
    finish(start(scene_file, out, *RUNS, "--workers", "0"))
    return digest(out / "results.parquet")


def finish(process):
    out, err = process.communicate(timeout=240)
    assert process.returncode == 0, err
    return out


def parts(folder):
    return len(list((folder / "parts").glob("part-*.parquet"))) if folder.exists() else 0


def descendants(process):
    try:
        return psutil.Process(process.pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return []


def wait_for(condition, seconds=90.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.005)


@pytest.mark.long
@pytest.mark.parametrize("workers", [(), ("--workers", "2"), ("--workers", "1")], ids=str)
def test_any_number_of_workers_gives_the_same_bytes(scene_file, undisturbed, tmp_path, workers):
    finish(start(scene_file, tmp_path / "out", *RUNS, *workers))
    assert digest(tmp_path / "out" / "results.parquet") == undisturbed


def test_a_scheduler_elsewhere_gives_the_same_bytes(scene_file, undisturbed, tmp_path):
    from schuler.campaigns.execute import local_cluster

    with local_cluster(2) as cluster:
        address = cluster.scheduler_address
        finish(start(scene_file, tmp_path / "out", *RUNS, "--scheduler", address))
    assert digest(tmp_path / "out" / "results.parquet") == undisturbed


def test_a_cluster_takes_no_port_that_another_program_may_hold():
    from schuler.campaigns.execute import local_cluster

    with socket.socket() as holder:
        with contextlib.suppress(OSError):  # held already: as well
            holder.bind(("", 8787))
            holder.listen()
        # A library's warning would be an error here.
        with local_cluster(1, processes=False, protocol="tcp") as cluster:
            assert cluster.scheduler.http_server.port != 8787


@pytest.mark.parametrize(
    "workers", [("--workers", "0"), pytest.param((), marks=pytest.mark.long)], ids=str
)
def test_a_driver_killed_three_times_goes_on(scene_file, undisturbed, tmp_path, workers):
    out = tmp_path / "out"
    # Long enough that a kill comes in between: 48 runs in three chunks, one part after the other.
    for count in (1, 2, 2):
        process = start(scene_file, out, *RUNS, *workers)
        wait_for(lambda count=count, p=process: parts(out) >= count or p.poll() is not None)
        below = descendants(process)
        if process.poll() is None:
            os.kill(process.pid, signal.SIGKILL)
        process.communicate(timeout=300)
        # Nobody works on for a driver that is gone.
        _, alive = psutil.wait_procs(below, timeout=30)
        assert not alive
    finish(start(scene_file, out, *RUNS, *workers))
    assert digest(out / "results.parquet") == undisturbed


@pytest.mark.parametrize("workers", [("--workers", "2")], ids=str)
def test_killed_workers_are_replaced(scene_file, undisturbed, tmp_path, workers):
    out = tmp_path / "out"
    process = start(scene_file, out, *RUNS, *workers)
    killed = 0
    for _ in range(3):
        # A worker, and not the watchers that Python starts beside it.
        def busy():
            found = []
            for child in descendants(process):
                try:
                    line = " ".join(child.cmdline())
                    if "spawn_main" in line and child.cpu_times().user > 0.3:
                        found.append(child)
                except psutil.Error:
                    pass
            return found

        wait_for(lambda: busy() or process.poll() is not None)
        if process.poll() is not None:
            break
        try:
            os.kill(busy()[0].pid, signal.SIGKILL)
            killed += 1
        except (IndexError, ProcessLookupError):
            continue
    finish(process)
    assert killed
    assert digest(out / "results.parquet") == undisturbed


def test_a_scheduler_that_is_not_there(scene, tmp_path):
    with pytest.raises(InputError, match="cannot be reached"):
        campaigns.campaign(Campaign(scene, 1), tmp_path, scheduler="tcp://127.0.0.1:9")


@pytest.mark.parametrize(
    ("workers", "scheduler", "words"),
    [(-1, None, "0 or more"), (2, "tcp://127.0.0.1:9", "give one of them")],
)
def test_workers_that_make_no_sense(scene, tmp_path, workers, scheduler, words):
    with pytest.raises(InputError, match=words):
        campaigns.campaign(Campaign(scene, 1), tmp_path, workers=workers, scheduler=scheduler)
