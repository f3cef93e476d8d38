from __future__ import annotations

from dataclasses import replace

import numpy as np

from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.mavlink.companion import Companion
from rover_sim.mavlink.dialect import Message, Parser
from rover_sim.mavlink.endpoint import SIMULATOR, Link
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.memory import memory_link
from rover_sim.mavlink.narrator import Narrator, event_text, named_values
from rover_sim.mavlink.streams import COMPANION_RATES, GROUND_STATION_RATES
from rover_sim.mavlink.vehicle import Vehicle
from rover_sim.sim.mobility_events import Kind, MobilityEvent
from rover_sim.sim.rover import load_rover
from rover_sim.sim.rover_urdf import wheel_names
from tests.mavlink_rig import FOOTPRINT
from tests.test_mobility_events import rolling
from worlds.scenario import Origin

NAMES = wheel_names(load_rover("husky"))


class Scene:
    """A vehicle with a companion and a ground station, and the simulator beside it."""

    def __init__(self) -> None:
        station, theirs = memory_link()
        inner, outer = memory_link()
        links = [Link(inner, COMPANION_RATES), Link(theirs, GROUND_STATION_RATES, hears_simulator=True)]
        self.vehicle = Vehicle(Autopilot(FOOTPRINT, (0.0, 0.0, 0.0)), LocalFrame(Origin()), links)
        self.companion_end, self._station, self._parser = outer, station, Parser()
        self.narrator = Narrator(self.vehicle.endpoint)
        self.vehicle.tick(0.0, None, None)
        self.heard()

    def heard(self) -> list[Message]:
        """What the station has got from the simulator since the last call."""
        messages = [m for _, data in self._station.receive(0.0) for m in self._parser.datagram(data)]
        return [message for message in messages if message.get_srcComponent() == SIMULATOR]


def event(kind: Kind, wheel: int | None) -> MobilityEvent:
    return MobilityEvent(kind, 1.0, (0.0, 0.0, 0.0), wheel)


def test_events_are_told_as_the_simulators_own_words() -> None:
    scene = Scene()
    begun = [event(Kind.TRACTION_LOSS, wheel) for wheel in range(4)]
    begun += [event(Kind.SUPPORT_LOSS, 2), event(Kind.TIP_OVER, None)]
    scene.narrator.tell(rolling(), begun, NAMES)
    texts = [message for message in scene.heard() if message.get_type() == "STATUSTEXT"]
    assert [(message.text, message.severity) for message in texts] == [
        ("SIM: traction loss, all wheels", 4),
        ("SIM: support loss, right front", 6),
        ("SIM: imminent tip over", 2),
    ]
    assert {message.get_srcSystem() for message in texts} == {1}


def test_true_values_come_once_a_second() -> None:
    scene = Scene()
    for look in range(49):
        scene.narrator.tell(replace(rolling(), time_s=look / 24), [], NAMES)
    values = [message for message in scene.heard() if message.get_type() == "NAMED_VALUE_FLOAT"]
    assert len(values) == 3 * 4
    told = {message.name: message.value for message in values}
    assert told.keys() == {"sim_slip", "sim_sink", "sim_margin", "sim_clear"}
    assert told["sim_clear"] == np.float32(0.13)
    assert all(len(name) <= 10 for name in named_values(rolling()))


def test_the_planner_hears_nothing_of_it() -> None:
    scene = Scene()
    companion = Companion(Link(scene.companion_end, {}))
    companion.tick(0.0)
    scene.narrator.tell(rolling(), [event(Kind.TIP_OVER, None)], NAMES)
    frames = [data for _, data in scene.companion_end.receive(0.0)]
    assert not [m for data in frames for m in Parser().datagram(data) if m.get_srcComponent() == SIMULATOR]
    assert companion.status.texts == ()


def test_the_texts_name_the_wheels() -> None:
    assert event_text(Kind.EMBEDDING, [1, 3], NAMES) == "SIM: embedding, left rear, right rear"
    assert event_text(Kind.HIGH_CENTRED, [], NAMES) == "SIM: high centred"
