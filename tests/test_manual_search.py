"""The manual's search where its pages are files in a folder: a frame does the worker's work."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.reports.test_browser import chromium, visit  # noqa: F401

WORKER = """
addEventListener("message", async (event) => {
  const own = typeof parent.IFrameWorker === "function" && document.querySelector("script[src]");
  await null;
  postMessage({ twice: 2 * event.data.number, from: own.src.split("/").pop() });
});
"""
PAGE = """<!doctype html><html><head><script src="iframe-worker.js"></script></head><body><script>
const worker = new Worker("worker.js"), answers = [];
worker.addEventListener("message", (event) => {
  answers.push(event.data.twice + " " + event.data.from);
  document.documentElement.dataset.answers = answers.join(", ");
});
// Sent before the worker's script has loaded, as the theme does.
worker.postMessage({ number: 3 });
worker.postMessage({ number: 21 });
</script></body></html>
"""


@pytest.mark.browser
@pytest.mark.slow
def test_messages_go_to_a_worker_and_back_in_a_folder(
    chromium: str,  # noqa: F811
    tmp_path: Path,
) -> None:
    shutil.copy(ROOT / "docs" / "javascript" / "iframe-worker.js", tmp_path)
    (tmp_path / "worker.js").write_text(WORKER)
    page = tmp_path / "page.html"
    page.write_text(PAGE)
    dom, log = visit(chromium, page, tmp_path / "profile")
    assert [line for line in log.splitlines() if "CONSOLE" in line] == []
    found = re.search(r'data-answers="([^"]*)"', dom)
    assert found is not None
    assert found[1] == "6 worker.js, 42 worker.js"


def test_the_manual_takes_this_script_and_none_from_a_network() -> None:
    """The theme's plugin fetches one where the name of none of the polyfills has this in it."""
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    polyfills = text.partition("polyfills:\n")[2].partition("\n\n")[0]
    assert re.findall(r"- (\S+)", polyfills) == ["javascript/iframe-worker.js"]
    assert "\n  - offline" in text
