"""Random frames for a vehicle's port: valid ones with nasty contents, damaged ones, noise; all drawn from one seed."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Iterator, Sequence
from typing import Any

from rover_sim.mavlink.dialect import Message, Packer, mavlink
from rover_sim.mavlink.ftp_packet import Packet
from tests.mavlink_offers import LATITUDE, LISTS, LONGITUDE, message_of, random_offer

NASTY = (math.nan, math.inf, -math.inf, 0.0, -0.0, 1.0, -1.0, 0.5, 2.0, 1e30, -1e30, 1e-40, 400.0, 176.0, 16.0)
COMMANDS = (400, 176, 300, 224, 192, 178, 115, 20, 179, 410, 401, 512, 511, 510, 520, 193, 245, 246, 2000, 2001, 521)
KINDS: Sequence[Any] = tuple(mavlink.mavlink_map.values())


def framed(kind: Any, payload: bytes, system: int = 255, component: int = 190) -> bytes:
    """A valid frame of MAVLink 2 around any payload."""
    body: bytes = bytes([len(payload), 0, 0, 0, system, component]) + kind.id.to_bytes(3, "little") + payload
    crc = mavlink.x25crc(body)
    crc.accumulate(bytes([kind.crc_extra]))
    return b"\xfd" + body + struct.pack("<H", crc.crc)


def random_values(rng: random.Random, kind: Any) -> list[Any]:
    """Contents of a message in wire order: random bits, floats mostly from a list of nasty ones."""
    values = list(kind.unpacker.unpack(rng.randbytes(kind.unpacker.size)))
    for at, value in enumerate(values):
        if isinstance(value, float) and rng.random() < 0.7:
            values[at] = rng.choice(NASTY)
    return values


def random_frame(rng: random.Random, kind: Any) -> bytes:
    """A valid frame of one kind."""
    return framed(kind, kind.unpacker.pack(*random_values(rng, kind)))


def aimed_frame(rng: random.Random, kind: Any) -> bytes:
    """A valid frame that the vehicle takes for itself, with numbers that mean something more often than not."""
    values = random_values(rng, kind)
    names = kind.ordered_fieldnames
    likely = {
        "target_system": (1, 0),
        "target_component": (1, 0, 100),
        "command": COMMANDS if "param1" in names and "seq" not in names else (16, 20, 19, 112, 178, 5001, 5003, 5100),
        "mission_type": (0, 0, 1, 2, 255),
        "seq": (0, 1, 2, 3),
        "count": (0, 1, 2, 3, 4),
        "frame": (0, 3, 5, 6, 1),
        "x": (384064000, 384064500, -900000001),
        "y": (-1107919000, -1107919500),
    }
    if not kind.array_lengths or not any(kind.array_lengths):
        for at, name in enumerate(names):
            known = name in likely and not isinstance(values[at], float) and (name not in "xy" or "frame" in names)
            if known and rng.random() < 0.85:
                values[at] = rng.choice(likely[name])
    return framed(kind, kind.unpacker.pack(*values))


def parameter_frame(rng: random.Random, names: Sequence[str]) -> bytes:
    """A PARAM_SET of a parameter that is there."""
    value = rng.choice((*NASTY, rng.uniform(0.0, 60.0)))
    message = mavlink.MAVLink_param_set_message(1, 1, rng.choice(names).encode(), value, rng.choice((9, 6, 1, 77)))
    return _pack(message)


def file_frame(rng: random.Random) -> bytes:
    """A file transfer request."""
    pack = b"@PARAM/param.pck"
    paths = (b"", b"/", b"a.tlog", pack, pack + b"?withdefaults=1&count=3", b"../x", rng.randbytes(9))
    data, size, offset = rng.choice(paths), rng.choice((0, 9, 80, 239, 255)), rng.choice((0, 1, 239, 5000, 2**32 - 1))
    request = Packet(rng.randrange(4), rng.randrange(3), rng.randrange(18), data, offset=offset, size=size)
    return _pack(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, request.encode()))


def sensible_frames(rng: random.Random, modes: Sequence[int]) -> list[bytes]:
    """What a ground station would send: a whole list, arming, a mode, a place to drive to, the sticks."""
    draw = rng.randrange(6)
    if draw <= 1:
        offer = random_offer(rng, rng.choice(LISTS))
        count = mavlink.MAVLink_mission_count_message(1, 1, offer.count, offer.kind)
        return [_pack(count), *(_pack(message_of(offer, seq)) for seq in range(len(offer.items)))]
    if draw == 2:
        force = rng.choice((0, 2989))
        return [_pack(mavlink.MAVLink_command_long_message(1, 1, 400, 0, rng.choice((1, 1, 0)), force, 0, 0, 0, 0, 0))]
    if draw == 3:
        return [_pack(mavlink.MAVLink_set_mode_message(1, 1, rng.choice(modes)))]
    if draw == 4:
        x, y = LATITUDE + rng.randrange(-9000, 9000), LONGITUDE + rng.randrange(-9000, 9000)
        return [_pack(mavlink.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, -1, 1, 0, math.nan, x, y, 0))]
    axes = [rng.choice((-1000, 0, 500, 1000, 32767, rng.randrange(-1000, 1000))) for _ in range(4)]
    return [_pack(mavlink.MAVLink_manual_control_message(1, *axes, 0))]


def damaged(rng: random.Random, frame: bytes) -> bytes:
    """A frame with bits turned, cut, doubled, or with something put in."""
    data = bytearray(frame)
    for _ in range(rng.randrange(1, 4)):
        at = rng.randrange(len(data))
        what = rng.randrange(5)
        if what <= 1:
            data[at] ^= 1 << rng.randrange(8)
        elif what == 2:
            del data[at + 1 :]
        elif what == 3:
            data[at:at] = rng.randbytes(rng.randrange(1, 8))
        else:
            data[at:at] = data[: rng.randrange(1, len(data) + 1)]
    return bytes(data[:600])


def frames(
    rng: random.Random, handled: Sequence[str], parameters: Sequence[str], modes: Sequence[int]
) -> Iterator[bytes]:
    """Frames without end; ``handled``: messages that the vehicle takes, ``modes``: its mode numbers."""
    own = [kind for kind in KINDS if kind.msgname in set(handled)]
    while True:
        draw = rng.random()
        if draw < 0.15:
            yield random_frame(rng, rng.choice(KINDS))
        elif draw < 0.25:
            yield from sensible_frames(rng, modes)
        elif draw < 0.60:
            yield aimed_frame(rng, rng.choice(own))
        elif draw < 0.65:
            yield parameter_frame(rng, parameters)
        elif draw < 0.70:
            yield file_frame(rng)
        elif draw < 0.95:
            yield damaged(rng, aimed_frame(rng, rng.choice(own)))
        else:
            yield rng.randbytes(rng.randrange(1, 300))


def _pack(message: Message) -> bytes:
    return Packer(255, 190).pack(message)
