"""The page in a browser: every figure is drawn, in light and dark, and nothing goes wrong."""

from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess
from html import unescape
from io import StringIO
from pathlib import Path

import pytest

from schuler.alignment import align, align_windows
from schuler.reports import report
from schuler.reports.page import Page, Section, write_page
from schuler.reports.results import page_of

from .results import MAKERS, made
from .test_report import HOSTILE, SITE, record

pytestmark = [pytest.mark.browser, pytest.mark.slow]

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-dev-shm-usage", "--virtual-time-budget=15000",
)  # fmt: skip

LIGHT, DARK = "rgb(27, 36, 48)", "rgb(231, 236, 242)"
"""--ink of the page's style, light and dark."""


@pytest.fixture(scope="module")
def chromium() -> str:
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if found := shutil.which(name):
            return found
    pytest.skip("there is no Chromium (chromium, chromium-browser, google-chrome) here")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    windows = align_windows(record(120.0, 20.0, HOSTILE), SITE, 30.0, spec="navigation-fog")
    return report(windows, tmp_path_factory.mktemp("page") / "page.html")


def visit(chromium: str, page: Path, folder: Path, *more: str) -> tuple[str, str]:
    """Return the page's elements after its scripts have run, and the browser's log."""
    done = subprocess.run(
        [chromium, *FLAGS, f"--user-data-dir={folder}", "--enable-logging=stderr", "--v=0",
         *more, "--dump-dom", page.as_uri()],
        capture_output=True, text=True, timeout=180, check=True,
    )  # fmt: skip
    return done.stdout, done.stderr


def plots(dom: str) -> list[str]:
    """Return the elements of each plot, up to its caption."""
    return re.findall(r'<div class="plot.*?<figcaption', dom, re.DOTALL)


@pytest.mark.parametrize(
    ("look", "ink"), [((), LIGHT), (("--blink-settings=preferredColorScheme=0",), DARK)]
)
def test_every_figure_is_drawn(
    chromium: str, page: Path, tmp_path: Path, look: tuple[str, ...], ink: str
) -> None:
    dom, log = visit(chromium, page, tmp_path, *look)
    assert 'data-drawn="7"' in dom
    drawn = plots(dom)
    assert len(drawn) == 7
    for plot in drawn:
        assert 'class="main-svg"' in plot
        assert re.search(r'<path class="js-(line|fill)"|class="point"', plot), plot[:300]
        assert ink in plot
    console = [line for line in log.splitlines() if "CONSOLE" in line]
    assert console == []
    assert "Uncaught" not in log


def test_the_log_would_show_an_error(chromium: str, tmp_path: Path) -> None:
    """The test above can fail: an exception in a page is in the log."""
    bad = tmp_path / "bad.html"
    bad.write_text("<!doctype html><script>throw new Error('for the log')</script>")
    _, log = visit(chromium, bad, tmp_path / "profile")
    assert any("CONSOLE" in line and "for the log" in line for line in log.splitlines())


def test_a_page_without_specification(chromium: str, tmp_path: Path) -> None:
    page = report(align(record(60.0, 20.0), SITE, "analytic"), tmp_path / "page.html")
    dom, log = visit(chromium, page, tmp_path / "profile")
    assert 'data-drawn="6"' in dom
    assert "Uncaught" not in log


def test_a_figure_is_saved_as_it_is(chromium: str, page: Path, tmp_path: Path) -> None:
    """The page's own tables are those of `Figure.to_csv`, and its pictures are SVG."""
    text = page.read_text(encoding="utf-8")
    probe = (
        "<script>(async () => {const s = window.schulerFigures;"
        "const out = s.figures.map(([t, f]) => s.table(f));"
        "const svg = await s.picture(s.figures[0][1], 'svg');"
        "const png = await s.picture(s.figures[0][1], 'png');"
        "const told = document.createElement('pre'); told.id = 'told';"
        "told.textContent = JSON.stringify([out, svg.slice(0, 40), png.slice(0, 40)]);"
        "document.body.append(told);})()</script></body>"
    )
    there = tmp_path / "probe.html"
    there.write_text(text.replace("</body>", probe), encoding="utf-8")
    dom, _ = visit(chromium, there, tmp_path / "profile")
    assert dom.count('aria-label="Save the figure convergence as ') == 3
    found = re.search(r'<pre id="told">(.*?)</pre>', dom, re.DOTALL)
    assert found is not None
    tables, svg, png = json.loads(unescape(found[1]))
    assert png.startswith("data:image/png")
    assert svg.startswith("data:image/svg+xml")
    windows = align_windows(record(120.0, 20.0, HOSTILE), SITE, 30.0, spec="navigation-fog")
    drawings = page_of(windows).drawings
    assert len(tables) == len(drawings)
    for text, drawing in zip(tables, drawings, strict=True):
        ours = list(csv.reader(StringIO(drawing.figure.to_csv())))
        theirs = list(csv.reader(StringIO(text)))
        assert theirs[0] == ours[0]
        assert [row[0] for row in theirs] == [row[0] for row in ours]
        for column in (1, 2):
            same = [
                a[column] == b[column] or float(a[column]) == pytest.approx(float(b[column]))
                for a, b in zip(ours[1:], theirs[1:], strict=True)
            ]
            assert all(same)


