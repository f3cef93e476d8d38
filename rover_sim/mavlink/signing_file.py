"""The key of message signing, and the timestamps that must outlive the program, as files."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from rover_sim.errors import InputError
from rover_sim.files import write_json

_MOST_TICKS = 2**48 - 1


class Stream(NamedTuple):
    """Who signs: a component of a system on one of its links."""

    link: int
    system: int
    component: int


@dataclass(frozen=True)
class Times:
    """The last timestamp sent, and the last believed of each stream."""

    sent: int = 0
    streams: Mapping[Stream, int] = field(default_factory=dict)

    def sent_at(self, ticks: int) -> Times:
        """After sending a frame."""
        return replace(self, sent=ticks)

    def heard_at(self, stream: Stream, ticks: int) -> Times:
        """After believing a frame."""
        return replace(self, streams={**self.streams, stream: ticks})

    def later(self, ticks: int) -> Times:
        """All of them that much later."""
        return Times(self.sent + ticks, {stream: last + ticks for stream, last in self.streams.items()})


class SigningFile:
    """Timestamps beside the key: ``{"sent": N, "streams": {"LINK/SYSTEM/COMPONENT": N}}``."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.trouble = ""  # why the file could not be written, if so

    def load(self) -> Times:
        """The timestamps, none if there is no file yet; raises InputError for a file that is wrong."""
        if not self.path.exists():
            return Times()
        try:
            stored = json.loads(self.path.read_text(encoding="utf-8"))
            streams = {Stream(*map(int, name.split("/"))): ticks for name, ticks in stored["streams"].items()}
            sent = stored["sent"]
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{self.path}: not a file of signing timestamps; remove it to begin anew") from error
        if not all(type(ticks) is int and 0 <= ticks <= _MOST_TICKS for ticks in (sent, *streams.values())):
            raise InputError(f"{self.path}: a timestamp is not within 0 to 2^48; remove the file to begin anew")
        return Times(sent, streams)

    def save(self, times: Times) -> None:
        """Write the timestamps, whole or not at all; a disk that fails is remembered in ``trouble``."""
        streams = {"/".join(map(str, stream)): ticks for stream, ticks in times.streams.items()}
        try:
            write_json(self.path, {"sent": times.sent, "streams": streams})
        except OSError as error:
            self.trouble = f"{self.path}: signing timestamps could not be kept ({error.strerror})"


def load_key(path: Path) -> bytes:
    """The 32 bytes of a key file: 64 hexadecimal digits, or a passphrase hashed as ArduPilot's ground stations do.

    Raises InputError for a file that cannot be read or is empty.
    """
    try:
        text = path.read_text(encoding="utf-8").rstrip("\r\n")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"--signing-key {path}: cannot be read; give a file of 64 hex digits or a passphrase"
        ) from error
    if not text:
        raise InputError(f"--signing-key {path}: is empty; give a file of 64 hex digits or a passphrase")
    return bytes.fromhex(text) if re.fullmatch("[0-9a-fA-F]{64}", text) else hashlib.sha256(text.encode()).digest()
