"""TOML files to frozen msgspec structures and back; a complaint is one line with file, key, value and remedy."""

from __future__ import annotations

import difflib
import json
import math
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin

import msgspec

from worlds.errors import ScenarioError

Limits = Mapping[str, tuple[float, float]]
S = TypeVar("S", bound=msgspec.Struct)


class Table(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a file: a mistyped key is an error."""


_WORDS = {
    "float": "a number",
    "int": "a whole number",
    "str": "text",
    "bool": "true or false",
    "object": "a table",
    "array": "a list",
}


def read_table(path: Path) -> dict[str, Any]:
    """The table in a TOML file; unreadable or invalid files raise a `ScenarioError` with the line of the fault."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{path}: not valid TOML: {error}") from error
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path}: not a text file in UTF-8 (byte {error.start})") from error
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}") from error


def convert_table(table: Mapping[str, Any], structure: type[S], source: str) -> S:
    """``table`` as a ``structure``; unknown keys, missing keys and wrong types raise a `ScenarioError`."""
    _check_keys(table, structure, "", source)
    try:
        return msgspec.convert(dict(table), structure)
    except msgspec.ValidationError as error:
        raise ScenarioError(f"{source}: {_type_message(str(error), table, structure)}") from error


def check_limits(value: msgspec.Struct, limits: Limits, source: str) -> None:
    """Raise a `ScenarioError` for the first number that is not finite or outside the closed range of its key."""
    for key, general, number in _numbers(value, "", ""):
        if not math.isfinite(number):
            raise ScenarioError(f"{source}: {key} = {number}: must be a finite number")
        low, high = limits.get(general, (-math.inf, math.inf))
        if not low <= number <= high:
            raise ScenarioError(f"{source}: {key} = {number:g}: allowed are {low:g} to {high:g}")


def numeric_keys(value: msgspec.Struct) -> set[str]:
    """The keys of all numbers in ``value``, without list positions, as `check_limits` looks them up."""
    return {general for _, general, _ in _numbers(value, "", "")}


def dump_toml(value: msgspec.Struct) -> str:
    """``value`` as TOML with every key; a key that holds None is left as a comment, as TOML has no null."""
    lines: list[str] = []
    _dump_table(value, "", lines)
    return "\n".join(lines).strip() + "\n"


def _check_keys(table: Mapping[str, Any], structure: type[msgspec.Struct], prefix: str, source: str) -> None:
    fields = {field.encode_name: field.type for field in msgspec.structs.fields(structure)}
    for key, value in table.items():
        if key not in fields:
            close = difflib.get_close_matches(key, fields, n=1)
            hint = f"did you mean '{close[0]}'? " if close else ""
            raise ScenarioError(
                f"{source}: {prefix}{key} = {_show(value)}: unknown key; {hint}allowed here: {', '.join(fields)}"
            )
        inner = _inner_structure(fields[key])
        if inner is None:
            continue
        if isinstance(value, dict):
            _check_keys(value, inner, f"{prefix}{key}.", source)
        elif isinstance(value, list):
            for index, item in enumerate(value):
                if isinstance(item, dict):
                    _check_keys(item, inner, f"{prefix}{key}[{index}].", source)


def _inner_structure(kind: Any) -> type[msgspec.Struct] | None:
    """The structure that a field holds, alone, as a list or unless it is None, if it holds one."""
    if get_origin(kind) is UnionType:
        return _inner_structure(get_args(kind)[0])
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        return kind
    if get_origin(kind) is tuple:
        return _inner_structure(get_args(kind)[0])
    return None


def _type_message(text: str, table: Mapping[str, Any], structure: type[msgspec.Struct]) -> str:
    """What msgspec says, in the words of a scenario file."""
    problem, _, place = text.partition(" - at `$")
    path = re.findall(r"[^.\[\]`]+", place)
    key = place.rstrip("`").lstrip(".")
    missing = re.match(r"Object missing required field `(.+)`", problem)
    if missing:
        return f"{key + '.' if key else ''}{missing[1]}: this key is required"
    value, kind = _look_up(path, table, structure)
    return f"{key} = {_show(value)}: {_expectation(problem, kind)}"


def _expectation(problem: str, kind: Any) -> str:
    if get_origin(kind) is Union:  # a choice that may be left out
        kind = get_args(kind)[0]
    if get_origin(kind) is Literal:
        return f"allowed are {', '.join(map(str, get_args(kind)))}"
    length = re.match(r"Expected `array` of length (\d+), got (\d+)", problem)
    if length:
        return f"expected a list of {length[1]} numbers, got {length[2]}"
    expected = re.match(r"Expected `(\w+)( \| null)?`, got `(\w+)`", problem)
    if not expected:
        return problem
    wanted, got = expected[1], expected[3]
    return f"expected {_WORDS.get(wanted, wanted)}, got {_WORDS.get(got, got)}"


def _look_up(path: list[str], table: Mapping[str, Any], structure: type[msgspec.Struct]) -> tuple[Any, Any]:
    """The value at ``path`` and the type that it should have."""
    value: Any = table
    kind: Any = structure
    for step in path:
        if isinstance(value, dict):
            value = value[step]
            inside = msgspec.structs.fields(_inner_structure(kind) or structure)
            kind = next(field.type for field in inside if field.encode_name == step)
        else:
            value = value[int(step)]
            arguments = get_args(kind)
            kind = arguments[0] if arguments else kind
    return value, kind


def _numbers(value: Any, key: str, general: str) -> Iterator[tuple[str, str, float]]:
    """Key with positions, key without them, and value of every number in a structure."""
    if isinstance(value, msgspec.Struct):
        dot = "." if key else ""
        for field in msgspec.structs.fields(value):
            name = field.encode_name
            yield from _numbers(getattr(value, field.name), f"{key}{dot}{name}", f"{general}{dot}{name}")
    elif isinstance(value, tuple):
        for index, item in enumerate(value):
            yield from _numbers(item, f"{key}[{index}]", general)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield key, general, value


def _dump_table(value: msgspec.Struct, name: str, lines: list[str]) -> None:
    tables: list[tuple[str, Any]] = []
    for field in msgspec.structs.fields(value):
        item = getattr(value, field.name)
        if isinstance(item, msgspec.Struct) or (_inner_structure(field.type) and isinstance(item, tuple)):
            tables.append((field.encode_name, item))
        elif item is None:
            lines.append(f"# {field.encode_name} is not set")
        else:
            lines.append(f"{field.encode_name} = {_literal(item)}")
    for key, item in tables:
        path = f"{name}.{key}" if name else key
        if isinstance(item, msgspec.Struct):
            lines.extend(("", f"[{path}]"))
            _dump_table(item, path, lines)
        else:
            for entry in item:
                lines.extend(("", f"[[{path}]]"))
                _dump_table(entry, path, lines)


def _literal(value: Any) -> str:
    """A TOML literal; ``repr`` of a float reads back to the same bits."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return "[" + ", ".join(_literal(item) for item in value) + "]"
    if isinstance(value, str):
        # JSON and TOML strings agree but for the delete character.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)


def _show(value: Any) -> str:
    """A value in a message: short, on one line."""
    text = json.dumps(value, default=str, ensure_ascii=False)
    return text if len(text) <= 60 else text[:57] + "..."
