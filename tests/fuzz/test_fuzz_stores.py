"""Damaged folders of campaigns: what is used is what was stored, the rest is said or refused."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.fuzz.harness import Worker, judge, keep, mutate, scale
from tests.fuzz.stores import make_store

#: mutations of each kind of store in the short leg
SHORT = 40

#: the worker's answer for a table that is not used
NOTHING = hashlib.sha256().hexdigest()


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    with Worker() as found:
        yield found


@pytest.mark.parametrize("whole", [True, False], ids=["finished", "half-done"])
def test_damage_is_never_used(whole: bool, worker: Worker, tmp_path: Path) -> None:
    files = make_store(tmp_path / "base", whole)
    sound = worker.ask("store", tmp_path / "base").text.split()
    assert (sound[0] != NOTHING) == whole
    assert len(set(sound)) == (2 if whole else 5)
    rng = np.random.default_rng(31 + whole)
    found = []
    for trial in range(int(SHORT * scale())):
        folder = tmp_path / "hurt"
        shutil.copytree(tmp_path / "base", folder)
        there = folder / files[trial % len(files)].relative_to(tmp_path / "base")
        there.write_bytes(mutate(rng, there.read_bytes()))
        answer = worker.ask("store", folder)
        wrong = judge(answer)
        if wrong is None and answer.end == "used":
            pairs = zip(answer.text.split(), sound, strict=True)
            if any(one not in (good, NOTHING) for one, good in pairs):
                wrong = "changed without a word"
        if wrong is not None:
            found.append(f"mutation {trial} of {there.name}: {wrong}")
            keep(folder, f"store-{whole}-{trial}")
        shutil.rmtree(folder)
    assert not found, "\n".join([f"{len(found)} found", *found[:5]])
