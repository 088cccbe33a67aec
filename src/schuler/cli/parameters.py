"""Types of the commands' options: files in and out, times, bounded numbers.

A command says of each option whether it is a file that is read (`InputFile`) or one that is written
(`OutputFile`). `schuler.cli.command.Command` takes it from there: no output may be an input or
another output.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path, PurePath
from typing import Any

import click

__all__ = ["Count", "InputFile", "Number", "OutputFile", "OutputFolder", "RecordTime", "Seconds"]


class _File(click.ParamType):  # type: ignore[type-arg]
    """The name of a file."""

    name = "file"

    def convert(self, value: Any, param: Any, ctx: Any) -> str:
        """Return the name; an empty one, or one with a NUL, is none."""
        text = str(value)
        if not text or "\0" in text:
            self.fail("is no name of a file", param, ctx)
        return text


class InputFile(_File):
    """A file that is read; ``-`` is standard input where the command takes it.

    Parameters
    ----------
    sidecar : bool
        Whether ``FILE.toml`` beside it is read as well.
    """

    def __init__(self, *, sidecar: bool = False) -> None:
        self.sidecar = sidecar


class OutputFile(_File):
    """A file that is written; ``-`` is standard output.

    Parameters
    ----------
    *suffixes : str
        Those that it may have, as ``".html"``; without any, the command decides. A name without a
        suffix is allowed: its content has one format.
    """

    def __init__(self, *suffixes: str) -> None:
        self.suffixes = suffixes

    def convert(self, value: Any, param: Any, ctx: Any) -> str:
        """Return the name; a suffix of another format is refused."""
        text = super().convert(value, param, ctx)
        suffix = PurePath(text).suffix.lower()
        if self.suffixes and suffix and text != "-" and suffix not in self.suffixes:
            allowed = " or ".join(self.suffixes)
            self.fail(f"'{text}' ends in {suffix}; expected a name in {allowed}", param, ctx)
        return text


class OutputFolder(_File):
    """A folder that is written into; it is made where there is none."""

    def convert(self, value: Any, param: Any, ctx: Any) -> str:
        """Return the name; that of a file is refused."""
        text = super().convert(value, param, ctx)
        if text == "-" or Path(text).is_file():
            self.fail(f"'{text}' is no folder; figures are files of their own", param, ctx)
        return text


class Seconds(click.ParamType):  # type: ignore[type-arg]
    """A time: ``100``, ``100s``, ``5min``, ``0.5 h``.

    Parameters
    ----------
    low, high : float
        Bounds in seconds, both allowed.
    above : float, optional
        A bound that is not allowed itself.
    """

    name = "time"

    def __init__(
        self, low: float = -math.inf, high: float = math.inf, *, above: float | None = None
    ) -> None:
        self.low, self.high, self.above = low, high, above

    def convert(self, value: Any, param: Any, ctx: Any) -> float:
        """Return the time in seconds."""
        from schuler.errors import InputError
        from schuler.units import parse

        try:
            number = float(value)
        except ValueError:
            label = param.opts[0] if param is not None else "time"
            try:
                number = parse(str(value), "time", label)
            except InputError as error:
                if param is None:
                    raise
                self.fail(str(error).removeprefix(f"{label}: "), param, ctx)
        if not math.isfinite(number):
            self.fail(f"'{value}' is not a finite time", param, ctx)
        if self.above is not None and not number > self.above:
            self.fail(f"expected a time above {self.above:g} s, got {number:g} s", param, ctx)
        if not self.low <= number <= self.high:
            self.fail(f"{_expected('time', self.low, self.high, ' s')}, got {number:g} s",
                      param, ctx)  # fmt: skip
        return number


class RecordTime(click.ParamType):  # type: ignore[type-arg]
    """An instant of a record: ``100s`` of the file's time, ``+60s`` from its first row, or a date.

    The text is checked here and passed on, as `schuler.io.Source.chunks` takes it.
    """

    name = "time"

    def convert(self, value: Any, param: Any, ctx: Any) -> str:
        """Return the text."""
        from schuler.errors import InputError
        from schuler.io.span import parse_record_time

        label = param.opts[0] if param is not None else "time"
        try:
            parse_record_time(str(value), label)
        except InputError as error:
            self.fail(str(error).removeprefix(f"{label}: "), param, ctx)
        return str(value)


class Number(click.ParamType):  # type: ignore[type-arg]
    """A finite number between two bounds.

    Parameters
    ----------
    low, high : float
        Both allowed.
    above : float, optional
        A bound that is not allowed itself.
    unit : str
        Said with the number.
    """

    name = "number"

    def __init__(
        self, low: float = -math.inf, high: float = math.inf, *, above: float | None = None,
        unit: str = "",
    ) -> None:  # fmt: skip
        self.low, self.high, self.above = low, high, above
        self.unit = f" {unit}" if unit else ""

    def convert(self, value: Any, param: Any, ctx: Any) -> float:
        """Return the number."""
        try:
            number = float(value)
        except ValueError:
            self.fail(f"'{value}' is not a number", param, ctx)
        if not math.isfinite(number):
            self.fail(f"'{value}' is not a finite number", param, ctx)
        got = f"got {number:.10g}{self.unit}"
        if self.above is not None and not number > self.above:
            self.fail(f"expected a number above {self.above:g}{self.unit}, {got}", param, ctx)
        if not self.low <= number <= self.high:
            self.fail(f"{_expected('number', self.low, self.high, self.unit)}, {got}", param, ctx)
        return number


class Count(click.ParamType):  # type: ignore[type-arg]
    """A whole number between two bounds, both allowed."""

    name = "count"

    def __init__(self, low: int = 0, high: int = 10_000_000) -> None:
        self.low, self.high = low, high

    def convert(self, value: Any, param: Any, ctx: Any) -> int:
        """Return the number."""
        text = str(value).strip()
        digits = text.removeprefix("-").removeprefix("+")
        if not (digits.isascii() and digits.isdigit()):
            self.fail(f"'{value}' is not a whole number", param, ctx)
        # A number of thousands of digits is not converted: it is out of bounds anyhow.
        if len(digits) > 20 or not self.low <= int(text) <= self.high:
            shown = text if len(text) <= 24 else f"{text[:20]}..."
            self.fail(f"expected a whole number from {self.low} to {self.high}, got {shown}",
                      param, ctx)  # fmt: skip
        return int(text)


def _expected(what: str, low: float, high: float, unit: str) -> str:
    if math.isinf(high):
        return f"expected a {what} of {low:g}{unit} or more"
    if math.isinf(low):
        return f"expected a {what} of {high:g}{unit} or less"
    return f"expected a {what} from {low:g} to {high:g}{unit}"


class NamesOption(click.Option):
    """An option whose help ends with names that are looked up when help is asked for.

    Parameters
    ----------
    names : callable
        Returns them.
    """

    def __init__(self, *args: Any, names: Callable[[], Iterable[str]], **options: Any) -> None:
        super().__init__(*args, **options)
        self._names = names

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """Return the option and its help with the names."""
        record = super().get_help_record(ctx)
        if record is None:
            return None
        return record[0], f"{record[1]} Names: {', '.join(self._names())}."


def method_names() -> list[str]:
    """Return the names of the alignment methods."""
    from schuler.alignment.methods import METHODS

    return list(METHODS)


def prefilter_names() -> list[str]:
    """Return the names of the prefilters."""
    from schuler.prefilter.registry import PREFILTERS

    return list(PREFILTERS)
