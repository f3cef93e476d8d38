"""MAVLink 2 frames: pymavlink's generated dialect, one packer a component and channel, one parser a peer.

pymavlink's connection layer (``mavutil``) is not used: it picks the wire version from the environment, keeps one
dialect a process and cannot answer a single UDP peer. The dialect is ``development``, which is ``common`` and the
messages about modes (435 to 437): the rover sends and understands
nothing outside it.
"""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import development as mavlink

from rover_sim.mavlink.extensions import mission_ack, mission_count, mission_current

__all__ = [
    "MAVLINK_1",
    "MAVLINK_2",
    "Message",
    "Packer",
    "Parser",
    "mavlink",
    "mission_ack",
    "mission_count",
    "mission_current",
]

Message = Any  # pymavlink's generated classes carry no types

MAVLINK_1, MAVLINK_2 = 0xFE, 0xFD  # first byte of a frame
_HEADER = {MAVLINK_1: 6, MAVLINK_2: 10}  # bytes of the MAVLink 1 and 2 header
_CHECKSUM = 2
_SIGNATURE = 13
_SIGNED = 0x01  # the only incompatibility flag that we understand


class Packer:
    """Packs the messages of one component for one channel; the sequence number is counted here."""

    def __init__(self, system: int, component: int) -> None:
        self._mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self.version_1 = False  # for a peer that speaks MAVLink 1 only

    def knows(self, message: Message) -> bool:
        """Whether the message can be sent: MAVLink 1 has 256 of them."""
        return not self.version_1 or message.id <= 255

    def pack(self, message: Message) -> bytes:
        """The frame of a message; a message object may be packed any number of times."""
        frame: bytes = message.pack(self._mav, force_mavlink1=self.version_1)
        self._mav.seq = (self._mav.seq + 1) % 256
        return frame


class Parser:
    """Cuts one peer's bytes into frames and decodes them; what is no valid frame is skipped byte by byte.

    Frames are cut here and not by pymavlink's ``parse_buffer``, which throws away everything that a garbage byte
    claims as its frame, good frames included. Frames of unknown messages are dropped.
    """

    def __init__(self) -> None:
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
            message = self._decode(data[at : at + length]) if length else None
            at += length if message is not None else 1
            if message is not None and not isinstance(message, mavlink.MAVLink_unknown):
                messages.append(message)
        return messages, b""

    def _decode(self, frame: bytes) -> Message | None:
        try:
            return self._mav.decode(bytearray(frame))
        except mavlink.MAVError:
            return None


def _frame_length(data: bytes, at: int) -> int | None:
    """Length of the frame that begins at ``at``; 0 if none can, None if its end is not there yet."""
    header = _HEADER.get(data[at])
    if header is None:
        return 0
    if len(data) < at + header:
        return None
    length = header + data[at + 1] + _CHECKSUM
    if header == _HEADER[MAVLINK_2]:
        if data[at + 2] & ~_SIGNED:
            return 0
        length += _SIGNATURE if data[at + 2] & _SIGNED else 0
    return length if len(data) >= at + length else None
