"""What a campaign's folder holds is verified before it is used; made-up numbers, no simulation."""

from __future__ import annotations

import json
import os
import struct
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet
import pytest

from schuler import InputError
from schuler.campaigns.chunk import schema
from schuler.campaigns.store import Store
from schuler.io.sealed import read_sealed, write_sealed
from tests.fuzz.stores import campaign, made_up, make_store


def reseal(path: Path, change, **about: str) -> None:
    """Write a table anew with a right seal, as a forger would."""
    table, old, _ = read_sealed(path)
    kept = {key.decode(): value.decode() for key, value in old.items()}
    write_sealed(change(table.replace_schema_metadata(None)), path, {**kept, **about})


def replaced(name: str, value):
    def change(table):
        at = table.column_names.index(name)
        column = pa.array([value] * len(table), table.schema.types[at])
        return table.set_column(at, name, column)

    return change


def test_a_damaged_part_is_said_and_not_used(tmp_path: Path) -> None:
    files = [f for f in make_store(tmp_path, False) if f.suffix == ".parquet"]
    store = Store(campaign(), tmp_path)
    chunks = {store._part(chunk): chunk for chunk in store.campaign.chunks()}
    assert all(store.load(chunks[file]) is not None for file in files)
    value = struct.pack("<d", store.load(chunks[files[0]]).column("nees")[3].as_py())
    data = bytearray(files[0].read_bytes())
    # Values that look like chance are stored as they are.
    data[data.index(value)] ^= 1
    files[0].write_bytes(data)
    assert store.load(chunks[files[0]]) is None
    (note,) = store.notes
    assert note.startswith(f"{files[0]}: is ")
    assert note.endswith("its runs are computed again")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (replaced("sigma_up", -1.0), "values of sigma_up that cannot be"),
        (replaced("heading_error", 4.0), "values of heading_error that cannot be"),
        (replaced("warnings", -1), "values of warnings that cannot be"),
        (replaced("run", 0), "other runs than its campaign"),
        (replaced("method", "wahba"), "other runs than its campaign"),
        (lambda t: t.slice(1), "has 7 rows, expected 8"),
        (lambda t: t.drop_columns(["nees"]), "has no column nees"),
        (lambda t: t.append_column("more", t.column("nees")), "other columns than runs have"),
    ],
)  # fmt: skip
def test_a_forged_part_is_said_and_not_used(tmp_path: Path, change, words: str) -> None:
    store = Store(campaign(), tmp_path)
    with store.held():
        chunk = next(store.campaign.chunks())
        store.save(chunk, made_up(chunk))
        assert store.load(chunk) is not None
        reseal(store._part(chunk), change)
        assert store.load(chunk) is None
    assert words in store.notes[0]


def test_damaged_results_are_said_and_those_of_others_stay(tmp_path: Path) -> None:
    make_store(tmp_path, True)
    store = Store(campaign(), tmp_path)
    assert len(store.finished()) == campaign().rows
    whole = store.results.read_bytes()
    store.results.write_bytes(whole[:-9])
    assert store.finished() is None
    assert "what is missing is computed again" in store.notes[0]
    store.results.write_bytes(whole)
    reseal(store.results, lambda t: t, **{"schuler.campaigns": "0" * 64})
    with pytest.raises(InputError, match=r"results\.parquet: is of another campaign; remove it"):
        store.finished()
    pa.parquet.write_table(pa.table({"x": [1.0]}), store.results)
    with pytest.raises(InputError, match=r"has 1 rows, expected 48; remove it, or name another"):
        store.finished()


def test_a_folder_that_is_no_store_is_one_sentence(tmp_path: Path) -> None:
    make_store(tmp_path, False)
    store = Store(campaign(), tmp_path)
    for text in ("[" * 100_000, "9" * 6000, '{"runs": %s}' % ("[" * 50_000), "\x00", "3"):
        store.manifest.write_text(text)
        with pytest.raises(InputError, match=r"campaign\.json: cannot be read"), store.held():
            pass
    store.manifest.write_text(json.dumps({"runs": "\x1b[31m"}))
    with pytest.raises(InputError, match="has another campaign in it"), store.held():
        pass
    if hasattr(os, "mkfifo"):
        store.manifest.unlink()
        os.mkfifo(store.manifest)
        with pytest.raises(InputError, match="is not an ordinary file"), store.held():
            pass


def test_the_columns_of_a_made_up_chunk_are_those_of_runs() -> None:
    chunk = next(campaign().chunks())
    with pa.ipc.open_stream(made_up(chunk)) as stream:
        assert stream.read_all().schema == schema()
