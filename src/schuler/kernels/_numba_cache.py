"""Numba's disk cache in schuler's own folder, for kernels that are called through Numba."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock
from typing import Any

from numba.core import config
from numba.core.caching import FunctionCache, IndexDataCacheFile

from schuler.kernels._cache import CACHE_FOLDER, in_words, read_whole, say_once

__all__ = ["attach_cache"]


_one_at_a_time = Lock()


class _CheckedFile(IndexDataCacheFile):  # type: ignore[misc]
    """Numba's index and data files, each with a digest at its end."""

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[Any]:
        with super()._open_for_write(filepath) as file:
            content = io.BytesIO()
            yield content
            data = content.getvalue()
            file.write(data + hashlib.sha256(data).digest())

    def _load_index(self) -> dict[Any, str]:
        if not self._whole(self._index_path):
            return {}
        index: dict[Any, str] = super()._load_index()
        return index

    def _load_data(self, name: str) -> Any:
        if not self._whole(self._data_path(name)):
            # Numba takes this for a file that is gone, and compiles.
            raise FileNotFoundError(name)
        return super()._load_data(name)

    def _whole(self, path: str) -> bool:
        """Say whether a file is there with its own digest; remove a damaged one."""
        return read_whole(Path(path)) is not None


class _CheckedCache(FunctionCache):  # type: ignore[misc]
    """Numba's cache of one function; whatever goes wrong with it, the function is compiled."""

    def __init__(self, py_func: Callable[..., Any]) -> None:
        super().__init__(py_func)
        locator = self._impl.locator
        self._cache_file = _CheckedFile(
            cache_path=locator.get_cache_path(), filename_base=self._impl.filename_base,
            source_stamp=locator.get_source_stamp(),
        )  # fmt: skip

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled function, or None where it must be compiled."""
        try:
            return super().load_overload(sig, target_context)
        except Exception as error:
            say_once("read", f"cannot be read ({in_words(error)}); kernels are compiled again")
            with suppress(Exception):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compiled function, where that is possible."""
        try:
            super().save_overload(sig, data)
        except Exception as error:
            say_once(
                "write", f"cannot be written ({in_words(error)}); it is compiled anew next time"
            )


def attach_cache(compiled: Any, function: Callable[..., Any]) -> None:
    """Give a Numba dispatcher its cache in schuler's own folder, if there is one."""
    if CACHE_FOLDER is None or not hasattr(compiled, "_cache"):
        return
    # The folder is a setting of the process: of two threads one would find none, and Numba would
    # cache in the working folder.
    with _one_at_a_time:
        before = config.CACHE_DIR
        config.CACHE_DIR = CACHE_FOLDER
        try:
            compiled._cache = _CheckedCache(function)
        except Exception as error:
            # Numba would cache beside the sources instead, where old code can come back.
            say_once("folder", f"cannot be used ({in_words(error)}); kernels are compiled anew")
        finally:
            config.CACHE_DIR = before
