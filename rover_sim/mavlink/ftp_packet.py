"""The packet inside FILE_TRANSFER_PROTOCOL: MAVLink's file transfer (https://mavlink.io/en/services/ftp.html)."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from enum import IntEnum

PAYLOAD_BYTES = 251
DATA_BYTES = 239  # at most in one packet
_HEADER = struct.Struct("<HBBBBBBI")  # sequence, session, opcode, size, request's opcode, burst end, padding, offset


class Opcode(IntEnum):
    """What a packet asks for or answers."""

    NONE = 0
    TERMINATE_SESSION = 1
    RESET_SESSIONS = 2
    LIST_DIRECTORY = 3
    OPEN_FILE_RO = 4
    READ_FILE = 5
    CREATE_FILE = 6
    WRITE_FILE = 7
    REMOVE_FILE = 8
    CREATE_DIRECTORY = 9
    REMOVE_DIRECTORY = 10
    OPEN_FILE_WO = 11
    TRUNCATE_FILE = 12
    RENAME = 13
    CALC_FILE_CRC32 = 14
    BURST_READ_FILE = 15
    ACK = 128
    NAK = 129


class Failure(IntEnum):
    """The first byte of a NAK's data."""

    FAIL = 1
    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    EOF = 6
    UNKNOWN_COMMAND = 7
    FILE_PROTECTED = 9
    FILE_NOT_FOUND = 10


class FtpError(Exception):
    """A request that cannot be done; carries the failure for its sender."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(f"file transfer refused: {failure.name}")
        self.failure = failure


@dataclass(frozen=True)
class Packet:
    """One request or answer."""

    sequence: int
    session: int
    opcode: int
    data: bytes = b""
    request_opcode: int = 0
    burst_ends: bool = False
    offset: int = 0
    size: int = 0  # as sent: bytes of data, or bytes wanted of a file

    @classmethod
    def decode(cls, payload: bytes) -> Packet:
        """The packet in 251 bytes; ``data`` is cut to the size that the sender gave."""
        sequence, session, opcode, size, request, burst, _, offset = _HEADER.unpack_from(payload)
        data = payload[_HEADER.size : _HEADER.size + size]
        return cls(sequence, session, opcode, data, request, bool(burst), offset, size)

    def encode(self) -> bytes:
        """The packet as 251 bytes."""
        size = len(self.data) or self.size
        header = _HEADER.pack(
            self.sequence,
            self.session,
            self.opcode,
            size,
            self.request_opcode,
            self.burst_ends,
            0,
            self.offset,
        )
        return (header + self.data).ljust(PAYLOAD_BYTES, b"\0")


def checksum(data: bytes, so_far: int = 0) -> int:
    """CRC-32 as file transfer counts it: the usual polynomial, begun with 0 and not inverted at the end."""
    return zlib.crc32(data, so_far ^ 0xFFFFFFFF) ^ 0xFFFFFFFF
