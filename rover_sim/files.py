"""Files written whole or not at all."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rover_sim.errors import InputError


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Temporary name beside ``path`` to write to; it takes the name ``path`` only if nothing failed."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o644)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write ``text`` as UTF-8, atomically."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, value: Any) -> None:
    """Write ``value`` as indented JSON, atomically; NaN and infinity are refused."""
    write_text(path, json.dumps(value, indent=2, allow_nan=False) + "\n")


def output_folder(path: Path) -> Path:
    """Make ``path`` and return it; raises InputError where it cannot be a folder that we may write to."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        text = f"--out {path}: cannot be made ({error.strerror}); give a folder that may be written"
        raise InputError(text) from error
    if not os.access(path, os.W_OK):
        raise InputError(f"--out {path}: not writable; give a folder that may be written")
    return path
