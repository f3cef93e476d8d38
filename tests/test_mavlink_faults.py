"""Bad links: each fault by itself, and missions that get through all the same."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.errors import InputError
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.faults import Faults, Lane, parse_faults
from rover_sim.mavlink.faulty import FaultyLink
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.memory import memory_link
from rover_sim.mavlink.plan_items import mission_items
from rover_sim.mavlink.uploader import Uploader, UploadState
from rover_sim.mavlink.vehicle import Vehicle
from rover_sim.mavlink.wire import WireItem
from tests.mavlink_rig import FOOTPRINT, Station
from worlds.scenario import Origin

FRAMES = [bytes([number]) for number in range(200)]


def passed(faults: Faults, seed: int = 1, until_s: float = math.inf) -> list[bytes]:
    """What comes out of a lane into which 200 frames went 10 ms apart."""
    lane = Lane(faults, np.random.default_rng(seed))
    for number, frame in enumerate(FRAMES):
        lane.put(frame, 0.01 * number)
    return lane.take(until_s)


def test_no_fault_changes_nothing() -> None:
    assert passed(Faults()) == FRAMES


def test_each_fault_does_what_it_says() -> None:
    assert 120 < len(passed(Faults(loss=0.3))) < 160
    assert len(passed(Faults(loss=1.0))) == 0
    assert passed(Faults(delay_s=0.5), until_s=0.499) == []
    assert passed(Faults(delay_s=0.5), until_s=0.5) == FRAMES[:1]
    assert 210 < len(passed(Faults(duplicate=0.1))) < 235
    assert passed(Faults(jitter_s=0.5)) == FRAMES  # late, but in order
    shuffled = passed(Faults(reorder=0.1, delay_s=0.1))
    assert sorted(shuffled) == FRAMES != shuffled


def test_a_slow_line_takes_its_time_and_drops_what_it_cannot_hold() -> None:
    lane = Lane(Faults(rate_baud=9600.0), None)
    for _ in range(100):
        lane.put(bytes(96), 0.0)  # 0.1 s each
    assert len(lane.take(0.99)) == 9
    assert len(lane.take(1e9)) in (11, 12)  # 2 s of frames are in the line, give or take the one on its way


@given(
    loss=st.floats(0, 1), reorder=st.floats(0, 1), dup=st.floats(0, 1), jitter=st.floats(0, 1), seed=st.integers(0, 9)
)
def test_faults_repeat_with_the_seed_and_invent_nothing(
    loss: float, reorder: float, dup: float, jitter: float, seed: int
) -> None:
    faults = Faults(loss=loss, reorder=reorder, duplicate=dup, jitter_s=jitter)
    assert passed(faults, seed) == passed(faults, seed)
    assert set(passed(faults, seed)) <= set(FRAMES)


def test_faults_are_read_and_refused() -> None:
    assert parse_faults("loss=0.2,delay=0.3,jitter=0.1,dup=0.02,reorder=0.02,rate=9600") == Faults(
        0.2, 0.3, 0.1, 0.02, 0.02, 9600.0
    )
    for bad in ("", "los=0.1", "loss", "loss=x", "loss=nan", "loss=1.5", "delay=-1", "rate=0", "loss=0.1,loss=0.2"):
        with pytest.raises(InputError, match="allowed: loss, dup, reorder"):
            parse_faults(bad)


def test_a_real_link_is_made_bad_in_both_directions() -> None:
    here, there = memory_link()
    bad = FaultyLink(here, Faults(delay_s=0.2), np.random.default_rng(0))
    (peer,) = bad.peers(0.0)
    bad.send(b"out", peer, 0.0)
    there.send(b"in", peer, 0.0)
    assert (there.receive(0.1), bad.receive(0.1)) == ([], [])
    assert bad.receive(0.31) == [(peer, b"in")]
    assert there.receive(0.31) == [("memory", b"out")]
    bad.close()
    assert bad.peers(1.0) == ()


class Sender:
    """A station that uploads over a bad link to a vehicle that does nothing else; 20 ticks a second."""

    def __init__(self, faults: Faults, seed: int) -> None:
        self.station = Station(faults=faults, seed=seed)
        self.frame = LocalFrame(Origin())
        self.vehicle = Vehicle(Autopilot(FOOTPRINT, (0.0, 0.0, 0.0)), self.frame, [self.station.link])
        self.time_s = 0.0
        self.uploader = Uploader(self._send, 1, 1)

    def upload(self, items: list[WireItem], limit_s: float) -> UploadState:
        upload = self.uploader.upload(items, self.time_s)
        while upload.state is UploadState.SENDING and self.time_s < limit_s:
            for message in self._tick("MISSION_REQUEST_INT", "MISSION_ACK"):
                if message.get_type() == "MISSION_ACK":
                    self.uploader.acknowledged(message, self.time_s)
                else:
                    self.uploader.requested(message, self.time_s)
            self.uploader.tick(self.time_s)
        return upload.state

    def download(self, limit_s: float) -> list[WireItem]:
        """As MAVSDK reads: what is missing is asked for again every 1.5 s."""
        count, items, asked_s = -1, list[WireItem](), -9.0
        while len(items) != count and self.time_s < limit_s:
            for message in self._tick("MISSION_COUNT", "MISSION_ITEM_INT"):
                if message.get_type() == "MISSION_COUNT":
                    count, asked_s = message.count, -9.0
                elif message.seq == len(items):
                    items.append(WireItem.of(message))
                    asked_s = -9.0
            if len(items) != count and self.time_s - asked_s > 1.5:
                asked_s = self.time_s
                one = mavlink.MAVLink_mission_request_int_message(1, 1, len(items))
                self._send(one if count >= 0 else mavlink.MAVLink_mission_request_list_message(1, 1))
        return items

    def _tick(self, *names: str) -> list[Message]:
        self.time_s += 0.05
        self.vehicle.tick(self.time_s, None, None)
        self.station.listen(self.time_s)
        heard = self.station.take(*names)
        self.station.heard.clear()
        return heard

    def _send(self, message: Message) -> None:
        self.station.send(message, self.time_s)


@pytest.mark.parametrize(
    ("count", "faults", "seeds", "limit_s"),
    [
        (1000, Faults(loss=0.2, delay_s=0.3), 1, 2000.0),
        (100, Faults(loss=0.4), 6, 400.0),
        (50, Faults(loss=0.1, delay_s=0.2, jitter_s=0.2, duplicate=0.1, reorder=0.1, rate_baud=9600.0), 3, 400.0),
    ],
)
def test_a_mission_gets_through_a_bad_link_whole(count: int, faults: Faults, seeds: int, limit_s: float) -> None:
    places = [(0.1 * number, -0.05 * number, 0.0) for number in range(count - 1)]
    for seed in range(seeds):
        sender = Sender(faults, seed)
        items = mission_items(places, sender.frame, (0.0, 0.0, 0.0))
        assert len(items) == count
        assert sender.upload(items, limit_s) is UploadState.DONE
        assert [_key(item) for item in sender.vehicle.store.items] == [_key(item) for item in items]
        back = sender.download(sender.time_s + limit_s)
        assert [_key(item) for item in back] == [_key(item) for item in items]


def _key(item: WireItem) -> tuple[object, ...]:
    """All of an item; the wire carries heights and parameters in single precision."""
    return (item.frame, item.command, item.params, item.x, item.y, np.float32(item.z), item.autocontinue)
