"""Knowledge files as text: learned tables are put in place of the old ones, all else stays as people wrote it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import perception
from perception.knowledge_base import load_knowledge

_HEADER = re.compile(r"^\[+\s*([A-Za-z0-9_-]+)")


def knowledge_text(name_or_path: str) -> str:
    """Text of a shipped or user's knowledge file; raises InputError where it does not load."""
    load_knowledge(name_or_path)
    shipped = Path(perception.__file__).parent / "knowledge" / f"{name_or_path}.toml"
    path = Path(name_or_path)
    return (path if path.suffix == ".toml" else shipped).read_text(encoding="utf-8")


def replace_tables(text: str, tables: Mapping[str, str]) -> str:
    """``text`` with each top-level table of ``tables``, its sub-tables too, replaced; new ones come last.

    Comments right above a header belong to the table that it begins.
    """
    parts = _split(text)
    unknown = sorted(set(tables) - {name for name, _ in parts})
    done: set[str] = set()
    written = []
    for name, part in parts:
        if name not in tables:
            written.append(part)
        elif name not in done:
            done.add(name)
            written.append(tables[name].rstrip("\n") + "\n\n")
    return "".join(written) + "".join(f"\n{tables[name].rstrip()}\n" for name in unknown)


def _split(text: str) -> list[tuple[str, str]]:
    """Name of the top-level table and text of each part, the part before the first header under ''."""
    parts: list[tuple[str, str]] = []
    name, held, comments = "", list[str](), list[str]()
    for line in text.splitlines(keepends=True):
        header = _HEADER.match(line)
        if header and header[1] != name:
            parts.append((name, "".join(held)))
            name, held = header[1], [*comments, line]
        elif line.startswith("#"):
            comments.append(line)
            continue
        else:
            held += [*comments, line]
        comments = []
    parts.append((name, "".join([*held, *comments])))
    return parts
