"""A rover's physics at 250 Hz under a session for PX4, without planner and judge."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, cast

import numpy as np

from rover_sim.hil.outputs import OutputDriver
from rover_sim.hil.px4_peer import PROGRAM, Profile, Px4Peer, Wait
from rover_sim.hil.px4_session import STEPS_PER_S, Clockwork, Px4Session
from rover_sim.hil.session import NOBODY, Driven, Watchers
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.transport import Transport
from rover_sim.outcome import Reason
from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from rover_sim.traverse import Stepped, Traverse
from worlds.types import World


class Drive:
    """A simulation in the place of a traverse; ends after so many simulated seconds.

    ``at_step``: what a test does meanwhile, by the number of the step.
    """

    def __init__(
        self, world: World, seconds: float, at_step: Callable[[int], None] = lambda _: None, looks_every: int = 125
    ) -> None:
        rover = load_rover("husky")
        self.world = world
        self.simulation = Simulation(world, rover, np.random.default_rng(0), time_step_s=1.0 / STEPS_PER_S)
        self.outputs = OutputDriver(rover.footprint())
        self.steps, self._last = 0, round(seconds * STEPS_PER_S)
        self._at_step, self._looks_every = at_step, looks_every

    def step(self, on_sight: object) -> Stepped:
        del on_sight
        self._at_step(self.steps)
        self.simulation.step(self.outputs.wheel_speed_rad_s)
        self.steps += 1
        return Stepped(self.steps % self._looks_every == 0, (Reason.GOAL, "") if self.steps >= self._last else None)

    def close(self) -> None:
        self.simulation.close()

    def status(self) -> None:
        """Nobody reads it."""

    def summary(self, reason: Reason, detail: str, *, wall_time_s: float) -> dict[str, Any]:
        del wall_time_s
        return {"reason": reason.value, "detail": detail}


def session(
    drives: Drive | Iterable[Drive],
    transport: Transport,
    wait: Wait,
    *,
    left_s: Callable[[float], float] = lambda _: 0.0,
    patience_s: float = 5.0,
    profile: Profile = PROGRAM,
    watchers: Watchers = NOBODY,
) -> Px4Session:
    """A session over that link; a drive for each start of PX4. Without ``left_s`` as fast as the lockstep lets it."""
    order = iter([drives] if isinstance(drives, Drive) else drives)

    def begin() -> Driven:
        drive = next(order)
        return Driven(cast(Traverse, drive), drive.outputs)

    def meet(driven: Driven) -> Px4Peer:
        x, y, z = driven.traverse.simulation.chassis_motion[:3].tolist()
        return Px4Peer(transport, LocalFrame(driven.traverse.world.origin), (x, y, z), "the link", profile)

    return Px4Session(begin, meet, Clockwork(wait, left_s, patience_s), watchers)
