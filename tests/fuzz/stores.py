"""A campaign's folder with made-up numbers, to be damaged."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from schuler.campaigns import Campaign
from schuler.campaigns.chunk import NUMBERS, Chunk, schema
from schuler.campaigns.store import Store
from schuler.config import parse_scenario

SCENE = {
    "duration": "20 s", "rate": "20 Hz", "seed": 9, "instrument": "navigation-fog",
    "site": {"lat": 40.0}, "motion": {"kind": "vehicle", "heading": 30},
    "align": {"method": ["centred", "analytic"]},
}  # fmt: skip


def campaign() -> Campaign:
    return Campaign(parse_scenario(SCENE), 12, {"motion.heading": (30.0, 60.0)}, chunk=4)


def made_up(chunk: Chunk) -> bytes:
    """Return rows of a chunk as `run_chunk` would, without simulating."""
    import pyarrow as pa

    rng = np.random.default_rng(chunk.number)
    runs = range(chunk.first, chunk.first + chunk.count)
    rows: list[dict[str, Any]] = [
        {"point": chunk.point, "run": run, "method": method, "warnings": 0,
         **{name: float(rng.random()) for name in NUMBERS}}
        for run in runs
        for method in chunk.methods
    ]  # fmt: skip
    table = pa.Table.from_pylist(rows, schema=schema())
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema) as writer:
        writer.write_table(table)
    return bytes(sink.getvalue().to_pybytes())


def make_store(folder: Path, whole: bool) -> list[Path]:
    """Make a store, finished or half done; return the files that may be damaged."""
    store = Store(campaign(), folder)
    with store.held():
        for chunk in store.campaign.chunks():
            if whole or chunk.number % 3:
                store.save(chunk, made_up(chunk))
        if whole:
            store.assemble()
    return [path for path in sorted(folder.rglob("*")) if path.is_file() and path.stat().st_size]
