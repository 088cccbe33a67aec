"""Damaged files of every format: a record or one sentence, in bounded time and memory."""

from __future__ import annotations

import shutil
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from schuler.io import readers
from schuler.io.gnss import aid_reader, gnss_readers
from tests.fuzz.bases import BASES, FOLDERS, asked
from tests.fuzz.harness import Worker, judge, keep, mutate, scale

#: mutations of each base in the short leg
SHORT = 24


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    pytest.importorskip("rosbags")
    pytest.importorskip("pyulog")
    pytest.importorskip("pynmeagps")
    pytest.importorskip("pyubx2")
    with Worker() as found:
        yield found


def test_every_reader_is_here(tmp_path: Path) -> None:
    from schuler.io.registry import find_reader

    found = set()
    for name, (work, make, options, _) in BASES.items():
        if work == "record" and not name.startswith((FOLDERS, "csv-gzip", "sidecar")):
            (tmp_path / name).mkdir()
            path = make(tmp_path / name)
            head = path.read_bytes()[:65536]
            found.add(find_reader(path, head, options.get("format")).name)
    assert found == set(readers())


def test_every_reader_of_fixes_is_here(tmp_path: Path) -> None:
    found = set()
    for name, (work, make, _, _) in BASES.items():
        if work == "gnss" and name != "gnss-gzip":
            (tmp_path / name).mkdir()
            reader = aid_reader(make(tmp_path / name))
            assert reader is not None
            found.add(reader.name)
    assert found == set(gnss_readers())


@pytest.mark.parametrize("name", BASES)
def test_damage_is_refused_or_survived(name: str, worker: Worker, tmp_path: Path) -> None:
    work, make, options, sealed = BASES[name]
    (tmp_path / "base").mkdir()
    base = make(tmp_path / "base")
    whole = base.read_bytes()
    sound = worker.ask(work, asked(name, base), options)
    assert sound.end == "used", sound.text
    unchanged = {sound.text} if sealed else None
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    path = tmp_path / "hurt" / base.name
    shutil.copytree(base.parent, path.parent)
    found = []
    for trial in range(int(SHORT * scale())):
        path.write_bytes(mutate(rng, whole))
        wrong = judge(worker.ask(work, asked(name, path), options), unchanged)
        if wrong is not None:
            found.append(f"{name}, mutation {trial}: {wrong}")
            keep(path, f"{name}-{trial}-{path.name}")
    assert not found, "\n".join([f"{len(found)} found", *found[:5]])
