"""The documentation runs: its Python, its commands, its examples, its schemas, its table.

A page's ``python`` and ``console`` blocks are run from top to bottom in one folder and, for
Python, one namespace. What a block prints on standard output must be what stands below it: in the
``text`` block that follows Python, or under its ``$ schuler`` line; standard error is not read.
Numbers may differ by one in their last printed digit, and in the sixth where more are shown. A
number that another machine computes otherwise (the last digits of an optimum, what cancellation
leaves) gets the tolerance that its claim deserves, in a comment before the block::

    <!-- tolerance: 5 % or 0.001 -->

A line of the page that ends in `` ...`` claims nothing of what follows.

With SCHULER_WRITE_DOCS=1 the pages are rewritten instead of compared.

Blocks on ``lasergyro.imu`` need the real record and stand on their own: they are run apart.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import os
import pkgutil
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import click
import jsonschema
import pytest

import schuler
from schuler.cli import cli
from tests.conftest import ROOT

DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(p for p in DOCS.rglob("*.md") if p.stem != "benchmarks")]
REAL = "lasergyro.imu"
WRITE = os.environ.get("SCHULER_WRITE_DOCS") == "1"

_BLOCK = re.compile(
    r"(?:^<!-- tolerance: (?P<tolerance>[^>]+) -->\n)?"
    r"^```(?P<kind>python|console)\n(?P<body>.*?)^```\n(?:\n```text\n(?P<text>.*?)^```\n)?",
    re.MULTILINE | re.DOTALL,
)
_APART = ("campaign", "published", "plan", "live", "compare")
"""Commands that start processes, or threads that outlive them."""

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def named(page: Path) -> str:
    """Return a page's path below docs/, which names its tests."""
    return page.relative_to(DOCS if page.is_relative_to(DOCS) else ROOT).as_posix()


def blocks(page: Path, real: bool) -> list[re.Match[str]]:
    """Return the blocks of a page that need, or do not need, the real record."""
    found = _BLOCK.finditer(page.read_text(encoding="utf-8"))
    return [m for m in found if (REAL in m["body"]) == real]


def run_command(line: str, folder: Path) -> str:
    """Run a ``schuler`` command; return what it prints on standard output.

    Here, where that is the same: a process of its own takes a second to start. Commands that
    start processes have one.
    """
    words = shlex.split(line)
    assert words[0] == "schuler", line
    if words[1] not in _APART:
        from schuler.cli import main

        out, err = io.StringIO(), io.StringIO()
        with (
            contextlib.chdir(folder), contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err), pytest.raises(SystemExit) as stop,
        ):  # fmt: skip
            main(words[1:])
        assert not stop.value.code, f"{line}\n{err.getvalue()}"
        return out.getvalue()
    done = subprocess.run(
        [sys.executable, "-m", *words], cwd=folder, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, f"{line}\n{done.stderr}"
    return done.stdout


def tolerance(text: str | None) -> tuple[float, float]:
    """Return the relative and the absolute tolerance that a comment states."""
    if text is None:
        return 1e-6, 1e-8
    relative, absolute = 0.0, 0.0
    for part in text.split(" or "):
        if part.endswith("%"):
            relative = float(part[:-1]) / 100.0
        else:
            absolute = float(part)
    return relative, absolute


def same(found: str, written: str, allowed: str | None = None) -> bool:
    """Say whether two texts agree, their numbers to one in the last digit or as is allowed."""
    a, b = (text.strip().splitlines() for text in (found, written))
    if len(a) != len(b):
        return False
    relative, absolute = tolerance(allowed)
    for x, y in zip(a, b, strict=True):
        if y.endswith(" ..."):
            y = y.removesuffix(" ...")
            x = " ".join(x.split()[: len(y.split())])
        # The width of a column follows its numbers.
        if _NUMBER.sub(" 0 ", x).split() != _NUMBER.sub(" 0 ", y).split():
            return False
        for m, n in zip(_NUMBER.findall(x), _NUMBER.findall(y), strict=True):
            mantissa, _, power = n.lower().partition("e")
            unit = 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))
            if abs(float(m) - float(n)) > max(1.01 * unit, relative * abs(float(n)), absolute):
                return False
    return True


