"""``python -m schuler``."""

from __future__ import annotations

from schuler.cli import main

if __name__ == "__main__":
    main()
