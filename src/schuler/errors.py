"""The exceptions that a user meets: one sentence that says what, where and what to do."""

from __future__ import annotations

__all__ = ["InputError", "SchulerError"]


class SchulerError(Exception):
    """Base of every error that schuler raises on purpose; the CLI prints it and exits with 2."""


class InputError(SchulerError, ValueError):
    """Something that was given (a file, a value, an option) cannot be used as it is."""
