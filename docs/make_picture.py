"""Draw the pictures in docs/images: the report of `schuler demo`, and the page of a live alignment.

Needs Chromium; say where it is with CHROMIUM, if it is not found by itself.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import schuler as sc
from schuler.alignment import LiveSession
from schuler.io.packets import encode_frame
from schuler.motion import DisturbedVehicle
from schuler.reports.live_page import LivePage
from schuler.reports.live_server import LiveServer
from schuler.sensors import GRADES
from schuler.simulation import simulate

OUT = Path(__file__).resolve().parent / "images"
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--hide-scrollbars", "--virtual-time-budget=8000",
)  # fmt: skip


def picture(browser: str, where: str, name: str, size: str, folder: Path) -> None:
    """Open a page without a window, and save what is seen when it has come to its end."""
    shot = folder / name
    subprocess.run(
        [browser, *FLAGS, f"--user-data-dir={folder / 'profile'}", f"--window-size={size}",
         f"--screenshot={shot}", where],
        check=True, capture_output=True, timeout=300,
    )  # fmt: skip
    shutil.copyfile(shot, OUT / name)
    print(OUT / name)


def live_server() -> LiveServer:
    """Return a server whose stream of a simulated truck has ended: two minutes of it."""
    site = sc.Site(48.1)
    rng = np.random.default_rng(11)
    truck = DisturbedVehicle.draw(rng, 120.0, heading=57.3)
    record = simulate(truck, site, 120.0, 50.0, GRADES["navigation-fog"], rng).record
    session, page = LiveSession(site, spec="navigation-fog"), LivePage("udp:127.0.0.1:5005")
    values = np.hstack([record.dtheta, record.dvel])
    for k, (time, row) in enumerate(zip(record.time, values, strict=True)):
        # One packet in a hundred is lost on the way, and one in two hundred is damaged.
        frame = encode_frame(k, float(time), row, "increments")
        if k % 100 != 7:
            session.feed(frame[:50] if k % 200 == 9 else frame)
        if k % 100 == 99:
            page.update(session.solution(), session.counts(), session.spans)
    page.finish()
    return LiveServer(page, ("127.0.0.1", 0))


def main() -> None:
    """Draw both."""
    found = [path for name in NAMES if (path := shutil.which(name))]
    browser = os.environ.get("CHROMIUM") or (found[0] if found else None)
    if browser is None:
        sys.exit(f"no browser: install one of {', '.join(NAMES)}, or set CHROMIUM to its path")
    OUT.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with live_server() as server:
            picture(browser, server.url, "live.png", "760,785", folder)
        subprocess.run(
            [sys.executable, "-m", "schuler", "demo", "--out", "out"], cwd=folder, check=True
        )
        # So high that the picture ends between two sections of the page.
        page = folder / "out" / "demo.html"
        picture(browser, page.as_uri(), "report.png", "1100,1175", folder)


if __name__ == "__main__":
    main()
