"""The command ``schuler``, and ``python -m schuler``."""

from __future__ import annotations

import sys

__all__ = ["main"]


def main() -> None:
    """Run the command line; stopped while it still loads, it says so as it does later."""
    try:
        from schuler.cli import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("schuler: stopped\n")
        sys.exit(130)


if __name__ == "__main__":
    main()
