"""MAVLink 2 frames: pymavlink's generated dialect, one packer a component and channel, one parser a peer.

pymavlink's connection layer (``mavutil``) is not used: it picks the wire version from the environment, keeps one
dialect a process and cannot answer a single UDP peer. The dialect is ``development``, which is ``common`` and the
messages about modes (435 to 437), with what ``extensions.py`` adds: the rover sends and understands nothing outside it.
"""

from __future__ import annotations

from typing import Any, Protocol

from pymavlink.dialects.v20 import development as mavlink

from rover_sim.mavlink.extensions import EkfStatusReport, ekf_status_report, mission_ack, mission_count, mission_current

__all__ = [
    "MAVLINK_1",
    "MAVLINK_2",
    "SIGNATURE_BYTES",
    "SIGNED_FLAG",
    "EkfStatusReport",
    "Message",
    "Packer",
    "Parser",
    "Signer",
    "ekf_status_report",
    "is_signed",
    "mavlink",
    "mission_ack",
    "mission_count",
    "mission_current",
    "unsigned",
]

Message = Any  # pymavlink's generated classes carry no types

MAVLINK_1, MAVLINK_2 = 0xFE, 0xFD  # first byte of a frame
_HEADER = {MAVLINK_1: 6, MAVLINK_2: 10}  # bytes of the MAVLink 1 and 2 header
_CHECKSUM = 2
SIGNATURE_BYTES = 13
SIGNED_FLAG = 0x01  # the only incompatibility flag that we understand


class Signer(Protocol):
    """What a packer needs to sign, and a parser to believe."""

    key: bytes | None

    def stamp(self) -> int:
        """The timestamp of the next frame."""
        ...

    def believes(self, frame: bytes, message: Message) -> bool:
        """Whether a valid frame is to be obeyed."""
        ...


class Packer:
    """Packs the messages of one component for one channel; the sequence number is counted here.

    With a signer that has a key, frames of MAVLink 2 are signed as those of a link number.
    """

    def __init__(self, system: int, component: int, signer: Signer | None = None, link: int = 0) -> None:
        self._signer = signer
        self._mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self._mav.signing.link_id = link
        self.version_1 = False  # for a peer that speaks MAVLink 1 only

    def knows(self, message: Message) -> bool:
        """Whether the message can be sent: MAVLink 1 has 256 of them."""
        return not self.version_1 or message.id <= 255

    def pack(self, message: Message) -> bytes:
        """The frame of a message; a message object may be packed any number of times."""
        signing, signer = self._mav.signing, self._signer
        signing.sign_outgoing = signer is not None and signer.key is not None and not self.version_1
        if signing.sign_outgoing and signer is not None:
            signing.secret_key, signing.timestamp = signer.key, signer.stamp()
        frame: bytes = message.pack(self._mav, force_mavlink1=self.version_1)
        self._mav.seq = (self._mav.seq + 1) % 256
        return frame


class Parser:
    """Cuts one peer's bytes into frames and decodes them; what is no valid frame is skipped byte by byte.

    Frames are cut here and not by pymavlink's ``parse_buffer``, which throws away everything that a garbage byte
    claims as its frame, good frames included. Frames of unknown messages are dropped, and those that a signer refuses.
    """

    def __init__(self, signer: Signer | None = None) -> None:
        self._signer = signer
        self._mav = mavlink.MAVLink(None)
        self._rest = b""

    def datagram(self, data: bytes) -> list[Message]:
        """Messages of one datagram, which ends its last frame."""
        messages: list[Message] = []
        while data:
            found, data = self._split(data)
            messages += found
            data = data[1:]  # what claims more than there is was no frame
        return messages

    def stream(self, data: bytes) -> list[Message]:
        """Messages completed by the next bytes of a stream."""
        messages, self._rest = self._split(self._rest + data)
        return messages

    def _split(self, data: bytes) -> tuple[list[Message], bytes]:
        messages: list[Message] = []
        at = 0
        while at < len(data):
            length = _frame_length(data, at)
            if length is None:
                return messages, data[at:]
            frame = data[at : at + length]
            message = self._decode(frame) if length else None
            at += length if message is not None else 1
            known = message is not None and not isinstance(message, mavlink.MAVLink_unknown)
            if known and (self._signer is None or self._signer.believes(frame, message)):
                messages.append(message)
        return messages, b""

    def _decode(self, frame: bytes) -> Message | None:
        try:
            return self._mav.decode(bytearray(frame))
        except mavlink.MAVError:
            return None


def is_signed(frame: bytes | bytearray) -> bool:
    """Whether a frame carries a signature, right or wrong."""
    return frame[0] == MAVLINK_2 and bool(frame[2] & SIGNED_FLAG)


def unsigned(message: Message) -> bytes:
    """The frame of a received message without its signature, which is no one else's business."""
    frame = bytearray(message.get_msgbuf())
    if not is_signed(frame):
        return bytes(frame)
    frame[2] &= ~SIGNED_FLAG
    body = bytes(frame[: -SIGNATURE_BYTES - _CHECKSUM])
    checksum = mavlink.x25crc(body[1:])
    checksum.accumulate(bytes([message.crc_extra]))
    return body + int(checksum.crc).to_bytes(_CHECKSUM, "little")


def _frame_length(data: bytes, at: int) -> int | None:
    """Length of the frame that begins at ``at``; 0 if none can, None if its end is not there yet."""
    header = _HEADER.get(data[at])
    if header is None:
        return 0
    if len(data) < at + header:
        return None
    length = header + data[at + 1] + _CHECKSUM
    if header == _HEADER[MAVLINK_2]:
        if data[at + 2] & ~SIGNED_FLAG:
            return 0
        length += SIGNATURE_BYTES if data[at + 2] & SIGNED_FLAG else 0
    return length if len(data) >= at + length else None
