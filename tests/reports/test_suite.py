"""All reports are of one look, and a reader without eyes, mouse or screen finds his way in them."""

from __future__ import annotations

import re
import shutil
import subprocess
from html.parser import HTMLParser
from importlib.resources import files
from itertools import pairwise

import numpy as np
import pytest
from click.testing import CliRunner

import schuler as sc
from schuler.cli import cli
from schuler.motion import Static
from schuler.reports import report
from schuler.reports.live_page import page_html
from schuler.sensors import GRADES
from schuler.simulation import simulate
from tests.reports.results import MAKERS, made

SPEC = ("--spec", "navigation-fog", "--lat", "40")
PAGES = {
    "align": ("align", "r.parquet", *SPEC),
    "compare": ("compare", "r.parquet", *SPEC, "--method", "centred", "--prefilter", "none"),
    "limit": ("limit", *SPEC, "--time", "60s"),
    "allan": ("allan", "r.parquet"),
    "array": ("array", "symmetric4"),
    "navigate": ("navigate", "r.parquet", "--lat", "40", "--lon", "0", "--height", "0",
                 "--heading", "10"),
    "north": ("north", "a.txt", "b.txt", "c.txt", "d.txt", "--angles", "0,90,180,270", "--lat",
              "40"),
    "calibrate": ("calibrate", "centrifuge"),
    "plan": ("plan", "centrifuge", "--positions", "4", "--rounds", "1", "--seed", "1"),
    "campaign": ("campaign", "s.toml", "--runs", "3", "--workers", "0"),
}  # fmt: skip
SCENE = """duration = "20 s"
rate = "20 Hz"
instrument = "navigation-fog"
site = { lat = 40 }
motion = { kind = "static" }
"""


