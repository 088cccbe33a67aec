"""Choices with options as values: frozen dataclasses to and from tables and short texts.

A registry names the choices of one kind (alignment methods, prefilters). The same names and options
stand in a command line, a scenario file, a sweep, a JSON document and a campaign's rows::

    "kalman(states=12, step=2 s)"
    {"name": "kalman", "options": {"states": 12, "step": 2.0}}
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from types import NoneType, UnionType
from typing import Any, Generic, TypeVar, Union, get_args, get_origin, get_type_hints

from schuler.errors import InputError, near
from schuler.units import parse

__all__ = ["Registry", "split_outside"]

T = TypeVar("T")

_CALL = re.compile(r"\s*([A-Za-z][\w-]*)\s*(?:\((.*)\))?\s*", re.DOTALL)
_PLAIN = re.compile(r"[\w.+-]+(?: [\w./^]+)?")


def split_outside(text: str, separators: str) -> list[str]:
    """Return the parts of a text between separators that stand outside brackets."""
    parts, depth = [""], 0
    for c in text:
        depth += (c == "(") - (c == ")")
        if depth == 0 and c in separators:
            parts.append("")
        else:
            parts[-1] += c
    return [part.strip() for part in parts]


class Registry(Mapping[str, T], Generic[T]):
    """Named choices: frozen dataclasses with the options that their names stand for.

    Parameters
    ----------
    what : str
        What one is, as "method".
    base : type
        What each has to be.
    group : str
        Entry points of other packages: a class that needs no options, or a choice.
    presets : callable
        Gives the choices of schuler's own; called when the first one is wanted.
    nested : mapping of str to callable, optional
        For options that are choices themselves: text to value. The value's text is ``str(value)``
        and its table ``value.to_table()``.
    """

    def __init__(
        self,
        what: str,
        base: type[Any],
        group: str,
        presets: Callable[[], dict[str, T]],
        nested: Mapping[str, Callable[[Any], Any]] | None = None,
    ) -> None:
        self.what, self.base, self.group = what, base, group
        self._presets = presets
        self._nested = dict(nested or {})

    @cached_property
    def _own(self) -> dict[str, T]:
        return self._presets()

    @cached_property
    def _entries(self) -> dict[str, EntryPoint]:
        found: dict[str, EntryPoint] = {}
        for entry in entry_points(group=self.group):
            if entry.name in self._own or entry.name in found:
                raise InputError(
                    f"the {self.what} '{entry.name}' of '{entry.value}' has a name that is taken; "
                    "remove that package or ask its makers to rename it"
                )
            found[entry.name] = entry
        return found

    def register(self, name: str, choice: T) -> None:
        """Add a choice for this process.

        Raises
        ------
        InputError
            If it is none of this kind, or the name is taken.
        """
        if not isinstance(choice, self.base) or not is_dataclass(choice):
            raise InputError(f"{choice!r} is no {self.what}: derive it from {self.base.__name__}")
        if self._own.get(name, choice) != choice or name in self._entries:
            raise InputError(f"there is another {self.what} '{name}' already")
        if not _CALL.fullmatch(name) or "(" in name:
            raise InputError(f"'{name}' is no name: letters, digits, - and _ make one")
        self._own[name] = choice

    def __iter__(self) -> Iterator[str]:
        yield from self._own
        yield from self._entries

    def __len__(self) -> int:
        return len(self._own) + len(self._entries)

    def __getitem__(self, name: str) -> T:
        if name in self._own:
            return self._own[name]
        entry = self._entries[name]
        try:
            loaded: Any = entry.load()
            choice: Any = loaded() if isinstance(loaded, type) else loaded
        except Exception as error:  # any package's code may run here
            raise InputError(
                f"the {self.what} '{name}' of '{entry.value}' cannot be loaded "
                f"({type(error).__name__}: {error}); repair or remove that package"
            ) from None
        if not isinstance(choice, self.base) or not is_dataclass(choice):
            raise InputError(f"'{entry.value}' is no {self.what}")
        found: Any = choice
        self._own[name] = found
        del self._entries[name]
        return found  # type: ignore[no-any-return]

    # ------------------------------------------------------------------------------

    def parse(self, text: str) -> T:
        """Return the choice that a text names: ``"kalman"``, ``"kalman(12, step=2 s)"``.

        Raises
        ------
        InputError
            For an unknown name or option, or a value that cannot be meant.
        """
        found = _CALL.fullmatch(text)
        if found is None:
            raise InputError(f"'{text}' is no {self.what}: say NAME or NAME(OPTION=VALUE, ...)")
        preset = self._preset(found[1].lower())
        names = [f.name for f in fields(preset) if not f.kw_only]  # type: ignore[arg-type]
        options: dict[str, Any] = {}
        for k, part in enumerate(split_outside(found[2] or "", ",")):
            if not part:
                continue
            key, equals, value = part.partition("=")
            if not equals:
                if k >= len(names):
                    raise InputError(f"{found[1]} has {len(names)} options, got more in '{text}'")
                key, value = names[k], part
            key = key.strip()
            if key in options:
                raise InputError(f"the option '{key}' of {found[1]} is given twice")
            options[key] = value.strip()
        return self._with(found[1].lower(), preset, options)

    def from_table(self, table: Mapping[str, Any]) -> T:
        """Return the choice of a table: ``name`` and ``options``, or ``name`` and its options.

        Raises
        ------
        InputError
            For an unknown name or option, or a value that cannot be meant.
        """
        rest = dict(table)
        name = rest.pop("name", None)
        if not isinstance(name, str):
            raise InputError(f'a {self.what} needs its name: name = "{next(iter(self))}"')
        inner = rest.pop("options", {})
        if not isinstance(inner, Mapping):
            raise InputError(f"the options of {name} must be a table, got {inner!r}")
        name = name.strip().lower()
        return self._with(name, self._preset(name), {**rest, **inner})

    def name_of(self, choice: T) -> str:
        """Return the name whose options are nearest to those of a choice.

        Raises
        ------
        InputError
            If no name is of its type.
        """
        near = [(len(_changed(choice, own)), name) for name, own in self._own.items()
                if type(own) is type(choice)]  # fmt: skip
        near += [] if near else [
            (len(_changed(choice, self[name])), name) for name in list(self._entries)
            if type(self[name]) is type(choice)
        ]  # fmt: skip
        if not near:
            raise InputError(f"{choice!r} is not registered as a {self.what}")
        # The first of the nearest: presets stand in the order of their importance.
        least = min(count for count, _ in near)
        return next(name for count, name in near if count == least)

    def to_table(self, choice: T) -> dict[str, Any]:
        """Return the name of a choice and the options that differ from the name's own."""
        name = self.name_of(choice)
        return {"name": name, "options": {
            key: value.to_table() if key in self._nested and value is not None else value
            for key, value in _changed(choice, self[name]).items()
        }}  # fmt: skip

    def text(self, choice: T) -> str:
        """Return the shortest text that `parse` makes the choice of again."""
        name = self.name_of(choice)
        options = [f"{key}={_text(value)}" for key, value in _changed(choice, self[name]).items()]
        return f"{name}({', '.join(options)})" if options else name

    def _preset(self, name: str) -> T:
        if name not in self:
            raise InputError(
                f"unknown {self.what} '{name}'{near(name, self)}; the {self.what}s are "
                f"{', '.join(self)}"
            )
        return self[name]

    def _with(self, name: str, preset: T, options: Mapping[str, Any]) -> T:
        known: dict[str, Any] = {f.name: f for f in fields(preset)}  # type: ignore[arg-type]
        hints = get_type_hints(type(preset)) if options else {}
        values = {}
        for key, value in options.items():
            if key not in known:
                raise InputError(
                    f"{name} has no option '{key}'{near(key, known)}; it has {', '.join(known)}"
                )
            if key in self._nested:
                values[key] = self._nested[key](value)
            else:
                unit = known[key].metadata.get("unit")
                values[key] = _value(value, hints[key], unit, f"{name}: {key}")
        return replace(preset, **values)  # type: ignore[type-var]


