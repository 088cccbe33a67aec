"""Which files a sample crosses from a CSV to the printed heading: ``python benchmarks/hops.py``.

``schuler align`` runs twice over a simulated record, the second time with each call of a Python
function noted, from the first row that is read to the printed heading. A file counts when one of
its functions is called in between, a kernel's file when the kernel is called. The heading is found
when it goes to the checks of the result (`alignment/conclusion.py`). Files that several others call
are counted apart: a file is entered anew when another one calls it.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import sys
import tempfile
import threading
from collections import defaultdict
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

import schuler as sc
from schuler.cli import cli
from schuler.motion import DisturbedVehicle

HOME = Path(sc.__file__).parent
CALLS = ("kernels/_jit.py", "kernels/_machine_code.py", "_blas.py")
"""What passes a call on as it is: to compiled code, or with one thread of the linear algebra."""
CHECKS = "alignment/conclusion.py"
"""Where an estimate is held against its record."""


class Hops:
    """The files whose functions are called, and from which other files.

    Parameters
    ----------
    begin : str
        Name of the function whose first call begins the count, as ``io/source.py:chunks``.
    """

    def __init__(self, begin: str) -> None:
        self.begin = begin
        self.callers: dict[str, set[str]] = defaultdict(set)
        self.order: list[str] = []
        self.running = False
        self.found = 0

    def file(self, frame: FrameType | None) -> str | None:
        """Return the nearest file of schuler's on the stack."""
        while frame is not None:
            name = frame.f_code.co_filename
            if name.startswith(str(HOME)):
                return Path(name).relative_to(HOME).as_posix()
            frame = frame.f_back
        return None

    def __call__(self, frame: FrameType, event: str, argument: Any) -> None:
        """Take what Python tells a profiler."""
        if event != "call" or not frame.f_code.co_filename.startswith(str(HOME)):
            return
        here = self.file(frame)
        assert here is not None
        if f"{here}:{frame.f_code.co_name}" == self.begin:
            self.running = True
        if not self.running:
            return
        before = self.file(frame.f_back)
        if here in CALLS:
            # The dispatcher stands for the kernel that it calls.
            kernel = frame.f_locals.get("self")
            name = getattr(kernel, "__module__", "").removeprefix("schuler.")
            if frame.f_code.co_name != "__call__" or not name.startswith("kernels."):
                return
            here = name.replace(".", "/") + ".py"
        if before not in (None, here, *CALLS):
            self.callers[here].add(str(before))
        if here == CHECKS and not self.found:
            self.found = len(self.order)
        if here not in self.order:
            self.order.append(here)


class Printed(io.StringIO):
    """Standard output that ends the count where the heading is printed."""

    def __init__(self, hops: Hops) -> None:
        super().__init__()
        self.hops = hops

    def write(self, text: str) -> int:
        """Take a piece of the output."""
        if "heading" in text:
            self.hops.running = False
        return super().write(text)


def run(path: Path, words: list[str], hops: Hops) -> str:
    """Align a file with a profiler; return what was printed."""
    out = Printed(hops)
    threading.setprofile(hops)
    sys.setprofile(hops)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
            cli.main(args=["align", str(path), *words], standalone_mode=False)
    finally:
        sys.setprofile(None)
        threading.setprofile(None)  # type: ignore[arg-type]
    return out.getvalue()


def main() -> None:
    """Print the number of files, and those that several others call."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--list", action="store_true", help="print the files in their order")
    args = parser.parse_args()
    rng = np.random.default_rng(1)
    truck = DisturbedVehicle.with_crew(rng, 60.0, heading=57.3)
    site = sc.Site(40.0)
    record = sc.simulate(truck, site, 60.0, 100.0, sc.load_spec("navigation-fog"), rng).record
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "truck.csv"
        sc.write(record, path)
        words = ["--lat", "40", "--spec", "navigation-fog"]
        run(path, words, Hops("nothing"))
        hops = Hops("io/source.py:chunks")
        text = run(path, words, hops)
    assert "heading" in text, text
    again = {name: callers for name, callers in hops.callers.items() if len(callers) > 1}
    print(
        f"files crossed: {hops.found} until the heading is found, {len(hops.order)} until it is "
        f"printed; {len(again)} of them are called from several files"
    )
    if args.list:
        for name in hops.order:
            print(f"  {name:40} from {', '.join(sorted(hops.callers[name])) or '-'}")


if __name__ == "__main__":
    main()
