"""Two ground stations and the planner upload at once, in any order, with any cut: never is a list half-written."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.wire import WireItem
from tests.mavlink_rig import Station, Yard
from tests.test_mavlink_fence import FENCE, INSIDE, POINTS, RALLY, SQUARE, polygon
from tests.test_mavlink_mission import ITEMS, OTHER

MISSION, ACCEPTED = 0, 0
TRIANGLE = polygon(INSIDE, (-5, -5), (5, -5), (0, 5))
LISTS = {MISSION: (ITEMS, OTHER, OTHER[1:]), FENCE: (SQUARE, TRIANGLE, []), RALLY: (POINTS, POINTS[:1], [])}
ACTION = st.tuples(
    st.sampled_from([0, 1, 2]),  # who
    st.sampled_from([MISSION, MISSION, FENCE, RALLY]),
    st.sampled_from(["whole", "count", "next", "next", "early", "again", "cancel", "clear", "wait"]),
)


class Sender:
    """Sends its own list of each kind, and remembers what the vehicle asks for."""

    def __init__(self, number: int, station: Station) -> None:
        self.number, self.station = number, station
        self.wanted = dict.fromkeys(LISTS, 0)
        self.results: list[tuple[int, int]] = []

    def act(self, yard: Yard, kind: int, action: str) -> None:
        if action == "whole":
            for part in ("count", *("next" for _ in LISTS[kind][self.number])):
                self.act(yard, kind, part)
            return
        items = LISTS[kind][self.number]
        seq = {"next": self.wanted[kind], "early": self.wanted[kind] + 1, "again": 0}.get(action)
        if action == "count":
            self._send(yard, mavlink.MAVLink_mission_count_message(1, 1, len(items), kind))
        elif action == "cancel":
            self._send(yard, mavlink.MAVLink_mission_ack_message(1, 1, 15, kind))
        elif action == "clear":
            self._send(yard, mavlink.MAVLink_mission_clear_all_message(1, 1, kind))
        elif seq is not None and seq < len(items):
            self._send(yard, items[seq].message(1, 1, seq, kind))
        else:
            yard.step(3.0)
        for message in self.station.take("MISSION_REQUEST_INT", "MISSION_ACK"):
            if message.get_type() == "MISSION_ACK":
                self.results.append((message.mission_type, message.type))
            else:
                self.wanted[message.mission_type] = message.seq

    def _send(self, yard: Yard, message: object) -> None:
        self.station.send(message, yard.time_s)
        yard.step()


def _places(items: tuple[WireItem, ...] | list[WireItem]) -> list[tuple[int, int]]:
    return [(item.x, item.y) for item in items]


@settings(max_examples=40, deadline=None)
@given(st.lists(ACTION, min_size=10, max_size=60))
def test_whatever_happens_each_list_is_one_that_somebody_sent_whole(actions: list[tuple[int, int, str]]) -> None:
    stations = [Station(), Station(255, 230), Station(1, 191)]  # the last is the planner
    yard = Yard(*stations)
    senders = [Sender(number, station) for number, station in enumerate(stations)]
    for who, kind, action in actions:
        senders[who].act(yard, kind, action)
        for store in (yard.vehicle.store, yard.vehicle.fence, yard.vehicle.rally):
            whole = [[], *(_places(items) for items in LISTS[store.kind])]
            assert _places(store.items) in whole
        assert len(yard.autopilot.auto.mission.items) == len(yard.vehicle.store.items)
        assert bool(yard.autopilot.fence.fence.areas) == bool(yard.vehicle.fence.items)
    accepted = [result for sender in senders for result in sender.results if result[1] == ACCEPTED]
    told = {kind for kind, _ in accepted}
    for store in (yard.vehicle.store, yard.vehicle.fence, yard.vehicle.rally):
        assert not store.items or store.kind in told  # nothing is stored that its sender was not told of
