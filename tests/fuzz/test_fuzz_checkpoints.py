"""Checkpoints that were damaged or crafted: each is refused in a sentence, or loads and is right.

SCHULER_FUZZ_SCALE multiplies the number of cases.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter

import pytest

from tests.conftest import ROOT

SCALE = int(os.environ.get("SCHULER_FUZZ_SCALE", "1"))
CASES, BATCH = 500 * SCALE, 500


@pytest.mark.compiled
@pytest.mark.parametrize("first", range(0, CASES, BATCH))
def test_no_checkpoint_crashes_or_misleads(tmp_path, first):
    last = min(first + BATCH, CASES)
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "tests.fuzz.checkpoint_worker", str(tmp_path),
         str(first), str(last)], capture_output=True, text=True, cwd=ROOT, timeout=600,
    )  # fmt: skip
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0, f"case {lines[-1:]} ended it: {done.stderr[-2000:]}"
    ends = {line["case"]: line["end"] for line in lines if "end" in line}
    assert len(ends) == last - first
    faults = {case: end for case, end in ends.items() if end.startswith(("fault", "wrong"))}
    assert not faults
    # Neither is all refused, nor does all pass.
    kinds = Counter(end.split(":")[0] for end in ends.values())
    assert kinds["refused"] > 0.8 * len(ends)
    assert kinds["right"] > 0
    assert kinds["refused late"] == 0
