"""Hatchling, and before it builds a wheel, kernels compiled into it.

Whoever installs schuler from its source (``pip install .``, ``uvx --from .``, an sdist) waits once
for the kernels that demo, info and align call, in the place of the first command. The code is for
any x86-64 processor with AVX2; elsewhere, and of other sources, it is not taken, and kernels are
compiled when they are needed.

``pip wheel --config-settings=compile=all .`` compiles every kernel, ``compile=none`` none. An
editable installation has none either: its sources change, and the user's cache has its kernels.
"""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hatchling import build as hatchling
from hatchling.build import (
    build_editable,
    build_sdist,
    get_requires_for_build_editable,
    get_requires_for_build_sdist,
)

__all__ = [
    "build_editable", "build_sdist", "build_wheel", "get_requires_for_build_editable",
    "get_requires_for_build_sdist", "get_requires_for_build_wheel",
]  # fmt: skip

Settings = dict[str, Any] | None

_NEEDED = ("numpy", "numba", "llvmlite")
_WAYS = {"first": ["--first"], "all": []}


def _options(settings: Settings) -> list[str] | None:
    """Return the options for `schuler.kernels.ahead`, or None where nothing is to be compiled."""
    way = (settings or {}).get("compile", "first")
    if way not in (*_WAYS, "none"):
        raise SystemExit(f"compile={way}: expected first, all or none")
    here = (
        sys.platform.startswith("linux") and platform.machine() == "x86_64" and sys.maxsize > 2**32
    )
    return _WAYS[way] if here and way != "none" else None


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    """Add what compiles kernels, as pyproject.toml has it."""
    needed = hatchling.get_requires_for_build_wheel(config_settings)
    if _options(config_settings) is None:
        return needed
    project = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]
    return [
        *needed,
        *(each for each in project["dependencies"] if re.split(r"\W", each)[0] in _NEEDED),
    ]


def build_wheel(
    wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None
) -> str:
    """Build the wheel, with the machine code of kernels in it."""
    with _compiled(_options(config_settings), asked="compile" in (config_settings or {})):
        return hatchling.build_wheel(wheel_directory, config_settings, metadata_directory)


@contextmanager
def _compiled(options: list[str] | None, asked: bool) -> Iterator[None]:
    """Have compiled kernels among the sources meanwhile.

    A wheel without them is a wheel, too, unless they were asked for.
    """
    source = Path.cwd() / "src"
    folder = source / "schuler" / "kernels" / "compiled"
    shutil.rmtree(folder, ignore_errors=True)
    try:
        if options is not None:
            call = [sys.executable, "-m", "schuler.kernels.ahead", *options, "--to", str(folder)]
            # Found by the working folder: what pip builds in leaves out of PYTHONPATH what an
            # editable installation has put on the path, which are these sources.
            unsafe = {key: value for key, value in os.environ.items() if key != "PYTHONSAFEPATH"}
            done = subprocess.run(call, cwd=source, env=unsafe, check=False)
            if done.returncode:
                if asked:
                    raise SystemExit("kernels could not be compiled")
                shutil.rmtree(folder, ignore_errors=True)
                sys.stderr.write(
                    "warning: no kernel could be compiled ahead: each is when it is first called\n"
                )
        yield
    finally:
        shutil.rmtree(folder, ignore_errors=True)
