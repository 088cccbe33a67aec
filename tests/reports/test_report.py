"""The page of an alignment: hostile names, size, what it fetches, how it is written."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from html import escape
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import schuler as sc
from schuler.alignment import Alignment, Windows, align, align_windows
from schuler.cli import main
from schuler.constants import EARTH_RATE
from schuler.earth import Site
from schuler.errors import InputError, SchulerError
from schuler.record import ImuRecord
from schuler.reports import report

SITE = Site(40.0, 116.0, 50.0)
HOSTILE = "</script><script>alert(1)</script><img src=x onerror='alert(2)'>\"&amp;<!--"


def record(seconds: float, rate: float, name: str = "truck", seed: int = 5) -> ImuRecord:
    """Return a base at rest with white noise, heading 0, made without the simulator."""
    rng = np.random.default_rng(seed)
    n = round(seconds * rate)
    dt = np.full(n, 1.0 / rate)
    w = EARTH_RATE * np.array([0.0, np.cos(SITE.latitude), np.sin(SITE.latitude)])
    f = np.array([0.0, 0.0, SITE.gravity])
    return ImuRecord(
        np.arange(1, n + 1) / rate,
        dt,
        w / rate + rng.normal(scale=1e-6 / np.sqrt(rate), size=(n, 3)),
        f / rate + rng.normal(scale=2e-4 / np.sqrt(rate), size=(n, 3)),
        name=name,
    )


@pytest.fixture(scope="module")
def fix() -> Alignment:
    return align(record(120.0, 20.0), SITE, spec="navigation-fog")


@pytest.fixture(scope="module")
def windows() -> Windows:
    return align_windows(record(120.0, 20.0), SITE, 30.0, spec="navigation-fog")


class Elements(HTMLParser):
    """Collects elements, their attributes, and the text of everything but scripts and styles."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.shown: list[str] = []
        self.data: list[str] = []
        self._inside = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self._inside = tag
        if tag == "script":
            self.data.append("")

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside == "script":
            self.data[-1] += data
        elif self._inside != "style":
            self.shown.append(data)

    def count(self, tag: str) -> int:
        return sum(name == tag for name, _ in self.elements)


def page(result: Alignment | Windows, path: Path) -> str:
    assert report(result, path) == path
    return path.read_text(encoding="utf-8")


def test_what_is_on_it(fix: Alignment, tmp_path: Path) -> None:
    parsed = Elements(page(fix, tmp_path / "r.html"))
    shown = "".join(parsed.shown)
    assert fix.headline().split(" deg")[0].removeprefix("heading ") + "°" in shown
    for words in ("Convergence", "Where the uncertainty comes from", "What the record shows",
                  "Residuals", "To do it again"):  # fmt: skip
        assert words in shown
    figures = [a for tag, a in parsed.elements if a.get("class") == "plot"]
    assert len(figures) == 6
    assert all(a["role"] == "img" and a["aria-label"] for a in figures)
    data = [json.loads(text) for text in parsed.data if text.startswith("{")]
    assert len(data) == 6
    assert all(figure["data"] for figure in data)


def test_windows_have_their_figure(windows: Windows, tmp_path: Path) -> None:
    shown = "".join(Elements(page(windows, tmp_path / "r.html")).shown)
    assert "Repeatability" in shown
    assert "4 windows of 30 s" in shown


@pytest.mark.parametrize("method", ["wahba", "integral-triad", "instants-triad", "analytic"])
def test_every_method_can_be_drawn(method: str, tmp_path: Path) -> None:
    for spec in (None, "tactical-fog"):
        text = page(align(record(60.0, 20.0), SITE, method, spec), tmp_path / "r.html")
        assert text.count('class="plot"') >= 6


def test_the_shortest_record_can_be_drawn(tmp_path: Path) -> None:
    text = page(align(record(0.5, 20.0), SITE), tmp_path / "r.html")
    assert text.count('class="plot"') >= 6


def test_hostile_names_are_only_text(fix: Alignment, tmp_path: Path) -> None:
    plain = Elements(page(fix, tmp_path / "plain.html"))
    bad = fix.noting(
        [f"warning {HOSTILE}"], {"record": HOSTILE, "file": HOSTILE, f"note {HOSTILE}": HOSTILE}
    )
    text = page(bad, tmp_path / "bad.html")
    parsed = Elements(text)
    shown = "".join(parsed.shown)
    assert shown.count(HOSTILE) == 7
    # title, headline, warning, record, file, and a note with its name
    assert escape(HOSTILE) in text
    assert "<script>alert" not in text
    assert parsed.count("img") == 0
    assert parsed.count("script") == plain.count("script")


