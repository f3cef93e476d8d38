"""Random transfers of missions, fences and rally points, and the checks that hold after every single message.

Each message is answered before the next, so that every result and every change of a list has one cause.
"""

from __future__ import annotations

from collections import Counter

from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.endpoint import Link
from rover_sim.mavlink.item_store import ItemStore
from rover_sim.mavlink.persona import Persona
from rover_sim.mavlink.wire import WireItem
from tests.mavlink_offers import LISTS, Offer, message_of, random_offer, same, seeded
from tests.mavlink_rig import Station, Yard

ACCEPTED = 0


class Desk:
    """A vehicle and two stations that send random transfers; ``counts``: what happened."""

    def __init__(self, persona: Persona, seed: int) -> None:
        self.rng = seeded(seed)
        self.counts: Counter[str] = Counter()
        self.stations = Station(), Station(255, 230)
        for station in self.stations:
            station.link = Link(station.link.transport, {})  # no telemetry
        self.yard = Yard(*self.stations, persona=persona)
        self.time_s = self.yard.time_s
        vehicle = self.yard.vehicle
        self.stores: dict[int, ItemStore] = {0: vehicle.store, 1: vehicle.fence, 2: vehicle.rally}
        self._offers: dict[tuple[Station, int], Offer] = {}
        self._taken: dict[tuple[Station, int], bool] = {}  # the last offer has been stored
        self._open: set[tuple[Station, int]] = set()  # offers of this transfer

    def transfer(self) -> None:
        """One transfer with whatever goes wrong, until nobody waits any more."""
        rng = self.rng
        station = rng.choice(self.stations)
        kind = rng.choice((0, 0, 0, 1, 1, 2, 2, 3, 77))
        calm = rng.random() < 0.3  # nothing but losses
        loss = rng.choice((0.0, 0.1, 0.4))
        wanted = self._offer(station, kind)
        for _ in range(rng.randrange(5, 70)):
            if wanted is None and (calm or rng.random() < 0.3):
                wanted = self._wait(0.55, station, kind)
            if wanted is None and rng.random() < 0.2:
                break
            draw = 1.0 if calm else rng.random()
            if draw < 0.25:
                asked = self._trouble(station, kind)
                wanted = wanted if asked is None else asked
            elif wanted is not None and rng.random() >= loss:
                wanted = self._give(station, kind, wanted)
            elif wanted is not None:
                wanted = self._wait(rng.uniform(0.05, 0.7), station, kind)
        self._wait(8.1, station, kind)
        self._open.clear()
        self._settled()
        self.counts["transfers"] += 1

    def _offer(self, station: Station, kind: int) -> int | None:
        offer = self._offers[station, kind] = random_offer(self.rng, kind)
        self._taken[station, kind] = False
        self._open.add((station, kind))
        return self._say(station, mavlink.MAVLink_mission_count_message(1, 1, offer.count, kind), kind)

    def _give(self, station: Station, kind: int, seq: int) -> int | None:
        offer = self._offers[station, kind]
        if seq >= len(offer.items):
            return self._wait(1.0, station, kind)
        return self._say(station, message_of(offer, seq), kind)

    def _trouble(self, station: Station, kind: int) -> int | None:
        """One thing that a sender, or another one, should not do."""
        things = (
            self._send_any_item,
            self._send_item_as_another,
            self._send_item_to_another_list,
            self._offer,
            self._offer_as_another,
            self._cancel,
            self._clear,
            self._read,
            self._write_partly,
            self._be_silent,
        )
        return self.rng.choice(things)(station, kind)

    def _any_item(self, station: Station, kind: int) -> int | None:
        count = len(self._offers[station, kind].items)
        return self.rng.randrange(count) if count else None

    def _send_any_item(self, station: Station, kind: int) -> int | None:
        seq = self._any_item(station, kind)
        return None if seq is None else self._give(station, kind, seq)

    def _send_item_as_another(self, station: Station, kind: int) -> int | None:
        other, seq = self._other(station), self._any_item(station, kind)
        if seq is not None and (other, kind) not in self._open:
            self._say(other, message_of(self._offers[station, kind], seq), kind)
        return None

    def _send_item_to_another_list(self, station: Station, kind: int) -> int | None:
        about, seq = self.rng.choice((*LISTS, 9)), self._any_item(station, kind)
        if seq is not None and (station, about) not in self._open:
            self._say(station, message_of(self._offers[station, kind], seq, about), kind)
        return None

    def _offer_as_another(self, station: Station, _kind: int) -> int | None:
        self._offer(self._other(station), self.rng.choice(LISTS))
        return None

    def _cancel(self, _station: Station, kind: int) -> int | None:
        code, about = self.rng.choice((15, 1, 0, 13)), self.rng.choice((kind, *LISTS))
        return self._say(self._anyone(), mavlink.MAVLink_mission_ack_message(1, 1, code, about), kind)

    def _clear(self, _station: Station, kind: int) -> int | None:
        about = self.rng.choice((kind, *LISTS, 255, 9))
        return self._say(self._anyone(), mavlink.MAVLink_mission_clear_all_message(1, 1, about), kind)

    def _read(self, _station: Station, kind: int) -> int | None:
        listing = mavlink.MAVLink_mission_request_list_message(1, 1, self.rng.choice((kind, 255)))
        item = mavlink.MAVLink_mission_request_int_message(1, 1, self.rng.choice((0, 1, 5000)), self.rng.choice(LISTS))
        return self._say(self._anyone(), self.rng.choice((listing, item)), kind)

    def _write_partly(self, station: Station, kind: int) -> int | None:
        partial = mavlink.MAVLink_mission_write_partial_list_message(1, 1, 0, 1, self.rng.choice(LISTS))
        return self._say(station, partial, kind)

    def _be_silent(self, station: Station, kind: int) -> int | None:
        return self._wait(self.rng.choice((0.1, 0.6, 3.0, 8.1)), station, kind)

    def _other(self, station: Station) -> Station:
        return self.stations[1 - self.stations.index(station)]

    def _anyone(self) -> Station:
        return self.rng.choice(self.stations)

    def _wait(self, seconds: float, station: Station, kind: int) -> int | None:
        self.time_s += seconds
        return self._say(station, None, kind)

    def _say(self, station: Station, message: Message | None, kind: int) -> int | None:
        """Send (or only let time pass), check all that follows, and return the item that is asked for, if any."""
        before = {number: store.items for number, store in self.stores.items()}
        if message is not None:
            station.send(message, self.time_s)
            self.counts["messages"] += 1
        self.yard.vehicle.answer(self.time_s)
        self._check_lists(before, station, message)
        wanted = None
        for listener in self.stations:
            listener.listen(self.time_s)
            for heard in listener.take("MISSION_ACK", "MISSION_REQUEST_INT"):
                if heard.get_type() == "MISSION_ACK":
                    self._check_result(heard, listener, station, message)
                elif listener is station and heard.mission_type == kind:
                    wanted = heard.seq
            listener.heard.clear()
        return wanted

    def _check_lists(self, before: dict[int, tuple[WireItem, ...]], station: Station, message: Message | None) -> None:
        """A list changes to nothing by a request to clear it, or to all of an offer by its last item."""
        for kind, store in self.stores.items():
            if store.items is before[kind]:
                continue
            assert message is not None, "a list changed by itself"
            name = message.get_type()
            if name == "MISSION_CLEAR_ALL":
                assert message.mission_type in (kind, 255)
                assert store.items == ()
            elif name == "MISSION_COUNT":
                assert (message.mission_type, message.count) == (kind, 0)
                assert store.items == ()
            else:
                assert name in ("MISSION_ITEM_INT", "MISSION_ITEM")
                assert message.mission_type == kind
                offer = self._offers[station, kind]
                assert offer.good, offer
                assert same(store.items, offer.items)
                self._taken[station, kind] = True
                self.counts["stored"] += 1

    def _check_result(self, result: Message, listener: Station, station: Station, message: Message | None) -> None:
        """A result goes to who asked; ACCEPTED is true when it is said."""
        self.counts[f"result {result.type}"] += 1
        if message is None:
            assert result.type == 15
            return
        assert listener is station
        if result.type != ACCEPTED:
            return
        kind, name = result.mission_type, message.get_type()
        if name == "MISSION_CLEAR_ALL" or (name == "MISSION_COUNT" and message.count == 0):
            assert all(self.stores[one].items == () for one in (LISTS if kind == 255 else (kind,)))
        else:
            assert name in ("MISSION_ITEM_INT", "MISSION_ITEM")
            assert self._taken[station, kind], "accepted and not stored"

    def _settled(self) -> None:
        """Nothing is under way, the autopilot has what is stored, and a good list is taken at once."""
        autopilot, vehicle = self.yard.autopilot, self.yard.vehicle
        assert len(autopilot.auto.mission.items) == len(vehicle.store.items)
        assert len(autopilot.returns.rally_w) == len(vehicle.rally.items)
        station, kind = self.rng.choice(self.stations), self.rng.choice(LISTS)
        offer = random_offer(self.rng, kind)
        while not offer.good:
            offer = random_offer(self.rng, kind)
        self._offers[station, kind], self._taken[station, kind] = offer, False
        wanted = self._say(station, mavlink.MAVLink_mission_count_message(1, 1, offer.count, kind), kind)
        for seq in range(offer.count):
            assert wanted == seq
            wanted = self._say(station, message_of(offer, seq), kind)
        assert wanted is None
        assert same(self.stores[kind].items, offer.items)
