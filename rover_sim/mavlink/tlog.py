"""Telemetry logs as ground stations write them: 8 bytes of big-endian microseconds, then the raw frame."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

SIMULATED_EPOCH_S = 1_577_836_800.0  # 2020-01-01T00:00:00Z: where simulated time begins, so that logs repeat


class TlogWriter:
    """Writes a log; it is a transport too, so the vehicle can treat it as one more listener."""

    is_stream = False

    def __init__(self, path: Path, epoch_s: float = SIMULATED_EPOCH_S) -> None:
        self._file = path.open("wb")
        self._epoch_s = epoch_s

    def record(self, frame: bytes, time_s: float) -> None:
        """Append one frame at a time in seconds since the epoch given."""
        self._file.write(struct.pack(">Q", round((self._epoch_s + time_s) * 1e6)) + frame)

    def peers(self, time_s: float) -> tuple[str, ...]:  # noqa: ARG002  (the interface passes the time)
        """The file is the only peer."""
        return () if self._file.closed else ("tlog",)

    def send(self, frame: bytes, peer: str, time_s: float) -> None:  # noqa: ARG002
        """Record what is sent."""
        self.record(frame, time_s)

    def receive(self, time_s: float) -> list[tuple[str, bytes]]:  # noqa: ARG002
        """Nothing ever arrives from a file."""
        return []

    def handles(self) -> tuple[int, ...]:
        """Nothing comes from a log."""
        return ()

    def close(self) -> None:
        """Finish the file."""
        self._file.close()


def read_tlog(path: Path) -> Iterator[tuple[float, bytes]]:
    """Time in seconds (since 1970) and raw frame of each record; a last record cut short is left out."""
    data = path.read_bytes()
    at = 0
    while at + 18 <= len(data):
        (microseconds,) = struct.unpack_from(">Q", data, at)
        two = data[at + 8] == 0xFD
        length = data[at + 9] + (12 if two else 8) + (13 if two and data[at + 10] & 1 else 0)
        if at + 8 + length > len(data):
            return
        yield microseconds / 1e6, data[at + 8 : at + 8 + length]
        at += 8 + length