def test_hostile_names_in_figures(fix: Alignment, tmp_path: Path) -> None:
    """What a figure says travels as JSON that cannot end its element."""
    from schuler.reports.page import _script_json

    assert not set("<>&") & set(_script_json(json.dumps({"name": HOSTILE})))
    assert json.loads(_script_json(json.dumps({"name": HOSTILE}))) == {"name": HOSTILE}
    windows = Windows(replace(fix, inputs={"record": HOSTILE}), 60.0, (fix, fix))
    parsed = Elements(page(windows, tmp_path / "w.html"))
    assert parsed.count("img") == 0


def test_hostile_file_through_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "a<b>'\"&c<script>alert(1)<script>.csv"
    sc.write(record(60.0, 20.0), path)
    with pytest.raises(SystemExit) as stop:
        main(["align", str(path), "--lat", "40", "--report", str(tmp_path / "r.html")])
    assert stop.value.code == 0
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "<script>alert" not in text
    assert str(path) in "".join(Elements(text).shown)


def test_nothing_is_fetched(windows: Windows, tmp_path: Path) -> None:
    parsed = Elements(page(windows, tmp_path / "r.html"))
    for tag, attributes in parsed.elements:
        for key in ("src", "href", "data", "action", "poster", "srcset"):
            value = attributes.get(key)
            assert value is None or value.startswith(("data:", "#")), (tag, key, value)
        assert tag not in ("iframe", "object", "embed", "base")
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    style = re.findall(r"<style>(.*?)</style>", text, re.DOTALL)[0]
    assert "url(" not in style
    assert "@import" not in style


def test_an_hour_at_200_hz_is_a_small_page(tmp_path: Path) -> None:
    windows = align_windows(record(3600.0, 200.0), SITE, 100.0, spec="navigation-fog")
    page(windows, tmp_path / "r.html")
    size = (tmp_path / "r.html").stat().st_size
    assert size < 6_000_000


def test_the_same_result_is_the_same_page(fix: Alignment, tmp_path: Path) -> None:
    assert page(fix, tmp_path / "a.html") == page(fix, tmp_path / "b.html")


def test_without_plotly(fix: Alignment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [n for n in sys.modules if n == "plotly" or n.startswith("plotly.")]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, "plotly", None)
    with pytest.raises(SchulerError, match=r"reports need Plotly.*pip install 'plotly>="):
        report(fix, tmp_path / "r.html")
    assert list(tmp_path.iterdir()) == []


def test_without_plotly_the_command_line_says_so_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "plotly", None)
    sc.write(record(60.0, 20.0), tmp_path / "truck.csv")
    with pytest.raises(SystemExit) as stop:
        main(["align", str(tmp_path / "truck.csv"), "--lat", "40", "--json",
              str(tmp_path / "r.json"), "--report", str(tmp_path / "r.html")])  # fmt: skip
    assert stop.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("schuler: reports need Plotly")
    assert err.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["truck.csv"]


def test_a_page_appears_whole_or_not_at_all(
    fix: Alignment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "r.html"
    path.write_text("old")
    real = Path.write_text

    def full(self: Path, text: str, **options: str) -> int:
        real(self, text[:1000], **options)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(InputError, match=r"r\.html: cannot be written \(No space left"):
        report(fix, path)
    monkeypatch.undo()
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["r.html"]


def test_a_folder_that_is_not_there(fix: Alignment, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no folder"):
        report(fix, tmp_path / "no" / "r.html")


def test_a_contradiction_stands_above_the_heading(fix: Alignment, tmp_path: Path) -> None:
    text = report(fix, tmp_path / "good.html").read_text(encoding="utf-8")
    assert 'aria-label="Inconsistent"' not in text
    wrong = fix.contradicted(["the <sign> is wrong"])
    text = report(wrong, tmp_path / "wrong.html").read_text(encoding="utf-8")
    box, value = (text.index(s) for s in ('aria-label="Inconsistent"', '<p class="value">'))
    assert box < value
    assert "the &lt;sign&gt; is wrong" in text
    assert '<p class="value">no heading (sigma 104 deg) <' in text