class Page(HTMLParser):
    """Collect elements with their attributes, and the text of headings."""

    def __init__(self, text: str):
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.headings: list[tuple[str, str]] = []
        self._in = ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        self._in = tag

    def handle_data(self, data):
        if re.fullmatch(r"h[1-6]|title", self._in):
            self.headings.append((self._in, data))
            self._in = ""

    def all(self, tag):
        return [attrs for name, attrs in self.found if name == tag]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with what the commands need."""
    folder = tmp_path_factory.mktemp("suite")
    rng = np.random.default_rng(3)
    made = simulate(Static(10.0), sc.Site(40.0), 60.0, 20.0, GRADES["navigation-fog"], rng)
    sc.write(made.record, folder / "r.parquet")
    (folder / "s.toml").write_text(SCENE)
    for name, angle in zip("abcd", (0.0, 90.0, 180.0, 270.0), strict=True):
        reading = 2.0 + 11.0 * np.cos(np.radians(angle - 30.0)) + 0.1 * rng.standard_normal(20)
        np.savetxt(folder / f"{name}.txt", reading)
    return folder


@pytest.fixture(scope="module", params=[*PAGES, *MAKERS])
def page(request, folder):
    """Return the text of each report: by the command, and of each kind of result."""
    out = folder / f"{request.param}.html"
    if request.param in MAKERS:
        return report(made(request.param), out).read_text(encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        done = CliRunner().invoke(cli, [*PAGES[request.param], "--report", out.name])
    assert done.exit_code == 0, done.output
    return out.read_text(encoding="utf-8")


def test_a_reader_without_eyes_finds_his_way_in_pages_of_one_look(page):
    seen = Page(page)
    assert seen.all("html") == [{"lang": "en"}]
    title = [text for tag, text in seen.headings if tag == "title"]
    assert len(title) == 1
    assert len(title[0]) > 8
    order = [int(tag[1]) for tag, _ in seen.headings if tag != "title"]
    assert order[0] == 1
    assert order.count(1) == 1
    assert len(order) > 1
    assert all(b <= a + 1 for a, b in pairwise(order))
    for tag in ("header", "main", "footer"):
        assert len(seen.all(tag)) == 1
    plots = [a for a in seen.all("div") if "plot" in (a.get("class") or "").split()]
    assert plots
    for plot in plots:
        assert plot["role"] == "img"
        assert len(plot["aria-label"] or "") > 10
    assert len(seen.all("figcaption")) == len(plots)
    assert len(seen.all("caption")) == len(seen.all("table"))
    assert all(cell.get("scope") in ("row", "col") for cell in seen.all("th"))
    policy = [a["content"] for a in seen.all("meta") if "http-equiv" in a]
    assert len(policy) == 1
    assert (policy[0] or "").startswith("default-src 'none';")
    assert "http" not in (policy[0] or "")
    # One look; nothing from elsewhere; and colours belong to the style, which knows paper too.
    assert files("schuler.reports").joinpath("page.css").read_text(encoding="utf-8") in page
    assert not re.search(r'<(?:script|link|img)[^>]+(?:src|href)="(?!data:)', page)
    assert "style=" not in page[page.index("<body") : page.index("<script")]


def test_a_reader_without_eyes_finds_his_way_in_the_live_page():
    text, _ = page_html()
    seen = Page(text)
    assert seen.all("html") == [{"lang": "en"}]
    assert [told for tag, told in seen.headings if tag == "title"] == ["schuler live"]
    order = [int(tag[1]) for tag, _ in seen.headings if tag != "title"]
    assert order[0] == 1
    assert order.count(1) == 1
    assert all(b <= a + 1 for a, b in pairwise(order))
    drawn = seen.all("svg")
    assert len(drawn) == 2
    assert all(a["role"] == "img" and a["aria-label"] for a in drawn)
    assert len(seen.all("caption")) == len(seen.all("table"))
    assert [a["role"] for a in seen.all("div") + seen.all("p") if "role" in a] == [
        "alert", "status",
    ]  # fmt: skip


def luminance(colour: str) -> float:
    """Return the relative luminance of #rrggbb or #rgb (WCAG 2)."""
    digits = colour.lstrip("#")
    digits = "".join(2 * c for c in digits) if len(digits) == 3 else digits
    parts = [int(digits[k : k + 2], 16) / 255 for k in (0, 2, 4)]
    r, g, b = (c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in parts)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def test_text_stands_out_in_light_in_dark_and_on_paper():
    style = files("schuler.reports").joinpath("page.css").read_text(encoding="utf-8")
    looks = re.findall(r":root \{(.*?)\}", style, re.DOTALL)
    assert len(looks) == 3
    for look in looks:
        colours = dict(re.findall(r"--([\w-]+): (#\w+)", look))
        for ink, ground in (("ink", "paper"), ("soft", "paper"), ("soft", "card"),
                            ("accent", "paper"), ("warn-ink", "warn")):  # fmt: skip
            a, b = sorted((luminance(colours[ink]), luminance(colours[ground])))
            assert (b + 0.05) / (a + 0.05) >= 4.5, (ink, ground, look)


@pytest.mark.browser
@pytest.mark.slow
def test_a_dark_screen_prints_on_white_a4(folder, tmp_path):
    names = ("chromium", "chromium-browser", "google-chrome")
    browser = next((path for name in names if (path := shutil.which(name))), None)
    if browser is None:
        pytest.skip(f"there is no Chromium ({', '.join(names)}) here")
    out, paper = folder / "print.html", tmp_path / "page.pdf"
    done = CliRunner().invoke(cli, ["limit", *SPEC, "--time", "60s", "--report", str(out)])
    assert done.exit_code == 0, done.output
    subprocess.run(
        [browser, "--headless", "--no-sandbox", "--disable-gpu",
         f"--user-data-dir={tmp_path / 'profile'}",
         "--blink-settings=preferredColorScheme=0",
         "--virtual-time-budget=6000",
         "--no-pdf-header-footer", f"--print-to-pdf={paper}", out.as_uri()],
        check=True, capture_output=True, timeout=180,
    )  # fmt: skip
    boxes = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", paper.read_bytes())
    assert 1 <= len(boxes) <= 3
    # 210 by 297 mm in points.
    for width, height in boxes:
        assert float(width) == pytest.approx(595.3, abs=1.0)
        assert float(height) == pytest.approx(841.9, abs=1.0)