def run_python(code: str, space: dict[str, Any]) -> str:
    """Run a block in a namespace; return what it prints."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(code, "docs", "exec"), space)
    return out.getvalue()


def run_page(page: Path, folder: Path, real: bool) -> list[tuple[str, str]]:
    """Run a page's blocks; return each block as it is and as it should be."""
    space: dict[str, Any] = {"__name__": "docs"}
    changes = []
    for m in blocks(page, real):
        stated = f"<!-- tolerance: {m['tolerance']} -->\n" if m["tolerance"] else ""
        if m["kind"] == "python":
            out = run_python(m["body"], space)
            if m["text"] is None:
                assert not out.strip(), f"{page.name} prints without saying so:\n{m['body']}{out}"
                continue
            if same(out, m["text"], m["tolerance"]):
                continue
            wanted = "\n".join(line.rstrip() for line in out.strip("\n").splitlines())
            changes.append((m[0], f"{stated}```python\n{m['body']}```\n\n```text\n{wanted}\n```\n"))
            continue
        body, different = "", False
        parts = re.split(r"^(?=\$ )", m["body"].replace("\\\n", ""), flags=re.MULTILINE)
        for part, shown in zip(
            [p for p in parts if p.strip()],
            [p for p in re.split(r"^(?=\$ )", m["body"], flags=re.MULTILINE) if p.strip()],
            strict=True,
        ):
            line, _, written = part.partition("\n")
            head = shown[: len(shown) - len(written)]
            out = run_command(line[2:], folder)
            # A command with nothing below it shows that it works, no more.
            different |= bool(written.strip()) and not same(out, written, m["tolerance"])
            kept = "\n".join(text.rstrip() for text in out.rstrip().splitlines()) + "\n"
            body += head + (kept if written.strip() else "")
        if different:
            changes.append((m[0], f"{stated}```console\n{body}```\n"))
    return changes


def with_ellipses(old: str, new: str) -> str:
    """Return a new block whose lines end where the old one's ended with dots."""
    a, b = old.splitlines(keepends=True), new.splitlines(keepends=True)
    if len(a) != len(b):
        return new
    return "".join(x if x.endswith(" ...\n") else y for x, y in zip(a, b, strict=True))


def settle(page: Path, changes: list[tuple[str, str]]) -> None:
    """Rewrite the page, or fail with what differs."""
    if WRITE:
        text = page.read_text(encoding="utf-8")
        for old, new in changes:
            text = text.replace(old, with_ellipses(old, new))
        page.write_text(text, encoding="utf-8")
        return
    assert not changes, (
        f"{page.name} shows\n{changes[0][0]}\nbut it is\n{changes[0][1]}\n"
        "Where the new figures are right, SCHULER_WRITE_DOCS=1 writes them into the page."
    )


@pytest.mark.slow
@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, real=False)], ids=named)
def test_page_runs_and_prints_what_it_shows(page, tmp_path, monkeypatch):
    if any("from pyins" in m["body"] for m in blocks(page, real=False)):
        pytest.importorskip("pyins", reason=f"{page.name} needs pyins: pip install python-ins")
    from schuler.io import registry

    # A reader that a page registers is the page's own.
    monkeypatch.setattr(registry, "_registered", {})
    monkeypatch.chdir(tmp_path)
    settle(page, run_page(page, tmp_path, real=False))


@pytest.mark.slow
@pytest.mark.realdata
@pytest.mark.parametrize("page", [p for p in PAGES if blocks(p, real=True)], ids=named)
def test_page_s_blocks_on_the_real_record(page, tmp_path, monkeypatch, data_dir):
    (tmp_path / REAL).symlink_to((data_dir / "psins_lasergyro_vehicle" / REAL).resolve())
    monkeypatch.chdir(tmp_path)
    settle(page, run_page(page, tmp_path, real=True))


@pytest.mark.slow
@pytest.mark.realdata
def test_table_of_methods_on_the_real_record(data_dir):
    """Each spread in the page is what `align_windows` finds; the digits are those printed."""
    import schuler as sc

    record = sc.read(data_dir / "psins_lasergyro_vehicle" / REAL)
    site = sc.Site(34.246048, 108.909664, 380.0)
    text = (DOCS / "align.md").read_text(encoding="utf-8")
    rows = re.findall(
        r"^\| `(\S+)` \| ([\d.]+)′ \| ([\d.]+)′ \| ([\d.]+)′ \| ([\d.]+)′ \|$", text, re.M
    )
    assert [row[0] for row in rows] == list(METHOD_ROWS)
    for name, *cells in rows:
        for length, cell in zip((60, 100, 150, 300), cells, strict=True):
            w = sc.align_windows(record, site, length, name, at="start")
            decimals = len(cell.partition(".")[2])
            assert w.std_heading_arcmin == pytest.approx(float(cell), abs=0.51 * 10.0**-decimals), (
                name,
                length,
            )


METHOD_ROWS = ("centred", "wahba", "integral-triad", "instants-triad", "analytic")