AUDIT = (Path(__file__).parent / "audit.js").read_text(encoding="utf-8")
"""A function of the page: a sentence for each thing that a reader would see wrong."""


def audited(dom: str) -> list[str]:
    """Return what was found wrong in a page whose probe has called `AUDIT`."""
    found = re.search(r'data-audit="([^"]*)"', dom)
    assert found is not None
    return list(json.loads(unescape(found[1])))


SHOWN_BY_OTHERS = {"Alignment", "LatitudeFix", "Allan", "Scatter", "Trajectory", "Evaluation"}
"""Results whose page is part of another's: of windows, a fit, a campaign, a navigation."""


@pytest.fixture(scope="module")
def every_page(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    """Return one page with the headlines and sections of every kind of report."""
    sections: list[Section] = []
    for name in sorted(set(MAKERS) - SHOWN_BY_OTHERS):
        made_page = page_of(made(name))
        head = made_page.head_html.replace("<h1>", "<p>").replace("</h1>", "</p>")
        sections += [Section(name, head), *made_page.sections]
    page = Page("Every report", "<h1>Every report</h1>", sections)
    path = tmp_path_factory.mktemp("every") / "page.html"
    write_page(page, path)
    probe = (
        f"<script>{AUDIT}</script><script>const wide = window.innerWidth + 1;"
        "document.documentElement.dataset.audit = JSON.stringify(audit());"
        "const over = Array.from(document.querySelectorAll('body *')).filter((e) => "
        "e.getBoundingClientRect().right > wide && !e.closest('.table') && !e.closest('.plot'));"
        "document.documentElement.dataset.over = over.map((e) => e.tagName).join(' ');"
        "document.documentElement.dataset.scroll = "
        "String(document.documentElement.scrollWidth <= wide);</script></body>"
    )
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("</body>", probe), encoding="utf-8")
    return path, len(page.drawings)


@pytest.mark.parametrize(
    ("width", "look"), [pytest.param(1280, LIGHT, marks=pytest.mark.long), (500, DARK)]
)
def test_every_kind_of_report_fits_its_screen(
    chromium: str, every_page: tuple[Path, int], tmp_path: Path, width: int, look: str
) -> None:
    """All figures are drawn, in light and dark, and nothing is wider than the screen."""
    path, count = every_page
    more = ("--blink-settings=preferredColorScheme=0",) if look == DARK else ()
    dom, log = visit(chromium, path, tmp_path, f"--window-size={width},2000", *more)
    root = re.search(r"<html[^>]*>", dom)
    assert root is not None
    assert f'data-drawn="{count}"' in root[0]
    assert 'data-scroll="true"' in root[0]
    assert 'data-over=""' in root[0], root[0]
    assert audited(dom) == []
    drawn = plots(dom)
    assert len(drawn) == count
    for plot in drawn:
        assert look in plot
    assert [line for line in log.splitlines() if "CONSOLE" in line] == []


