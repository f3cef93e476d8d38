"""Teleoperation that ends, a thousand ways: how long the wheels go on turning, in simulated time over a bad link."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.faults import Faults
from rover_sim.mavlink.persona import PERSONAS
from tests.mavlink_rig import Station, Yard

ENDINGS = ("centred", "let go", "silent", "cut")
RATES_HZ = (10.0, 20.0, 25.0, 50.0)
NEUTRAL_S = 0.050  # beyond the configured time


@dataclass(frozen=True)
class Trial:
    """One drive and its end."""

    number: int
    persona: str
    ending: str
    configured_s: float
    in_flight_s: float  # the longest that the link may keep what was sent before the end
    still_s: float  # from the end until the wheels stood still
    drove: bool

    @property
    def in_time(self) -> bool:
        """Whether the wheels stood still in time; a cut link delivers nothing that was on its way."""
        held_s = 0.0 if self.ending == "cut" else self.in_flight_s
        return self.still_s <= self.configured_s + held_s + NEUTRAL_S + 1e-9


def run_trial(number: int) -> Trial:
    """Trial of this number; the same each time."""
    rng = np.random.default_rng([26, number])
    persona = PERSONAS[str(rng.choice(list(PERSONAS)))]
    faults = Faults(
        loss=float(rng.uniform(0.0, 0.3)),
        delay_s=float(rng.uniform(0.0, 0.3)),
        jitter_s=float(rng.uniform(0.0, 0.1)),
        duplicate=float(rng.uniform(0.0, 0.1)),
        reorder=float(rng.uniform(0.0, 0.1)),
    )
    station = Station(255, 190, faults, number)
    yard = Yard(station, persona=persona)
    configured_s = float(rng.choice([0.3, 0.5, 1.0, yard.autopilot.parameters[persona.steering.stick_time]]))
    yard.autopilot.parameters.set(persona.steering.stick_time, configured_s)
    yard.autopilot.arm()
    yard.autopilot.set_mode(Mode.MANUAL)
    neutral, least = persona.steering.neutral_thrust, persona.steering.least_thrust
    centre = _manual(neutral)
    thrust = int(rng.integers(neutral + 200, 1001) if rng.random() < 0.5 else rng.integers(least, neutral - 200))
    deflected = _manual(thrust, int(rng.integers(-1000, 1001)))
    period_s = 1.0 / float(rng.choice(RATES_HZ))
    _say(yard, station, centre, period_s, 1.0, lambda: False)
    _say(yard, station, deflected, period_s, float(rng.uniform(1.0, 1.5)), lambda: False)
    drove = any(yard.rover.wheels)
    ending = str(rng.choice(ENDINGS))
    end_s = yard.time_s
    if ending == "cut":
        station.cut()
    last = {"centred": centre, "let go": _manual(32767, 32767)}.get(ending)
    _say(yard, station, last, period_s, configured_s + 2.0, lambda: _at_rest(yard))
    in_flight_s = 2.0 * (faults.delay_s + faults.jitter_s) + 0.05  # one that is overtaken waits so long
    return Trial(number, persona.name, ending, configured_s, in_flight_s, yard.time_s - end_s, drove)


def _at_rest(yard: Yard) -> bool:
    return not any(yard.rover.wheels) or yard.autopilot.mode is not Mode.MANUAL


def _manual(thrust: int, steer: int = 0) -> Message:
    return mavlink.MAVLink_manual_control_message(1, 0, steer, thrust, 0, 0)


def _say(
    yard: Yard, station: Station, message: Message | None, period_s: float, seconds: float, done: Callable[[], bool]
) -> None:
    """Send a message, if there is one, again and again until the time has passed or it is ``done``."""
    end_s, next_s = yard.time_s + seconds, yard.time_s
    while yard.time_s < end_s and not done():
        if message is not None and yard.time_s >= next_s:
            station.send(message, yard.time_s)
            next_s += period_s
        yard.step()
