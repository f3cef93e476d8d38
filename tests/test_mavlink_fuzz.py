"""Whatever arrives at the port, the vehicle lives on and its mission is whole."""

from __future__ import annotations

import inspect

from hypothesis import given, settings
from hypothesis import strategies as st

from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.plan_items import mission_items
from tests.mavlink_rig import Station, Yard
from tests.test_mavlink_mission import download, upload


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


def test_every_handler_belongs_to_a_message_of_the_dialect() -> None:
    known = {kind.msgname for kind in mavlink.mavlink_map.values()}
    yard, _ = living_yard()
    assert set(yard.vehicle._handlers) <= known
    assert all(len(inspect.signature(handler).parameters) == 2 for handler in yard.vehicle._handlers.values())
