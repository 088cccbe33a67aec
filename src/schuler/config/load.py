"""Reading a scenario: TOML to `Scenario`, or one sentence with the file and the line."""

from __future__ import annotations

import copy
import datetime as dt
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from schuler._files import parse_toml, read_toml
from schuler.config.locate import Path as Keys
from schuler.config.locate import line_of, locate
from schuler.config.override import apply
from schuler.config.scenario import Scenario
from schuler.earth import Site
from schuler.errors import InputError, located
from schuler.sensors import GRADES, ImuSpec

__all__ = ["load_scenario", "parse_scenario", "with_overrides"]

#: a problem: where in the tables, and what
Problem = tuple[Keys, str]


def load_scenario(path: str | Path, overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Read a scenario file.

    Parameters
    ----------
    path : str or Path
    overrides : mapping, optional
        Values that win over the file's, by dotted key: ``{"motion.heading": 30}``.

    Raises
    ------
    InputError
        With the file, the line, the key and what was expected there; of several errors the
        first, with how many more there are.

    Examples
    --------
    >>> sc.load_scenario("truck.toml").duration
    60.0
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not a text in UTF-8") from None
    try:
        data = parse_toml(text)
    except ValueError as error:
        raise InputError(_syntax(path, text, str(error))) from None
    lines = locate(text)
    given = overrides or {}
    with located(path):
        apply(data, copy.deepcopy(dict(given)))
        files = (path, *_inline_instruments(data, path.parent))
    set_outside = [tuple(int(k) if k.isdigit() else k for k in key.split(".")) for key in given]

    def place(keys: Keys) -> str:
        for outside in set_outside:
            if keys[: len(outside)] == outside:
                return f"{path}, as set from outside"
        return f"{path}, line {line_of(lines, keys)}"

    return replace(_checked(data, path.stem, place, lines, path.parent), files=files)


def parse_scenario(data: Mapping[str, Any], name: str = "scenario") -> Scenario:
    """Make a scenario of plain values, as a file has them.

    Parameters
    ----------
    data : mapping
        Instruments are named grades or tables; there is no file beside which to look for others.
    name : str
        Used where the data have none.

    Raises
    ------
    InputError
        With the key and what was expected there.

    Examples
    --------
    >>> scene = parse_scenario({
    ...     "duration": "10 s", "rate": "20 Hz", "seed": 1, "instrument": "navigation-fog",
    ...     "site": {"lat": 48.1}, "motion": {"kind": "static", "heading": 30},
    ... })
    >>> scene.samples
    200
    """
    return _checked(copy.deepcopy(dict(data)), name, lambda keys: name, {})


def with_overrides(scenario: Scenario, overrides: Mapping[str, Any]) -> Scenario:
    """Return a scenario with other values, by dotted key.

    Raises
    ------
    InputError
        With the key and what was expected there.
    """
    data = copy.deepcopy(dict(scenario.data))
    with located(scenario.name):
        apply(data, copy.deepcopy(dict(overrides)))
        _inline_instruments(data, scenario.folder)
    said = ", ".join(f"{key} = {value}" for key, value in overrides.items())
    return _checked(
        data, scenario.name, lambda keys: f"{scenario.name} with {said}", {}, scenario.folder
    )


def _syntax(path: Path, text: str, message: str) -> str:
    found = re.search(r"\(at line (\d+), column (\d+)\)", message)
    line = int(found[1]) if found else text.count("\n") + 1
    reason = re.sub(r" \(at .*\)$", "", message)
    return f"{path}, line {line}: is not valid TOML ({reason})"


def _inline_instruments(data: dict[str, Any], folder: Path) -> list[Path]:
    """Put a specification's file in the place of its name; return the files that were read."""
    files: list[Path] = []
    align = data.get("align")
    for table, key in ((data, "instrument"), (align, "spec")):
        if not isinstance(table, dict):
            continue
        value = table.get(key)
        if isinstance(value, str) and value not in GRADES and value.endswith(".toml"):
            file = folder / value
            ImuSpec.from_toml(file)
            found = read_toml(file)
            table[key] = {"name": file.stem, **found}
            files.append(file)
    return files


def _checked(
    data: dict[str, Any],
    name: str,
    place: Callable[[Keys], str],
    lines: dict[Keys, int],
    folder: Path = Path(),
) -> Scenario:
    from pydantic import ValidationError

    from schuler.config.schema import ScenarioFile

    problems: list[Problem] = []
    plain = _plain(data, (), problems)
    spec = _spec(data.get("instrument"), ("instrument",), problems)
    align = data.get("align")
    assumed = spec
    if isinstance(align, dict) and "spec" in align:
        assumed = _spec(align["spec"], ("align", "spec"), problems)
    file = None
    try:
        file = ScenarioFile.model_validate(data)
    except ValidationError as error:
        problems += [_problem(item, data) for item in error.errors()]
    if problems or file is None:
        # In the order of the file: what is missing counts at its table.
        problems.sort(key=lambda p: line_of(lines, p[0]))
        keys, text = problems[0]
        more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        label = ".".join(map(str, keys))
        raise InputError(f"{place(keys)}: {label + ': ' if label else ''}{text}{more}")
    plain.setdefault("name", file.name or name)

    def bias(value: tuple[float, ...] | None) -> Any:
        return None if value is None else np.array(value, np.float64)

    return Scenario(
        name=file.name or name,
        site=Site(**file.site.model_dump()),
        duration=file.duration,
        rate=file.rate,
        seed=file.seed,
        spec=spec,
        gyro_bias=bias(file.biases.gyro),
        accel_bias=bias(file.biases.accelerometer),
        temperature_rate=file.temperature_rate,
        methods=file.align.methods,
        at=file.align.at,
        align_spec=assumed,
        data=plain,
        table=file.motion,
        folder=folder,
    )


def _plain(value: Any, keys: Keys, problems: list[Problem]) -> Any:
    """Return plain tables, lists, numbers and texts; note dates, which no key takes."""
    if isinstance(value, dict):
        return {k: _plain(v, (*keys, k), problems) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v, (*keys, k), problems) for k, v in enumerate(value)]
    if isinstance(value, dt.date | dt.time):
        problems.append((keys, f"expected a number or a text, got the date or time {value}"))
        return str(value)
    return value


