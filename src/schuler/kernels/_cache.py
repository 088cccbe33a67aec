"""The folder of compiled kernels: a comfort, never a condition.

Each file ends in the SHA-256 of what stands before it. A file that is damaged, cannot be read or
cannot be written is said once, and the kernel is compiled; where the folder can be written to, the
file is made anew.
"""

from __future__ import annotations

import hashlib
import io
import logging
import os
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numba
from numba.core import config
from numba.core.caching import FunctionCache, IndexDataCacheFile

__all__ = ["CACHE_FOLDER", "attach_cache"]

_log = logging.getLogger("schuler")
_DIGEST = 32
_said: set[str] = set()


def _say_once(kind: str, text: str) -> None:
    if kind not in _said:
        _said.add(kind)
        _log.warning("note: kernel cache: %s", text)


def _sources_digest() -> str:
    """Return a hash of all kernel sources and of the constants that they freeze."""
    here = Path(__file__).parent
    digest = hashlib.sha256(numba.__version__.encode())
    for source in [*sorted(here.glob("*.py")), here.parent / "constants.py"]:
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _bases() -> Iterator[Path]:
    """Give the places for the folder, best first."""
    if given := os.environ.get("SCHULER_CACHE_DIR"):
        yield Path(given)
    elif given := os.environ.get("XDG_CACHE_HOME"):
        yield Path(given) / "schuler"
    else:
        home = "~/Library/Caches" if sys.platform == "darwin" else "~/.cache"
        with suppress(RuntimeError):
            yield Path(home).expanduser() / "schuler"
    if hasattr(os, "getuid"):
        # Compiled code is run: nobody else may be able to write there.
        own = Path(tempfile.gettempdir()) / f"schuler-kernels-{os.getuid()}"
        with suppress(OSError):
            own.mkdir(mode=0o700, exist_ok=True)
            found = own.lstat()
            if (
                stat.S_ISDIR(found.st_mode)
                and found.st_uid == os.getuid()
                and not found.st_mode & 0o077
            ):
                yield own


def _folder() -> str | None:
    """Return the first folder that can be written to, or None."""
    name = f"kernels-{_sources_digest()}"
    for base in _bases():
        folder = base / name
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK | os.X_OK):
                return str(folder)
    _say_once(
        "folder",
        "no folder for it can be written to, so kernels are compiled in each process; "
        "set SCHULER_CACHE_DIR to a folder of yours",
    )
    return None


CACHE_FOLDER = _folder()


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
        try:
            data = Path(path).read_bytes()
        except FileNotFoundError:
            return False
        if hashlib.sha256(data[:-_DIGEST]).digest() == data[-_DIGEST:]:
            return True
        _say_once("damaged", f"{path} is damaged; the kernel is compiled again")
        with suppress(OSError):
            os.unlink(path)
        return False


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
            _say_once("read", f"cannot be read ({_words(error)}); kernels are compiled again")
            with suppress(Exception):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a compiled function, where that is possible."""
        try:
            super().save_overload(sig, data)
        except Exception as error:
            _say_once(
                "write", f"cannot be written ({_words(error)}); it is compiled anew next time"
            )


def _words(error: Exception) -> str:
    return getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"


def attach_cache(compiled: Any, function: Callable[..., Any]) -> None:
    """Give a Numba dispatcher its cache in schuler's own folder, if there is one."""
    if CACHE_FOLDER is None or not hasattr(compiled, "_cache"):
        return
    before = config.CACHE_DIR
    config.CACHE_DIR = CACHE_FOLDER
    try:
        compiled._cache = _CheckedCache(function)
    except Exception as error:
        # Numba would cache beside the sources instead, where old code can come back.
        _say_once("folder", f"cannot be used ({_words(error)}); kernels are compiled anew")
    finally:
        config.CACHE_DIR = before
