from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.mavlink.dialect import Packer, Parser, mavlink
from rover_sim.mavlink.heartbeat import heartbeat
from rover_sim.mavlink.persona import ARDUPILOT
from rover_sim.mavlink.wire import WireItem
from tests.mavlink_rig import FOOTPRINT

# Checksum seeds of the messages, from the MAVLink XML.
CRC_EXTRA = {"HEARTBEAT": 50, "MISSION_ITEM_INT": 38, "ATTITUDE": 39}


def checksum(data: bytes, extra: int) -> bytes:
    """X.25 as the MAVLink guide gives it, written anew."""
    crc = 0xFFFF
    for byte in (*data, extra):
        low = (byte ^ crc) & 0xFF
        low = (low ^ (low << 4)) & 0xFF
        crc = (crc >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4)
    return crc.to_bytes(2, "little")


def test_heartbeat_bytes() -> None:
    frame = Packer(1, 1).pack(heartbeat(Autopilot(FOOTPRINT, (0.0, 0.0, 0.0)), ARDUPILOT))
    # magic, length 9, flags 0 0, sequence 0, system 1, component 1, message 0 (3 bytes)
    head = bytes.fromhex("fd 09 00 00 00 01 01 00 00 00")
    # custom mode 4 (Hold), type 10 rover, autopilot 3 ArduPilot, base mode 1 custom, status 3 standby, version 3
    body = bytes.fromhex("04 00 00 00 0a 03 01 03 03")
    assert frame == head + body + checksum((head + body)[1:], CRC_EXTRA["HEARTBEAT"])


def test_mission_item_bytes() -> None:
    item = WireItem(3, 16, (0.0, 0.5, 0.0, 0.0), 384064000, -1107919000, 1.5)
    frame = Packer(1, 191).pack(item.message(1, 1, 7))
    head = bytes.fromhex("fd 25 00 00 00 01 bf 49 00 00")
    body = bytes.fromhex(
        "00000000 0000003f 00000000 00000000"  # four parameters, 0.5 = 0x3f000000
        "005ae416 687ff6bd 0000c03f"  # 384064000 = 0x16e45a00, -1107919000 = 0xbdf67f68, 1.5 = 0x3fc00000
        "0700 1000 01 01 03 00 01"  # sequence 7, command 16, target 1 1, frame 3, current 0, autocontinue 1
    )  # the last byte, mission type 0, is cut off as MAVLink 2 does
    assert len(body) == 0x25
    assert frame == head + body + checksum((head + body)[1:], CRC_EXTRA["MISSION_ITEM_INT"])


def test_sequence_numbers_count_and_wrap() -> None:
    packer = Packer(1, 1)
    message = mavlink.MAVLink_mission_item_reached_message(3)
    assert [packer.pack(message)[4] for _ in range(258)] == [*range(256), 0, 1]


def reached(seq: int) -> bytes:
    return Packer(9, 9).pack(mavlink.MAVLink_mission_item_reached_message(seq))


def test_several_frames_in_one_datagram() -> None:
    assert [message.seq for message in Parser().datagram(reached(1) + reached(2) + reached(3))] == [1, 2, 3]


@settings(max_examples=60)
@given(st.binary(max_size=40), st.binary(max_size=40))
def test_garbage_around_a_frame_does_not_hide_it(before: bytes, after: bytes) -> None:
    assert 77 in [message.seq for message in Parser().datagram(before + reached(77) + after) if hasattr(message, "seq")]


@settings(max_examples=60)
@given(st.lists(st.integers(1, 30), max_size=20))
def test_a_stream_may_be_cut_anywhere(cuts: list[int]) -> None:
    data = b"".join(reached(seq) for seq in range(1, 12))
    parser, found = Parser(), []
    for cut in [*cuts, len(data)]:
        chunk, data = data[:cut], data[cut:]
        found += [message.seq for message in parser.stream(chunk)]
    assert found == list(range(1, 12))


def test_a_truncated_datagram_does_not_eat_the_next() -> None:
    parser = Parser()
    assert parser.datagram(reached(1)[:-3]) == []
    assert [message.seq for message in parser.datagram(reached(2))] == [2]


def test_damaged_frames_unknown_messages_and_unknown_flags_are_dropped() -> None:
    frame = bytearray(reached(1))
    frame[11] ^= 1
    assert Parser().datagram(bytes(frame)) == []
    flagged = bytearray(reached(1))
    flagged[2] = 0x02
    assert Parser().datagram(bytes(flagged)) == []
    unknown = bytes.fromhex("fd 01 00 00 00 01 01 f0 ff 0f 00 12 34")
    assert [message.seq for message in Parser().datagram(unknown + reached(5))] == [5]


def test_mavlink_1_frames_are_understood() -> None:
    message = mavlink.MAVLink_mission_item_reached_message(6)
    frame = message.pack(mavlink.MAVLink(None, srcSystem=5, srcComponent=1), force_mavlink1=True)
    assert frame[0] == 0xFE
    assert [found.seq for found in Parser().datagram(frame)] == [6]
