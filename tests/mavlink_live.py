"""A rover without physics that lives at wall-clock speed on a UDP port, and MAVSDK's view of it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.mavlink.camera_messages import CameraPort
from rover_sim.mavlink.companion import Companion
from rover_sim.mavlink.endpoint import Link
from rover_sim.mavlink.geodesy import GeoPoint, LocalFrame
from rover_sim.mavlink.memory import memory_link
from rover_sim.mavlink.persona import Persona
from rover_sim.mavlink.signing import Signing
from rover_sim.mavlink.stack import BadLink, open_links
from rover_sim.mavlink.streams import COMPANION_RATES
from rover_sim.mavlink.transport import parse_url
from rover_sim.mavlink.udp import UdpIn
from rover_sim.mavlink.vehicle import Vehicle
from tests.mavlink_rig import FOOTPRINT, KinematicRover
from worlds.scenario import Origin

HOME = (0.0, 0.0, 0.0)
STEP_S = 1.0 / 48.0


def mavsdk_library() -> Any:
    try:
        import mavsdk
    except (ImportError, OSError) as error:  # the wheel brings a compiled library
        pytest.skip(f"the MAVSDK library cannot be loaded here: {error}")
    return mavsdk


class LiveRover:
    """Rover, autopilot, vehicle and companion, ticked by a thread of its own at wall-clock speed."""

    def __init__(
        self,
        url: str,
        persona: Persona,
        folder: Path | None = None,
        bad: BadLink | None = None,
        camera: CameraPort | None = None,
        signing: Signing | None = None,
    ) -> None:
        self.rover = KinematicRover()
        self.autopilot = Autopilot(FOOTPRINT, HOME)
        self.frame = LocalFrame(Origin())
        inner, outer = memory_link()
        stations, _ = open_links([url], bad=bad)
        links = [Link(inner, COMPANION_RATES), *stations]
        self.vehicle = Vehicle(self.autopilot, self.frame, links, None, persona, folder, camera, signing)
        self.companion = Companion(Link(outer, {}))
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        self._thread.start()

    def _run(self) -> None:
        start = time.perf_counter()
        while not self._stop.is_set():
            with self._lock:
                wheels = self.autopilot.update(self.rover.time_s, self.rover.estimate(), self.rover.readings())
                self.vehicle.tick(self.rover.time_s, self.rover.estimate(), self.rover.readings())
                self.companion.tick(self.rover.time_s)
                self.rover.move(wheels, STEP_S)
            self._stop.wait(max(start + self.rover.time_s - time.perf_counter(), 0.0))

    def locked(self, action: Callable[[], Any]) -> Any:
        with self._lock:
            return action()

    def until(self, done: Callable[[], bool], limit_s: float = 8.0) -> None:
        end = time.perf_counter() + limit_s
        while not self.locked(done):
            assert time.perf_counter() < end, "time limit"
            self._stop.wait(0.01)

    def wait(self, seconds: float) -> None:
        """Let the rover live on; returns early when it is closed."""
        self._stop.wait(seconds)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.vehicle.close()


@contextmanager
def connected_pair(
    persona: Persona, folder: Path | None = None, bad: BadLink | None = None, camera: CameraPort | None = None
) -> Iterator[tuple[LiveRover, Any]]:
    """A live rover and the system that MAVSDK has found in it."""
    library = mavsdk_library()
    free = UdpIn(parse_url("udpin:127.0.0.1:0"))
    port = free.port
    free.close()
    live = LiveRover(f"udpout:127.0.0.1:{port}", persona, folder, bad, camera)
    kind = library.ComponentType.GROUND_STATION
    client = library.Mavsdk(library.Configuration.create_with_component_type(kind))
    assert client.add_any_connection(f"udpin://127.0.0.1:{port}") == library.ConnectionResult.SUCCESS
    live.start()
    system = client.first_autopilot(5.0)
    assert system is not None, "MAVSDK found no autopilot"
    try:
        yield live, system
    finally:
        client.destroy()
        live.close()


def place(live: LiveRover, x_m: float, y_m: float) -> GeoPoint:
    """A place in the world as a place on Earth."""
    return live.frame.to_geo((x_m, y_m, 0.0))