def test_every_kind_of_report_fits_its_paper(
    chromium: str, every_page: tuple[Path, int], tmp_path: Path
) -> None:
    """With the style of paper, as wide as A4 within its margins, nothing is wider than the page."""
    text = every_page[0].read_text(encoding="utf-8")
    style, script, page = (text.index(tag) for tag in ("@media print", "<script>", "</body>"))
    assert style < script < page
    # Tables do not scroll on paper, and figures are as wide as `beforeprint` makes them.
    told = (
        "<script>window.dispatchEvent(new Event('beforeprint'));"
        "document.documentElement.dataset.paper = 'yes';"
        "document.documentElement.dataset.audit = JSON.stringify(audit());"
        "const beyond = Array.from(document.querySelectorAll("
        "'.table *, figure svg, header *, p, li')).filter("
        "(e) => e.getBoundingClientRect().right > document.documentElement.clientWidth + 0.5);"
        "document.documentElement.dataset.over = "
        "beyond.map((e) => e.textContent.slice(0, 60)).join('; ');"
        "document.documentElement.dataset.paper = String(document.documentElement.clientWidth);"
        "</script></body>"
    )
    paper = tmp_path / "paper.html"
    paper.write_text(
        text.replace("@media print", "@media all", 1).replace("</body>", told), encoding="utf-8"
    )
    # 210 mm less twice 14 mm, 96 pixels to the inch.
    dom, _ = visit(chromium, paper, tmp_path / "profile", "--window-size=688,2000",
                   "--hide-scrollbars")  # fmt: skip
    root = re.search(r"<html[^>]*>", dom)
    assert root is not None
    assert 'data-paper="688"' in root[0]
    assert 'data-over=""' in root[0], root[0]
    assert audited(dom) == []


def test_the_audit_sees_what_is_wrong(chromium: str, tmp_path: Path) -> None:
    """The audit of the tests above can fail, by each of its rules."""
    layout = {
        "height": 300, "margin": {"l": 40, "r": 5, "t": 20, "b": 40},
        "xaxis": {"title": {"text": "a title that is far wider than the figure " * 3}},
        "yaxis": {"type": "log", "dtick": "D2"},
        "shapes": [{"type": "line", "x0": 2, "x1": 2, "yref": "paper", "y0": 0, "y1": 1,
                    "line": {"color": "red"}}],
        "annotations": [{"x": 2, "y": 1, "text": text, "showarrow": False}
                        for text in ("one label", "another")],
    }  # fmt: skip
    data = [{"type": "scatter", "x": [1.0, 2.0, 90000.0], "y": [1.0, 10.0, 300.0]}]
    bad = {"data": data, "layout": layout}
    page = tmp_path / "bad.html"
    library = report(made("Allan"), tmp_path / "good.html").read_text(encoding="utf-8")
    plotly = max(re.findall(r"<script>(.*?)</script>", library, re.DOTALL), key=len)
    page.write_text(
        "<!doctype html><meta charset=utf-8><style>td { overflow-wrap: anywhere; width: 20px }"
        "</style><table><tr><td>quantisation</td></tr></table>"
        '<figure data-name="bad"><div class="plot" id="p"></div></figure>'
        f"<script>{plotly}</script><script>{AUDIT}Plotly.newPlot('p', {json.dumps(bad['data'])}, "
        f"{json.dumps(bad['layout'])});"
        "document.documentElement.dataset.audit = JSON.stringify(audit());</script>",
        encoding="utf-8",
    )
    dom, _ = visit(chromium, page, tmp_path / "profile", "--window-size=500,900")
    said = "\n".join(audited(dom))
    for rule in (
        "is cut off", "'one label' lies over 'another'", "a line crosses 'one label'",
        "yaxis has no title", "yaxis says a number twice", "xaxis has the mark", "is broken",
    ):  # fmt: skip
        assert rule in said, said


def test_short_tables_are_printed_on_one_page(every_page: tuple[Path, int]) -> None:
    text = every_page[0].read_text(encoding="utf-8")
    tables = re.findall(r'<div class="(table[^"]*)">(<table.*?</table>)</div>', text, re.DOTALL)
    assert {kind for kind, _ in tables} == {"table", "table short"}
    for kind, table in tables:
        assert (kind == "table short") == (table.count("<tr") <= 20)
    assert ".short { break-inside: avoid; }" in text


def test_numbers_of_tables_are_not_broken(every_page: tuple[Path, int]) -> None:
    text = every_page[0].read_text(encoding="utf-8")
    assert '<td class="whole">' in text
    cells = re.findall(r"<td>([^<]+)</td>", text[: text.index("<script>")])
    for cell in cells:
        assert not re.search(r"\d[\d.]*e[-+]\d", cell), cell
