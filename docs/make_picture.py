"""Draw docs/images/report.png: a screenshot of the report that `schuler demo` makes.

Needs Chromium; say where it is with CHROMIUM, if it is not found by itself.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

OUT = Path(__file__).resolve().parent / "images" / "report.png"
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


def main() -> None:
    """Run the demo, open its report without a window, and save what is seen."""
    found = [path for name in NAMES if (path := shutil.which(name))]
    browser = os.environ.get("CHROMIUM") or (found[0] if found else None)
    if browser is None:
        sys.exit(f"no browser: install one of {', '.join(NAMES)}, or set CHROMIUM to its path")
    OUT.parent.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run(
            [sys.executable, "-m", "schuler", "demo", "--out", "out"], cwd=folder, check=True
        )
        # So high that the picture ends between two sections of the page.
        page, shot = folder / "out" / "demo.html", folder / "report.png"
        subprocess.run(
            [
                browser, "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic",
                "--no-first-run", "--disable-background-networking",
                "--disable-component-update", "--disable-sync",
                f"--user-data-dir={folder / 'profile'}", "--window-size=1100,1175",
                "--hide-scrollbars", "--virtual-time-budget=8000", f"--screenshot={shot}",
                page.as_uri(),
            ],
            check=True, capture_output=True, timeout=300,
        )  # fmt: skip
        shutil.copyfile(shot, OUT)
    print(OUT)


if __name__ == "__main__":
    main()
