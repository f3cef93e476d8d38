"""The rover's MAVLink as a whole: vehicle and companion in one process, ground stations beside them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rover_sim.autopilot.autopilot import Autopilot
from rover_sim.mavlink.companion import Companion
from rover_sim.mavlink.endpoint import Link
from rover_sim.mavlink.faults import Faults
from rover_sim.mavlink.faulty import FaultyLink
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.memory import memory_link
from rover_sim.mavlink.narrator import Narrator
from rover_sim.mavlink.streams import COMPANION_RATES, GROUND_STATION_RATES
from rover_sim.mavlink.tlog import SIMULATED_EPOCH_S, TlogWriter
from rover_sim.mavlink.transport import open_link, parse_url
from rover_sim.mavlink.vehicle import Vehicle
from worlds.scenario import Origin
from worlds.types import PoseEstimate, SensorReadings


@dataclass(frozen=True)
class BadLink:
    """Faults for all links, and the seed that draws them."""

    faults: Faults
    seed: tuple[int, ...]

    def rng(self, number: int) -> np.random.Generator:
        """The randomness of one link."""
        return np.random.default_rng([*self.seed, number])


def open_links(
    urls: Sequence[str],
    tlog: Path | None = None,
    epoch_s: float = SIMULATED_EPOCH_S,
    bad: BadLink | None = None,
) -> tuple[list[Link], Link | None]:
    """A link to ground stations for each URL, and the log; if one cannot be opened, those before are closed again."""
    links = []
    with ExitStack() as undo:
        for number, url in enumerate(urls, start=1):
            transport, is_cable = open_link(url), parse_url(url).kind == "serial"
            undo.callback(transport.close)
            if bad is not None:
                transport = FaultyLink(transport, bad.faults, bad.rng(number))
            links.append(Link(transport, GROUND_STATION_RATES, hears_simulator=True, is_cable=is_cable))
        writer = None if tlog is None else TlogWriter(tlog, epoch_s)
        undo.pop_all()  # all are open: from here on the vehicle's `close` is responsible
    return links, None if writer is None else Link(writer, GROUND_STATION_RATES, hears_simulator=True)


class MavlinkStack:
    """Vehicle and companion on a memory link, and one more link for each URL; all of them bad where wanted.

    Raises InputError or LinkError if a link cannot be opened; those opened before are closed again.
    """

    def __init__(
        self,
        origin: Origin,
        autopilot: Autopilot,
        connect: Sequence[str] = (),
        tlog: Path | None = None,
        epoch_s: float = SIMULATED_EPOCH_S,
        bad: BadLink | None = None,
    ) -> None:
        self.frame = LocalFrame(origin)
        inner, outer = memory_link() if bad is None else memory_link(bad.faults, bad.rng(0))
        stations, log = open_links(connect, tlog, epoch_s, bad)
        links = [Link(inner, COMPANION_RATES), *stations]
        self.vehicle = Vehicle(autopilot, self.frame, links, log, folder=None if tlog is None else tlog.parent)
        self.narrator = Narrator(self.vehicle.endpoint)
        self.companion = Companion(Link(outer, {}))

    def tick(self, time_s: float, estimate: PoseEstimate | None, readings: SensorReadings | None) -> None:
        """One round: the vehicle answers and streams, then the companion; call it right after ``Autopilot.update``."""
        self.vehicle.tick(time_s, estimate, readings)
        self.companion.tick(time_s)

    def save_plans(self, waypoints: Path, plan: Path) -> None:
        """Write the mission that the vehicle holds, in both of QGroundControl's formats."""
        self.vehicle.save_plans(waypoints, plan)

    def close(self) -> None:
        """Close all links and finish the log."""
        self.companion.close()
        self.vehicle.close()
