"""Run every benchmarks/bench_*.py and write docs/benchmarks.md between its markers.

A benchmark is a module with ``run() -> list[dict]``; each dict has `what`, `ours`, `peer`,
`ratio` (peer over ours: above 1 we are faster, or smaller) and `unit`. `peer` and `ratio` may be
None where there is nobody to compare with. Both sides are measured in the same run, with the same
repeats. Rows of `_timing.row` are processor times; they have wall times and how far the median is
above the least as well.

At the end, what has fallen by more than a tenth against the page before is printed: ratios where
there is a peer, which a slower machine leaves as they are, else the figure itself. Nothing fails.
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
MORE = ("wall", "peer_wall", "spread")
FALLEN = 0.1
"""Part by which a ratio falls, or a figure rises, before it is said."""


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
        if not set(KEYS) <= set(row) <= {*KEYS, *MORE}:
            raise SystemExit(f"{path}: expected rows with {', '.join(KEYS)}, got {sorted(row)}")
    return rows


def cells(row: dict[str, Any]) -> list[str]:
    """Return a row as text."""
    numbers = ["-" if row[k] is None else f"{row[k]:.3g}" for k in ("ours", "peer", "ratio")]
    walls = [row.get(key) for key in ("wall", "peer_wall")]
    wall = " / ".join("-" if w is None else f"{w:.3g}" for w in walls) if walls[0] else "-"
    spread = "-" if row.get("spread") is None else f"{100.0 * row['spread']:.0f} %"
    return [row["what"], *numbers, row["unit"], wall, spread]


def fallen(before: str, sections: dict[str, list[dict[str, Any]]]) -> list[str]:
    """Say which rows are worse by more than `FALLEN` than those of a page."""
    old = {}
    for line in before.splitlines():
        parts = [part.strip() for part in line.strip("| ").split(" | ")]
        if line.startswith("| ") and len(parts) >= 5:
            old[parts[0]] = parts
    said = []
    for row in (row for rows in sections.values() for row in rows):
        parts = old.get(row["what"])
        if parts is None or row["unit"] in ("-", "arcmin"):
            continue
        key, k = ("ratio", 3) if row["ratio"] is not None else ("ours", 1)
        try:
            was = float(parts[k])
        except ValueError:
            continue
        now = float(row[key])
        worse = now < was * (1.0 - FALLEN) if key == "ratio" else now > was * (1.0 + FALLEN)
        if worse:
            said.append(f"{row['what']}: {key} {was:.3g} before, {now:.3g} now")
    return said


def machine() -> str:
    """Say what the numbers were measured on."""
    versions = ", ".join(
        f"{p} {importlib.metadata.version(p)}" for p in ("numpy", "scipy", "numba")
    )
    return (
        f"{_processor()} ({platform.system()} {platform.machine()}, {os.cpu_count()} cores), load "
        f"{os.getloadavg()[0]:.1f} when it began, Python {platform.python_version()}, {versions}"
    )


def _processor() -> str:
    """Return the processor's name, where the system tells it."""
    facts = Path("/proc/cpuinfo")
    if facts.exists():
        for line in facts.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or "unknown processor"


def write(sections: dict[str, list[dict[str, Any]]], where: str) -> None:
    """Replace what stands between the page's markers; put them at the end where there are none."""
    lines = [START, "", f"Measured on {where}, by `make bench`.", ""]
    for name, rows in sections.items():
        lines += [f"### {name}", "", "| what | ours | peer | peer / ours | unit | wall | spread |"]
        lines += ["|---|---:|---:|---:|---|---|---:|"]
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
    where = machine()
    before = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    sections = {}
    for path in files:
        name = path.stem.removeprefix("bench_").replace("_", " ")
        rows = sections[name] = measure(path)
        table = Table("what", title=name, title_justify="left")
        for header in ("ours", "peer", "peer / ours"):
            table.add_column(header, justify="right")
        for header in ("unit", "wall", "spread"):
            table.add_column(header)
        for row in rows:
            table.add_row(*cells(row))
        console.print(table)
    for line in fallen(before, sections):
        console.print(f"fallen: {line}")
    if options.only:
        console.print(f"{PAGE.name} is written only when all benchmarks run")
    else:
        write(sections, where)
        console.print(f"written to {PAGE.relative_to(HERE.parent)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