def _changed(choice: Any, preset: Any) -> dict[str, Any]:
    return {
        f.name: getattr(choice, f.name)
        for f in fields(choice)
        if getattr(choice, f.name) != getattr(preset, f.name)
    }


def _text(value: Any) -> str:
    if value is None or isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, float) else str(value)


def _value(value: Any, kind: Any, unit: str | None, what: str) -> Any:
    """Return a value as its field's type, from a text or from a table."""
    kinds = get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)
    text = value.strip() if isinstance(value, str) else None
    if NoneType in kinds and (value is None or text == "none"):
        return None
    if bool in kinds:
        if isinstance(value, bool) or text in ("true", "false"):
            return value if text is None else text == "true"
        raise InputError(f"{what} must be true or false, got {value!r}")
    if text is not None and float in kinds and unit is not None and not _number(text):
        return parse(text, unit, what)
    number = _number(text) if text is not None else value
    if isinstance(number, bool) or number is None:
        number = None
    if int in kinds and isinstance(number, int | float) and float(number).is_integer():
        return int(number)
    if float in kinds and isinstance(number, int | float):
        return float(number)
    if str in kinds and text is not None and _PLAIN.fullmatch(text):
        return text
    wanted = " or ".join(getattr(k, "__name__", str(k)) for k in kinds if k is not NoneType)
    raise InputError(f"{what} must be {wanted}, got {value!r}")


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
