"""Whatever arrives at the port, the vehicle lives on and its mission is whole."""

from __future__ import annotations

import inspect
import struct
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.plan_items import mission_items
from tests.mavlink_rig import Station, Yard
from tests.test_mavlink_mission import download, upload

SPECIAL = [float("nan"), float("inf"), -float("inf"), 0.0, 1.0, -1.0, 1e30, 400.0, 176.0, 11.0, 16.0]


def random_message(rng: np.random.Generator, kind: Any) -> Message:
    """A message of a kind with random field contents, half of them from a list of nasty ones."""
    size = kind.unpacker.size
    payload = bytearray(rng.bytes(size))
    values = list(kind.unpacker.unpack(bytes(payload)))
    for at, value in enumerate(values):
        if isinstance(value, float) and rng.random() < 0.7:
            values[at] = float(rng.choice(SPECIAL))
    payload[:] = kind.unpacker.pack(*values)
    frame = bytearray(struct.pack("<BBBBBBB", 0xFD, size, 0, 0, 0, 255, 190)) + kind.id.to_bytes(3, "little") + payload
    crc = mavlink.x25crc(frame[1:])
    crc.accumulate(struct.pack("B", kind.crc_extra))
    return bytes(frame) + struct.pack("<H", crc.crc)


def living_yard() -> tuple[Yard, Station]:
    station = Station()
    yard = Yard(station)
    upload(yard, station, mission_items([(5.0, 0.0, 0.0)], yard.frame, (0.0, 0.0, 0.0)))
    return yard, station


@settings(max_examples=40, deadline=None)
@given(st.lists(st.binary(max_size=300), max_size=20))
def test_random_bytes(chunks: list[bytes]) -> None:
    yard, station = living_yard()
    for chunk in chunks:
        station.send_bytes(chunk, yard.time_s)
        yard.step()
    assert len(download(yard, station)) == 2


def test_every_message_with_random_contents() -> None:
    rng = np.random.default_rng(5)
    yard, station = living_yard()
    kinds = list(mavlink.mavlink_map.values())
    for _ in range(12):
        for kind in kinds:
            station.send_bytes(random_message(rng, kind), yard.time_s)
        yard.step()
    assert len(station.take("HEARTBEAT")) > 0


def test_the_vehicles_own_protocols_with_random_contents_to_the_right_target() -> None:
    rng = np.random.default_rng(6)
    yard, station = living_yard()
    names = list(yard.vehicle._handlers)
    for _ in range(4000):
        name = str(rng.choice(names))
        kind = getattr(mavlink, f"MAVLink_{name.lower()}_message")
        message = station._parser.datagram(random_message(rng, kind))[0]
        for field in ("target_system", "target_component"):
            if hasattr(message, field):
                setattr(message, field, 1)
        if name.startswith("COMMAND") and rng.random() < 0.9:
            message.command = int(rng.choice([400, 176, 300, 224, 192, 178, 115, 20, 179, 401, 512, 511, 510, 520]))
        if hasattr(message, "mission_type") and rng.random() < 0.8:
            message.mission_type = 0
        if hasattr(message, "seq") and rng.random() < 0.8:
            message.seq = int(rng.integers(0, 4))
        if name == "MISSION_COUNT":
            message.count = int(rng.integers(0, 5))
        station.send(message, yard.time_s)
        yard.step()
        assert len(yard.vehicle.store.items) == len(yard.autopilot.auto.mission.items)
    station.heard.clear()
    yard.step(9.0)
    assert len(station.take("HEARTBEAT")) > 0


def test_cut_and_flipped_frames() -> None:
    rng = np.random.default_rng(7)
    yard, station = living_yard()
    whole = [item.message(1, 1, seq) for seq, item in enumerate(yard.vehicle.store.items)]
    for _ in range(500):
        frame = bytearray(station.packer.pack(whole[int(rng.integers(2))]))
        for _ in range(int(rng.integers(1, 4))):
            frame[int(rng.integers(len(frame)))] ^= 1 << int(rng.integers(8))
        station.send_bytes(bytes(frame[: int(rng.integers(1, len(frame) + 1))]), yard.time_s)
        yard.step()
    assert len(download(yard, station)) == 2


def test_every_handler_belongs_to_a_message_of_the_dialect() -> None:
    known = {kind.msgname for kind in mavlink.mavlink_map.values()}
    yard, _ = living_yard()
    assert set(yard.vehicle._handlers) <= known
    assert all(len(inspect.signature(handler).parameters) == 2 for handler in yard.vehicle._handlers.values())