@pytest.mark.parametrize("name", ["align_truck.py", "align_my_csv.py"])
def test_example_runs(name, tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error", str(ROOT / "examples" / name)],
        cwd=tmp_path, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "heading" in done.stdout


def schema(name: str) -> jsonschema.Draft202012Validator:
    """Return a validator of one of the published schemas."""
    loaded = json.loads((DOCS / f"{name}.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(loaded)
    return jsonschema.Draft202012Validator(loaded)


@pytest.fixture(scope="module")
def truck(tmp_path_factory):
    """Return a saved record of a simulated vehicle, one minute."""
    import numpy as np

    import schuler as sc
    from schuler.motion import DisturbedVehicle
    from schuler.sensors import GRADES
    from schuler.simulation import simulate

    rng = np.random.default_rng(3)
    motion = DisturbedVehicle.draw(rng, 60.0, heading=10.0)
    made = simulate(motion, sc.Site(50.0), 60.0, 100.0, GRADES["navigation-rlg"], rng)
    path = tmp_path_factory.mktemp("docs") / "truck.parquet"
    sc.write(made.record, path)
    return path


@pytest.mark.parametrize(
    "options",
    [
        [],
        ["--spec", "navigation-rlg"],
        ["--spec", "industrial-mems", "--method", "analytic"],
        ["--spec", "navigation-fog", "--method", "kalman"],
        ["--windows", "20", "--at", "start"],
        ["--windows", "50"],
    ],
    ids=" ".join,
)
def test_align_s_json_fits_its_schema(truck, options):
    text = run_command(shlex.join(["schuler", "align", "truck.parquet", "--lat", "50", "--json",
                                   "out.json", *options]), truck.parent)  # fmt: skip
    assert "heading" in text
    data = json.loads((truck.parent / "out.json").read_text(encoding="utf-8"))
    schema("alignment").validate(data)
    assert ("windows" in data) == ("--windows" in options)


@pytest.mark.parametrize("options", [[], ["--lat", "50"]], ids=["plain", "lat"])
def test_info_s_json_fits_its_schema(truck, options):
    run_command(shlex.join(["schuler", "info", "truck.parquet", "--json", "out.json", *options]),
                truck.parent)  # fmt: skip
    schema("info").validate(json.loads((truck.parent / "out.json").read_text(encoding="utf-8")))


@pytest.mark.parametrize("options", [["--time", "60s,300s"], []], ids=["times", "plain"])
def test_limit_s_json_fits_its_schema(tmp_path, options):
    run_command(shlex.join(["schuler", "limit", "--spec", "tactical-fog", "--lat", "50", "--json",
                            "out.json", *options]), tmp_path)  # fmt: skip
    schema("limit").validate(json.loads((tmp_path / "out.json").read_text(encoding="utf-8")))


@pytest.mark.parametrize(
    "damage",
    [
        lambda d: d.pop("heading_deg"),
        lambda d: d.update(surprise=1),
        lambda d: d.update(heading_deg=360.0),
        lambda d: d.update(windows=[]),
        lambda d: d["budget_arcmin2"].update(luck=1.0),
        lambda d: d.update(quaternion_wxyz=[1.0, 0.0, 0.0]),
    ],
)
def test_the_schema_can_refuse(truck, damage):
    run_command("schuler align truck.parquet --lat 50 --json out.json", truck.parent)
    data = json.loads((truck.parent / "out.json").read_text(encoding="utf-8"))
    damage(data)
    with pytest.raises(jsonschema.ValidationError):
        schema("alignment").validate(data)


@pytest.mark.parametrize(
    ("found", "written", "allowed", "agree"),
    [("a 1.23", "a 1.24", None, True), ("a 1.23", "a 1.25", None, False),
     ("a 1", "b 1", None, False), ("1.0e-3", "1.1e-3", None, True), ("1 2", "1", None, False),
     ("a 100.0", "a 104.0", "5 %", True), ("a 100.0", "a 106.0", "5 %", False),
     ("x -0.0004", "x 0.0003", "1 % or 0.001", True), ("x 0.02", "x 0.01", "1 % or 0.001", True),
     ("x 0.04", "x 0.01", "1 % or 0.001", False), ("a  10.0", "a 9.9", None, True),
     ("a 1 b 2", "a 1 ...", None, True), ("c 1 b 2", "a 1 ...", None, False)],
)  # fmt: skip
def test_the_comparison_can_fail(found, written, allowed, agree):
    assert same(found, written, allowed) is agree


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_links_between_pages_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#\s]+)", text):
        if re.match(r"[a-z]+:", target):
            continue
        assert (page.parent / target).exists(), f"{page.name}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_tests_that_a_page_names_are_there(page):
    missing, source = [], ""
    for path, name in re.findall(r"`(tests/[\w/]+\.py)?(?:::(\w+))?`", page.read_text("utf-8")):
        if path:
            file = ROOT / path
            source = file.read_text("utf-8") if file.is_file() else ""
            if not source:
                missing.append(path)
        if name and f"def {name}(" not in source:
            missing.append(name)
    assert not missing


@pytest.mark.slow
def test_the_documentation_builds(tmp_path, root):
    pytest.importorskip("mkdocs")
    pytest.importorskip("latex2mathml")
    pytest.importorskip("matplotlib")  # draws the pictures
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(tmp_path / "site")],
        cwd=root, capture_output=True, text=True, timeout=300,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    texts = [page.read_text(encoding="utf-8") for page in (tmp_path / "site").rglob("*.html")]
    assert len(texts) > 30
    for text in texts:
        # Nothing may be fetched from elsewhere.
        assert not re.search(r'<(?:script|link|img)[^>]+(?:src|href)="https?:', text)
    anchors = {anchor for text in texts for anchor in re.findall(r'id="(schuler[\w.]*)"', text)}
    absent = sorted(public_names() - anchors)
    assert not absent, f"public, and in no page of the API: {', '.join(absent)}"
    shutil.rmtree(tmp_path / "site")


def test_a_function_that_shares_its_module_s_name_has_a_block_of_its_own():
    """The API pages show it only where they name it; the whole check needs mkdocs."""
    shared = {name for name in public_names() if len(set(name.split(".")[-2:])) == 1}
    pages = "\n".join(page.read_text(encoding="utf-8") for page in DOCS.glob("api/*.md"))
    shown = set(re.findall(r"^::: (\S+)", pages, re.M))
    assert not sorted(shared - shown - {each + "." + each.rpartition(".")[2] for each in shown})


def public_names() -> set[str]:
    """Return each public name of each module, as the API pages show it."""
    front = (DOCS / "api.md").read_text(encoding="utf-8")
    assert all(f"`sc.{name}`" in front for name in schuler.__all__ if name != "__version__")
    names = set()
    for each in pkgutil.iter_modules(schuler.__path__, "schuler."):
        # The command line has a help of its own; of the kernels the useful ones are shown.
        if each.name.startswith("schuler._") or each.name in ("schuler.cli", "schuler.kernels"):
            continue
        for name in getattr(importlib.import_module(each.name), "__all__", ()):
            where = f"{each.name}.{name}"
            # A function that shares its module's name is shown as that module's.
            shared = (ROOT / "src" / where.replace(".", "/")).with_suffix(".py").exists()
            names.add(f"{where}.{name}" if shared else where)
    return names


def test_how_tos_and_tutorials_say_what_they_need_and_how_long_they_take():
    pages = [*(DOCS / "how-to").glob("*.md"), *(DOCS / "tutorials").glob("*.md")]
    assert len(pages) > 15
    for page in pages:
        head = " ".join(page.read_text(encoding="utf-8").partition("\n## ")[0].split())
        assert head.count("**You have**") == 1, page.name
        assert head.count("**It takes**") == 1, page.name


OWN_FILE = [
    "align", "aided", "allan", "array", "calibrate", "campaign", "compare", "consistency", "fine",
    "io", "json", "live", "live-in-motion", "navigate", "north", "plan", "prefilter", "published",
    "results", "rotation", "simulate", "uncertainty",
]  # fmt: skip
"""Pages of the reference that are about a command."""


@pytest.mark.parametrize("name", OWN_FILE)
def test_a_page_of_the_reference_begins_with_the_reader_s_own_file(name):
    text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    first = re.search(r"^```(\w+)\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert first is not None
    assert first[1] == "sh"
    assert first[2].startswith("schuler ")
    assert "simulate(" not in text[: first.start()]


def commands_of(text: str) -> list[list[str]]:
    """Return the words of each command of schuler in the blocks that are shown and not run."""
    found = []
    for block in re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        for line in block.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if "schuler" in words:
                words = words[words.index("schuler") + 1 :]
                end = next((k for k, word in enumerate(words) if word in ("|", "||", "&&")), None)
                found.append(words[:end])
    return found


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_commands_that_are_shown_have_their_options(page):
    for words in commands_of(page.read_text(encoding="utf-8")):
        group: click.Command = cli
        rest = list(words)
        if rest[0] == "array" and rest[1] != "faults":
            rest.insert(1, "figures")  # which may be left out
        while isinstance(group, click.Group) and rest and not rest[0].startswith("-"):
            _, found, rest = group.resolve_command(click.Context(group), rest)
            assert found is not None, words
            group = found
        with click.Context(group) as context:
            known = {o for p in group.get_params(context) for o in (*p.opts, *p.secondary_opts)}
        said = {word.partition("=")[0] for word in rest if word.startswith("--")}
        assert said <= known, (words, said - known)


def test_the_first_page_of_the_project_sends_nobody_in_all_directions():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    links = re.findall(r"(?<!!)\[[^\]]+\]\(([^)]+)\)", text)
    assert 0 < len(links) <= 10, links
    for link in links:
        assert (ROOT / link.partition("#")[0]).is_file(), link
