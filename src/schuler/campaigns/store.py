"""The folder of a campaign: its manifest, a part for each finished chunk, and the results.

Parts appear whole or not at all and are named by their chunk. Each part, and the results, carry a
digest of their content, which is verified before they are used, as are their columns, runs and
ranges; a part that fails counts as not done, and that is said. The results are put together in the
order of the runs, with fixed settings of the writer: their bytes do not tell what happened on the
way.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from schuler._arrow import column_of, numbers
from schuler._files import parse_json, replacing
from schuler.campaigns.chunk import Chunk, schema
from schuler.campaigns.plan import Campaign
from schuler.errors import InputError
from schuler.io.sealed import read_sealed, write_sealed

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
        #: what was found damaged and is computed again
        self.notes: list[str] = []

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
            for path in (self.folder / ".lock", self.manifest, self.results):
                if path.exists() and not path.is_file():
                    raise InputError(f"{path}: is not an ordinary file; name another --out")
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
            found = parse_json(self.manifest.read_text(encoding="utf-8"))
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
        about = {"schuler.campaigns": self.campaign.digest, **about}
        with replacing(path) as temporary:
            write_sealed(
                table, temporary, about, compression="zstd",
                use_dictionary=["method"], row_group_size=1 << 16, version="2.6",
            )  # fmt: skip

    def load(self, chunk: Chunk) -> Any:
        """Return a chunk's table, or None where it is not done; damage goes into the notes."""
        path = self._part(chunk)
        if not path.is_file():
            return None
        try:
            table, about = self._read(path, [chunk])
            if about.get(b"chunk") != str(chunk.number).encode():
                raise InputError("is of another chunk")
            if table.schema.remove_metadata() != schema():
                raise InputError("has other columns than runs have")
        except InputError as error:
            self._note(f"{path}: {error}; its runs are computed again")
            return None
        return table

    def _read(self, path: Path, chunks: list[Chunk]) -> tuple[Any, dict[bytes, bytes]]:
        """Read a table of some chunks and check it against what they must give."""
        rows = sum(chunk.count * len(chunk.methods) for chunk in chunks)
        table, about, sealed = read_sealed(path, rows)
        if not sealed:
            raise InputError("has no checksum of its content")
        if about.get(b"schuler.campaigns") != self.campaign.digest.encode():
            raise InputError("is of another campaign")
        _check_rows(table, chunks)
        return table, about

    def finished(self) -> Any:
        """Return the results, or None where they are not there or damaged, which is noted.

        Raises
        ------
        InputError
            If the file is whole but not of this campaign: it is somebody's, and stays.
        """
        if not self.results.exists():
            return None
        try:
            table, _ = self._read(self.results, list(self.campaign.chunks()))
        except InputError as error:
            if self._foreign():
                raise InputError(
                    f"{self.results}: {error}; remove it, or name another --out"
                ) from None
            self._note(f"{self.results}: {error}; what is missing is computed again")
            return None
        plain = table.drop_columns(list(self.campaign.sweep))
        if plain.schema.remove_metadata() != schema():
            self._note(f"{self.results}: has other columns than runs have; it is made again")
            return None
        return table

    def _foreign(self) -> bool:
        """Say whether the results are a whole file of something else."""
        try:
            about = read_sealed(self.results)[1]
        except InputError:
            return False
        return about.get(b"schuler.campaigns") != self.campaign.digest.encode()

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)

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

        point = numbers(table.column("point"))
        for k, (key, values) in enumerate(self.campaign.sweep.items()):
            at = [place.values[key] for place in self.campaign.points]
            if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
                column = column_of(np.array(at, np.float64)[point])
            else:
                texts = [v if isinstance(v, str) else json.dumps(v) for v in at]
                column = pa.array(texts).take(pa.array(point))
            table = table.add_column(1 + k, key, column)
        return table


def _check_rows(table: Any, chunks: list[Chunk]) -> None:
    """Compare a table's runs with those that it must hold, and its numbers with their ranges.

    Raises
    ------
    InputError
        If they differ.
    """
    import numpy as np

    missing = [name for name in schema().names if name not in table.column_names]
    if missing:
        raise InputError(f"has no column {', '.join(missing)}")
    wanted = [
        (chunk.point, run, method)
        for chunk in chunks
        for run in range(chunk.first, chunk.first + chunk.count)
        for method in chunk.methods
    ]
    keys = (table.column(name).to_pylist() for name in ("point", "run", "method"))
    if list(zip(*keys, strict=True)) != wanted:
        raise InputError("has other runs than its campaign")
    for name in schema().names:
        if not name.startswith(("sigma_", "limit_", "heading_error", "warnings")):
            continue
        try:
            values = np.asarray(numbers(table.column(name)), np.float64)
        except TypeError as error:
            raise InputError(f"has a column {name} that is none: {error}") from None
        low, high = (-np.pi, np.pi) if name == "heading_error" else (0.0, np.inf)
        # NaN is what an alignment without a bound gives.
        if np.any(values < low) or np.any(values > high):
            raise InputError(f"has values of {name} that cannot be")


def _difference(found: dict[str, Any], wanted: dict[str, Any]) -> str:
    """Say what differs first."""
    for key in wanted:
        if found.get(key) != wanted[key]:
            if key in ("scenario", "points"):
                return "of another scenario"
            return f"{key}: {json.dumps(found.get(key))} there, {json.dumps(wanted[key])} here"
    return "it has more in its manifest"
