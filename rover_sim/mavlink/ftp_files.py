"""What file transfer shows: one folder, read only, and the parameters as a file.

Nothing outside the folder can be named: a path is taken apart and rebuilt below the folder, ``..`` and symbolic links
are no names, and hidden files (those still being written) are not there.
"""

from __future__ import annotations

import io
import os
import stat
from pathlib import Path
from typing import BinaryIO

from rover_sim.autopilot.parameters import ParameterTable
from rover_sim.mavlink import parameter_pack
from rover_sim.mavlink.ftp_packet import DATA_BYTES, Failure, FtpError

_MOST_BYTES = 2**32 - 1  # sizes and offsets have 32 bits
_FLAGS = ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY")  # those that the system has


class Files:
    """A folder's files (none without a folder) and the parameters."""

    def __init__(self, folder: Path | None, parameters: ParameterTable) -> None:
        self._root = None if folder is None else folder.resolve()
        self._parameters = parameters

    def open(self, path: bytes) -> tuple[BinaryIO, int]:
        """A file to read and its size now; raises FtpError. A file that grows is read as far as it was when opened."""
        text = _text(path)
        name, _, query = text.lstrip("/").partition("?")
        if name == parameter_pack.NAME:
            data = parameter_pack.packed_parameters(self._parameters, query)
            return io.BytesIO(data), len(data)
        place = self._place(text)
        if not stat.S_ISREG(_status(place).st_mode):
            raise FtpError(Failure.FILE_NOT_FOUND)
        try:
            handle = os.open(place, os.O_RDONLY | sum(getattr(os, flag, 0) for flag in _FLAGS))
        except OSError as error:
            raise FtpError(Failure.FILE_NOT_FOUND) from error
        file = os.fdopen(handle, "rb", buffering=0)
        size = os.fstat(handle).st_size
        if size > _MOST_BYTES:
            file.close()
            raise FtpError(Failure.FAIL)
        return file, size

    def entries(self, path: bytes) -> list[bytes]:
        """The entries of a folder by name: ``Dname`` or ``Fname<tab>size``, each ended by a zero; raises FtpError."""
        place = self._place(_text(path))
        found = []
        try:
            for child in sorted(place.iterdir()):
                entry = _entry(child)
                if entry is not None and len(entry) <= DATA_BYTES:
                    found.append(entry)
        except OSError as error:
            raise FtpError(Failure.FILE_NOT_FOUND) from error
        return found

    def _place(self, text: str) -> Path:
        """The file or folder of a path; ``/`` and an empty one are the folder itself."""
        if self._root is None:
            raise FtpError(Failure.FILE_NOT_FOUND)
        place = self._root
        for part in text.split("/"):
            if part:
                if not _is_name(part):
                    raise FtpError(Failure.FILE_NOT_FOUND)
                place /= part
                if stat.S_ISLNK(_status(place).st_mode):
                    raise FtpError(Failure.FILE_NOT_FOUND)
        return place


def _text(path: bytes) -> str:
    try:
        return path.partition(b"\0")[0].decode("utf-8")
    except UnicodeDecodeError as error:
        raise FtpError(Failure.FILE_NOT_FOUND) from error


def _is_name(part: str) -> bool:
    """Whether it can name something inside a folder; ``..`` begins with a dot as all hidden names do."""
    return not part.startswith(".") and not any(letter in "\\:" or not letter.isprintable() for letter in part)


def _status(place: Path) -> os.stat_result:
    try:
        return place.lstat()
    except (OSError, ValueError) as error:
        raise FtpError(Failure.FILE_NOT_FOUND) from error


def _entry(child: Path) -> bytes | None:
    """The line of a file or folder; None for what is not shown."""
    try:
        status = child.lstat()
        name = child.name.encode("utf-8")
    except (OSError, UnicodeEncodeError):  # gone meanwhile, or a name that no client could ask for
        return None
    if not _is_name(child.name):
        return None
    if stat.S_ISDIR(status.st_mode):
        return b"D" + name + b"\0"
    return b"F" + name + f"\t{status.st_size}".encode() + b"\0" if stat.S_ISREG(status.st_mode) else None