def _spec(value: Any, keys: Keys, problems: list[Problem]) -> ImuSpec | None:
    """Return an instrument; note what is wrong with it, key by key."""
    if value is None:
        return None
    if isinstance(value, ImuSpec):
        return value
    if isinstance(value, str):
        if value in GRADES:
            return GRADES[value]
        problems.append(
            (keys, f"expected a grade ({', '.join(GRADES)}), a .toml file or a table, got "
             f"'{value}'")
        )  # fmt: skip
        return None
    if not isinstance(value, dict):
        problems.append((keys, f"expected the name of a grade or a table, got {value!r}"))
        return None
    try:
        return ImuSpec.from_dict(value)
    except InputError as error:
        found = list(_spec_problems(value, keys))
        text = str(error).removeprefix("instrument specification: ")
        problems += found or [(keys, text)]
    return None


def _spec_problems(table: dict[str, Any], keys: Keys) -> Any:
    """Give the place of each wrong figure, by trying each alone."""
    empty: dict[str, Any] = {"gyro": {}, "accelerometer": {}}
    for key, value in table.items():
        if key in empty and isinstance(value, dict):
            for name, figure in value.items():
                # The time belongs to its process and is tried with it.
                beside = {"gauss_markov_time": "1 s"} if name == "gauss_markov" else {}
                trial = {**empty, key: {**beside, name: figure}}
                if text := _refusal(trial):
                    yield (*keys, key, name), text.removeprefix(f"{key}.{name}: ")
        elif text := _refusal({**empty, key: value}):
            yield (*keys, key), text


def _refusal(trial: dict[str, Any]) -> str | None:
    try:
        ImuSpec.from_dict(trial)
    except InputError as error:
        return str(error).removeprefix("instrument specification: ")
    return None


def _problem(item: Any, data: dict[str, Any]) -> Problem:
    """Return where and what in a sentence, from one of pydantic's errors."""
    from difflib import get_close_matches

    keys, known = _keys(item["loc"], data)
    kind, context = item["type"], item.get("ctx") or {}
    value = item.get("input")
    if kind == "missing":
        return keys, "is missing"
    if kind == "extra_forbidden":
        near = get_close_matches(str(keys[-1]), known, 1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        return keys, f"unknown key{hint if hint else '; known: ' + ', '.join(known)}"
    if kind == "union_tag_not_found":
        return (*keys, "kind"), "is missing; " + _kinds(context)
    if kind == "union_tag_invalid":
        return (*keys, "kind"), f"{_kinds(context)}, got '{context.get('tag')}'"
    if kind == "literal_error":
        return keys, f"expected {context['expected']}, got {value!r}"
    for name, words in (
        ("greater_than", "more than"), ("greater_than_equal", "at least"),
        ("less_than_equal", "at most"),
    ):  # fmt: skip
        if kind == name:
            limit = context[{"greater_than": "gt", "greater_than_equal": "ge"}.get(name, "le")]
            return keys, f"expected {words} {limit:g}, got {value!r}"
    if kind == "too_short":
        return keys, "expected one element at least"
    if kind in ("list_type", "tuple_type"):
        return keys, f"expected an array, got {value!r}"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return keys, f"expected a table, got {value!r}"
    if kind.startswith("bool"):
        return keys, f"expected true or false, got {value!r}"
    if kind.startswith("string"):
        return keys, f"expected a text, got {value!r}"
    text = str(context.get("error") or item["msg"])
    return keys, text.removeprefix("Value error, ")


def _kinds(context: Mapping[str, Any]) -> str:
    return f"expected one of {str(context.get('expected_tags', '')) or _all_kinds()}"


def _all_kinds() -> str:
    from schuler.config.motions import KINDS

    return ", ".join(f"'{kind}'" for kind in KINDS)


def _keys(loc: tuple[int | str, ...], data: Any) -> tuple[Keys, list[str]]:
    """Return the path in the file, without the kinds that pydantic puts in, and the known keys."""
    from schuler.config.schema import known_keys

    keys: list[str | int] = []
    where: Any = data
    for part in loc:
        # pydantic names the chosen kind after the table; no table has a key like its kind.
        if isinstance(where, dict) and part == where.get("kind"):
            continue
        keys.append(part)
        if isinstance(where, dict):
            where = where.get(str(part))
        elif isinstance(where, list) and isinstance(part, int) and part < len(where):
            where = where[part]
        else:
            where = None
    return tuple(keys), known_keys(tuple(loc[:-1]))
