"""The command ``schuler``, and ``python -m schuler``."""

from __future__ import annotations

import sys
from typing import Any

__all__ = ["main"]


def main() -> None:
    """Run the command line; stopped while it still loads, it says so as it does later."""
    sys.unraisablehook = _interrupt_again
    try:
        from schuler.cli import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("schuler: stopped\n")
        sys.exit(130)


def _interrupt_again(unraisable: Any) -> None:
    """Raise Ctrl-C again where Python would only print it: it came in a finaliser."""
    if isinstance(unraisable.exc_value, KeyboardInterrupt):
        import _thread
        import threading

        # Not at once: what is raised in here would only be printed, too.
        threading.Timer(0.01, _thread.interrupt_main).start()
    else:
        sys.__unraisablehook__(unraisable)


if __name__ == "__main__":
    main()
