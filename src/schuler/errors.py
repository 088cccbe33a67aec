"""The exceptions that a user meets: one sentence that says what, where and what to do."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from numbers import Real

__all__ = [
    "InputError", "SchulerError", "expect", "how_to_install", "installed", "located", "near",
    "printable", "shown",
]  # fmt: skip

#: characters of a message; what a file brings into it has no end otherwise
_LONGEST = 4000


class SchulerError(Exception):
    """Base of every error that schuler raises on purpose; the CLI prints it and exits with 2.

    Its text is `printable`, and loses its middle where a file has made it endless.

    Examples
    --------
    >>> raise SchulerError("the folder cannot be written")
    Traceback (most recent call last):
        ...
    schuler.errors.SchulerError: the folder cannot be written
    """

    def __init__(self, *args: object) -> None:
        super().__init__(*(_bounded(arg) if isinstance(arg, str) else arg for arg in args))


class InputError(SchulerError, ValueError):
    """Something that was given (a file, a value, an option) cannot be used as it is.

    Examples
    --------
    >>> sc.Site(lat=91.0)
    Traceback (most recent call last):
        ...
    schuler.errors.InputError: latitude must be between -90 and 90 deg, got 91
    """


def expect(value: object, kind: type | tuple[type, ...], what: str, how: str = "") -> None:
    """Refuse an argument that is not of the type that a function is for.

    Parameters
    ----------
    value : object
    kind : type or tuple of type
        What it must be an instance of.
    what : str
        The argument's name.
    how : str
        What to do instead.

    Raises
    ------
    InputError
        One sentence: what was expected, what came, what to do.

    Examples
    --------
    >>> expect(34.2, str, "name")
    Traceback (most recent call last):
    schuler.errors.InputError: name: expected str, got float
    """
    if isinstance(value, kind):
        return
    kinds = kind if isinstance(kind, tuple) else (kind,)
    wanted = " or ".join("a number" if each is Real else each.__name__ for each in kinds)
    tail = f"; {how}" if how else ""
    raise InputError(f"{what}: expected {wanted}, got {type(value).__name__}{tail}")


@contextmanager
def located(place: object) -> Iterator[None]:
    """Put a place, as a file or a row, before the text of an input error.

    Examples
    --------
    >>> with located("truck.toml"):
    ...     raise InputError("duration is missing")
    Traceback (most recent call last):
        ...
    schuler.errors.InputError: truck.toml: duration is missing
    """
    try:
        yield
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


@contextmanager
def installed(what: str, extra: str, kind: type[SchulerError] = SchulerError) -> Iterator[None]:
    """Say how to install a library whose import fails.

    Parameters
    ----------
    what : str
        What needs which library, as ``reports need Plotly``.
    extra : str
        The extra of schuler that brings it.
    kind : type of SchulerError

    Examples
    --------
    >>> with installed("a table needs unobtainium", "tables"):
    ...     import unobtainium
    Traceback (most recent call last):
        ...
    schuler.errors.SchulerError: a table needs unobtainium, which is not installed: pip install ...
    """
    try:
        yield
    except ImportError:
        raise kind(f"{what}, which is not installed: {how_to_install(extra)}") from None


def how_to_install(extra: str) -> str:
    """Return what installs the libraries of an extra, by their own names.

    ``schuler[ros]`` would look for schuler itself, which need not have come from an index.

    Examples
    --------
    >>> how_to_install("ros")
    "pip install 'rosbags>=0.11.6'"
    """
    import re
    from importlib.metadata import PackageNotFoundError, requires

    try:
        declared = requires("schuler") or []
    except PackageNotFoundError:
        declared = []
    mark = re.compile(rf"""extra == ['"]{re.escape(extra)}['"]""")
    parts = [each.partition(";") for each in declared]
    names = [name.strip() for name, _, condition in parts if mark.search(condition)]
    return "pip install " + " ".join(f"'{name}'" for name in names or [f"schuler[{extra}]"])


def near(text: str, known: Iterable[str]) -> str:
    """Return `` (did you mean 'x'?)`` for the known name that is nearest to a text, if one is.

    Examples
    --------
    >>> near("optimul", ["optimal", "kalman"])
    " (did you mean 'optimal'?)"
    >>> near("wahba", ["optimal", "kalman"])
    ''
    """
    from difflib import get_close_matches

    by_small = {name.lower(): name for name in known}
    found = get_close_matches(text.lower(), list(by_small), 1, 0.7)
    return f" (did you mean '{by_small[found[0]]}'?)" if found else ""


def printable(text: str) -> str:
    r"""Return a text whose control characters are made visible, as ``\x1b``.

    Text of a file, or a file's name, must not reach a terminal as a command to it. Line feeds and
    tabs stay.

    Examples
    --------
    >>> print(printable("name\x1b[2J.csv"))
    name\x1b[2J.csv
    """
    if text.isprintable():
        return text
    from unicodedata import category

    # C: control, format (which can reverse text), lone surrogates; Zl, Zp: other line ends.
    return "".join(
        c.encode("unicode_escape").decode()
        if c not in "\n\t" and (category(c)[0] == "C" or category(c) in ("Zl", "Zp"))
        else c
        for c in text
    )


def shown(text: object) -> str:
    r"""Return a text from a file as it can stand in a sentence: without line feeds and tabs too.

    Examples
    --------
    >>> shown("gx\n\x1b[2J")
    'gx\\n\\x1b[2J'
    """
    return printable(str(text)).replace("\n", r"\n").replace("\t", r"\t")


def _bounded(text: str) -> str:
    text = printable(text)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1000]} ... {text[-900:]}"
