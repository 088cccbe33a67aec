"""The exceptions that a user meets: one sentence that says what, where and what to do."""

from __future__ import annotations

__all__ = ["InputError", "SchulerError", "shown"]

#: characters of a message; what a file brings into it has no end otherwise
_LONGEST = 4000


def shown(text: object) -> str:
    r"""Return a text with every character that a terminal would act on written as an escape.

    Texts from files (cells, column names, topics, paths) go through here before they reach a
    message or a note.

    Parameters
    ----------
    text : object
        Anything that `str` turns into a text.

    Examples
    --------
    >>> shown("gx\x1b[2J")
    'gx\\x1b[2J'
    """
    text = str(text)
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


class SchulerError(Exception):
    """Base of every error that schuler raises on purpose; the CLI prints it and exits with 2.

    Control characters in the sentence are shown as escapes, line ends excepted, and a sentence
    that a file has made endless loses its middle.
    """

    def __init__(self, *args: object) -> None:
        super().__init__(*(_sentence(arg) if isinstance(arg, str) else arg for arg in args))


class InputError(SchulerError, ValueError):
    """Something that was given (a file, a value, an option) cannot be used as it is."""


def _sentence(text: str) -> str:
    text = "\n".join(shown(line) for line in text.split("\n"))
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST - 1000]} ... {text[-900:]}"
    return text
