"""The folder of a campaign: its manifest, a part for each finished chunk, and the results.

Parts appear whole or not at all and are named by their chunk; a part that cannot be read, or is of
another campaign, counts as not done. The results are put together in the order of the runs, with
fixed settings of the writer: their bytes do not tell what happened on the way.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from schuler._files import replacing
from schuler.campaign.chunk import Chunk, schema
from schuler.campaign.plan import Campaign
from schuler.errors import InputError

__all__ = ["Store"]


class Store:
    """The folder of one campaign.

    Parameters
    ----------
    campaign : Campaign
    folder : str or Path
        Made where it is missing.
    """

    def __init__(self, campaign: Campaign, folder: str | Path) -> None:
        self.campaign = campaign
        self.folder = Path(folder)
        self.parts = self.folder / "parts"
        self.manifest = self.folder / "campaign.json"
        self.results = self.folder / "results.parquet"

    def files(self) -> list[Path]:
        """Return the files that the store keeps or would keep; no output may be one of them."""
        parts = sorted(self.parts.glob("part-*.parquet"))
        return [self.manifest, self.results, self.folder / ".lock", *parts]

    @contextmanager
    def held(self) -> Iterator[None]:
        """Keep other processes out; the lock goes with the process, however that ends.

        Raises
        ------
        InputError
            If the folder cannot be made, is in use, or has another campaign in it.
        """
        try:
            self.parts.mkdir(parents=True, exist_ok=True)
            lock = (self.folder / ".lock").open("w")
        except OSError as error:
            raise InputError(f"{self.folder}: cannot be made ({error.strerror})") from None
        with lock:
            with suppress(ImportError):
                import fcntl

                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except OSError:
                    raise InputError(
                        f"{self.folder}: a campaign is running in this folder; wait for it or "
                        "name another --out"
                    ) from None
            self._claim()
            yield

    def _claim(self) -> None:
        """Write the manifest, or compare it with the one that is there."""
        text = json.dumps(self.campaign.manifest, indent=2, ensure_ascii=False) + "\n"
        if not self.manifest.exists():
            if self.results.exists() or any(self.parts.iterdir()):
                raise InputError(
                    f"{self.folder}: has results in it but no campaign.json that says of what; "
                    "name another --out or empty the folder"
                )
            with replacing(self.manifest) as temporary:
                temporary.write_text(text, encoding="utf-8")
        try:
            found = json.loads(self.manifest.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            found = None
        if not isinstance(found, dict):
            raise InputError(
                f"{self.manifest}: cannot be read; name another --out or empty the folder"
            )
        if found != json.loads(text):
            raise InputError(
                f"{self.folder}: has another campaign in it ({_difference(found, json.loads(text))}"
                "); name another --out, or remove the folder to begin anew"
            )
        for left in self.parts.glob(".*.part"):
            left.unlink(missing_ok=True)

    def _part(self, chunk: Chunk) -> Path:
        return self.parts / f"part-{chunk.number:06d}.parquet"

    def save(self, chunk: Chunk, data: bytes) -> None:
        """Save what a chunk gave, as an Arrow stream."""
        import pyarrow as pa

        with pa.ipc.open_stream(data) as stream:
            self._write(stream.read_all(), self._part(chunk), {"chunk": str(chunk.number)})

    def _write(self, table: Any, path: Path, about: dict[str, str]) -> None:
        from pyarrow import parquet

        about = {"schuler.campaign": self.campaign.digest, **about}
        with replacing(path) as temporary:
            parquet.write_table(
                table.replace_schema_metadata(about), temporary, compression="zstd",
                use_dictionary=["method"], row_group_size=1 << 16, version="2.6",
            )  # fmt: skip

    def load(self, chunk: Chunk) -> Any:
        """Return a chunk's table, or None where it is not done."""
        rows = chunk.count * len(chunk.methods)
        table = self._read(self._part(chunk), rows)
        if table is None or table.schema.metadata.get(b"chunk") != str(chunk.number).encode():
            return None
        return table if table.schema.remove_metadata() == schema() else None

    def _read(self, path: Path, rows: int) -> Any:
        import pyarrow as pa
        from pyarrow import parquet

        try:
            table = parquet.read_table(path, memory_map=False)
        except (OSError, pa.ArrowException):
            return None
        about = (table.schema.metadata or {}).get(b"schuler.campaign")
        return table if about == self.campaign.digest.encode() and len(table) == rows else None

    def finished(self) -> Any:
        """Return the results, or None where they are not there or not whole."""
        return self._read(self.results, self.campaign.rows)

    def assemble(self) -> Any:
        """Put all parts together in order, write the results, and remove the parts."""
        import pyarrow as pa

        tables = []
        for chunk in self.campaign.chunks():
            table = self.load(chunk)
            if table is None:
                raise InputError(
                    f"{self._part(chunk)}: has gone or cannot be read; start the campaign again "
                    "and it is made anew"
                )
            tables.append(table.replace_schema_metadata(None))
        whole = self._with_sweep(pa.concat_tables(tables).combine_chunks())
        manifest = json.dumps(self.campaign.manifest, sort_keys=True, ensure_ascii=False)
        self._write(whole, self.results, {"manifest": manifest})
        self.clear()
        return self.finished()

    def clear(self) -> None:
        """Remove the parts of a campaign whose results are there."""
        for path in self.parts.glob("part-*.parquet"):
            path.unlink(missing_ok=True)

    def _with_sweep(self, table: Any) -> Any:
        """Add a column for each swept key: numbers where all its values are, else text."""
        import numpy as np
        import pyarrow as pa

        point = table.column("point").to_numpy()
        for k, (key, values) in enumerate(self.campaign.sweep.items()):
            at = [place.values[key] for place in self.campaign.points]
            if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
                column = pa.array(np.array(at, np.float64)[point])
            else:
                texts = [v if isinstance(v, str) else json.dumps(v) for v in at]
                column = pa.array(texts).take(pa.array(point))
            table = table.add_column(1 + k, key, column)
        return table


def _difference(found: dict[str, Any], wanted: dict[str, Any]) -> str:
    """Say what differs first."""
    for key in wanted:
        if found.get(key) != wanted[key]:
            if key in ("scenario", "points"):
                return "of another scenario"
            return f"{key}: {json.dumps(found.get(key))} there, {json.dumps(wanted[key])} here"
    return "it has more in its manifest"
