"""The version, where rooms can read it without the package's face and all that it names."""

from __future__ import annotations

__all__ = ["__version__"]

__version__ = "0.1.0"
