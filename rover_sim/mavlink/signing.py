"""Message signing: one key, one clock and one memory for all links.

Rules: https://mavlink.io/en/guide/message_signing.html. Frames are checked here and not by pymavlink, which stores the
timestamp of a frame before it looks at the signature: one forged frame from the future then locks the real sender out.
Here a frame that is refused changes nothing.
"""

from __future__ import annotations

import hashlib
import hmac
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rover_sim.errors import InputError
from rover_sim.mavlink.dialect import SIGNATURE_BYTES, Message, is_signed, mavlink
from rover_sim.mavlink.signing_file import SigningFile, Stream, Times, load_key

TICKS_PER_S = 100_000  # timestamps count 10 us
_EPOCH_S = 1_420_070_400  # 2015-01-01T00:00:00Z
KEY_BYTES = 32
_HASH_BYTES = 6
_STALE_TICKS = 60 * TICKS_PER_S  # the age at which a sender's first frame is refused
_AHEAD_TICKS = 60 * TICKS_PER_S  # a frame from further ahead is refused: believed, it would lock its sender out later
_RESERVED_TICKS = 2 * TICKS_PER_S  # that the file is ahead of what has happened, so that it need not be written often
_MOST_STREAMS = 256
_ALWAYS_ALLOWED = (mavlink.MAVLINK_MSG_ID_RADIO_STATUS,)  # radios sign nothing


@dataclass(frozen=True)
class Signature:
    """The 13 bytes behind a signed frame."""

    link: int
    ticks: int
    digest: bytes

    @classmethod
    def of(cls, frame: bytes) -> Signature:
        """The signature of a signed frame."""
        tail = frame[-SIGNATURE_BYTES:]
        return cls(tail[0], int.from_bytes(tail[1:7], "little"), tail[7:])


class Signing:
    """Signs what is sent and decides what is believed; without a key nothing is signed and everything believed."""

    def __init__(self, key: bytes | None, clock: Callable[[], float], file: SigningFile | None = None) -> None:
        """``clock``: seconds since 1970; ``file``: keeps the timestamps over restarts."""
        self.key = key
        self.refused = 0  # frames so far
        self._clock = clock
        self._file = file
        self._times = Times() if file is None else file.load()
        self._reserved = self._times  # as in the file: never behind what has happened

    @property
    def active(self) -> bool:
        """Whether there is a key."""
        return self.key is not None

    def set_key(self, key: bytes | None, first_ticks: int = 0) -> None:
        """Change the key, or stop signing; what is sent is stamped from ``first_ticks`` on, unless that is absurd."""
        self.key = key
        if first_ticks <= self._now() + _AHEAD_TICKS:
            self._times = self._times.sent_at(max(first_ticks, self._times.sent))

    def stamp(self) -> int:
        """The timestamp of the next frame to send: the clock's, and later than all before."""
        now, last = self._now(), self._times.sent
        if last > now + _AHEAD_TICKS:  # from a time when our clock was wrong
            last = 0
        self._times = self._times.sent_at(max(now, last + 1))
        self._keep(self._times.sent > self._reserved.sent)
        return self._times.sent

    def believes(self, frame: bytes, message: Message) -> bool:
        """Whether a valid frame is to be obeyed."""
        if self.key is None or message.get_msgId() in _ALWAYS_ALLOWED or self._is_new_and_ours(self.key, frame):
            return True
        self.refused += 1
        return False

    @property
    def trouble(self) -> str:
        """Why the timestamps could not be kept, if so."""
        return "" if self._file is None else self._file.trouble

    def close(self) -> None:
        """Keep the exact timestamps."""
        if self._file is not None:
            self._file.save(self._times)

    def _is_new_and_ours(self, key: bytes, frame: bytes) -> bool:
        if not is_signed(frame):
            return False
        signature = Signature.of(frame)
        if not hmac.compare_digest(digest(key, frame[:-_HASH_BYTES]), signature.digest):
            return False
        stream, now = Stream(signature.link, frame[5], frame[6]), self._now()
        last = self._times.streams.get(stream)
        if last is None or last > now + _AHEAD_TICKS:  # never heard, or in a time when our clock was wrong
            last = now - _STALE_TICKS - 1
            if stream not in self._times.streams and len(self._times.streams) >= _MOST_STREAMS:
                return False
        if not last < signature.ticks <= now + _AHEAD_TICKS:
            return False
        self._times = self._times.heard_at(stream, signature.ticks)
        self._keep(signature.ticks > self._reserved.streams.get(stream, -1))
        return True

    def _now(self) -> int:
        return max(0, round((self._clock() - _EPOCH_S) * TICKS_PER_S))

    def _keep(self, needed: bool) -> None:
        """Write the file before anything happens that it does not cover."""
        if self._file is not None and needed:
            self._reserved = self._times.later(_RESERVED_TICKS)
            self._file.save(self._reserved)


def open_signing(key_file: Path | None, clock: Callable[[], float], shown: Path) -> Signing:
    """Signing with the key of a file, the timestamps kept beside it; without one, none until a station sets it up.

    Raises InputError for a file that is wrong, that lies in ``shown`` (a folder that anyone on a link can read), or
    beside which nothing can be written.
    """
    if key_file is None:
        return Signing(None, clock)
    if key_file.resolve().is_relative_to(shown.resolve()):
        raise InputError(f"--signing-key {key_file}: lies in {shown}, which is shown over the link; keep it elsewhere")
    signing = Signing(load_key(key_file), clock, SigningFile(key_file.with_name(f"{key_file.name}.timestamps")))
    signing.close()
    if signing.trouble:
        raise InputError(f"--signing-key {signing.trouble}")
    return signing


def digest(key: bytes, signed: bytes) -> bytes:
    """The six bytes that end a signed frame; ``signed``: all before them."""
    return hashlib.sha256(key + signed).digest()[:_HASH_BYTES]
