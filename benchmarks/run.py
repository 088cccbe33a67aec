"""Run every benchmarks/bench_*.py and write docs/benchmarks.md between its markers.

A benchmark is a module with ``run() -> list[dict]``; each dict has `what`, `ours`, `peer`,
`ratio` (peer over ours: above 1 we are faster, or smaller) and `unit`. `peer` and `ratio` may be
None where there is nobody to compare with. Both sides are measured in the same run.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import importlib.util
import os
import platform
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

HERE = Path(__file__).resolve().parent
PAGE = HERE.parent / "docs" / "benchmarks.md"
START, END = "<!-- benchmarks: start -->", "<!-- benchmarks: end -->"
KEYS = ("what", "ours", "peer", "ratio", "unit")


def discover(only: list[str]) -> list[Path]:
    """Return the benchmark files, or those whose name holds one of the words."""
    files = sorted(HERE.glob("bench_*.py"))
    return [f for f in files if not only or any(word in f.stem for word in only)]


def measure(path: Path) -> list[dict[str, Any]]:
    """Import a benchmark and return its rows, checked."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise SystemExit(f"{path}: cannot be imported")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    rows: list[dict[str, Any]] = module.run()
    for row in rows:
        if set(row) != set(KEYS):
            raise SystemExit(f"{path}: expected rows with {', '.join(KEYS)}, got {sorted(row)}")
    return rows


def cells(row: dict[str, Any]) -> list[str]:
    """Return a row as text."""
    numbers = ["-" if row[k] is None else f"{row[k]:.3g}" for k in ("ours", "peer", "ratio")]
    return [row["what"], *numbers, row["unit"]]


def machine() -> str:
    """Say what the numbers were measured on."""
    versions = ", ".join(
        f"{p} {importlib.metadata.version(p)}" for p in ("numpy", "scipy", "numba")
    )
    return (
        f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores, "
        f"Python {platform.python_version()}, {versions}"
    )


def write(sections: dict[str, list[dict[str, Any]]]) -> None:
    """Replace what stands between the page's markers; put them at the end where there are none."""
    lines = [START, "", f"Measured on {machine()}, by `make bench`.", ""]
    for name, rows in sections.items():
        lines += [f"### {name}", "", "| what | ours | peer | peer / ours | unit |"]
        lines += ["|---|---:|---:|---:|---|"]
        lines += ["| " + " | ".join(cells(row)) + " |" for row in rows] + [""]
    block = "\n".join([*lines, END])
    text = PAGE.read_text(encoding="utf-8") if PAGE.exists() else "# Benchmarks\n"
    if START in text and END in text:
        before, rest = text.split(START, 1)
        text = before + block + rest.split(END, 1)[1]
    else:
        text = text.rstrip("\n") + f"\n\n{block}\n"
    PAGE.parent.mkdir(exist_ok=True)
    PAGE.write_text(text, encoding="utf-8")


def main(argv: list[str] | None = None) -> int:
    """Run what was asked for, print a table, write the page when everything was run."""
    parser = argparse.ArgumentParser(description="Time schuler beside its peers.")
    parser.add_argument("only", nargs="*", help="words of the benchmarks to run; all, if none")
    options = parser.parse_args(argv)
    files = discover(options.only)
    if not files:
        print(f"no benchmark's name holds {' or '.join(options.only)}", file=sys.stderr)
        return 2
    console = Console()
    sections = {}
    for path in files:
        name = path.stem.removeprefix("bench_").replace("_", " ")
        rows = sections[name] = measure(path)
        table = Table("what", title=name, title_justify="left")
        for header in ("ours", "peer", "peer / ours"):
            table.add_column(header, justify="right")
        table.add_column("unit")
        for row in rows:
            table.add_row(*cells(row))
        console.print(table)
    if options.only:
        console.print(f"{PAGE.name} is written only when all benchmarks run")
    else:
        write(sections)
        console.print(f"written to {PAGE.relative_to(HERE.parent)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
