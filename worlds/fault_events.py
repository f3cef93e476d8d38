"""Faults that a scenario lets happen: what breaks, when, for how long."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Literal

from worlds.errors import ScenarioError
from worlds.strict_toml import Table

if TYPE_CHECKING:
    from worlds.scenario import Scenario

FaultKind = Literal["sensor_loss", "stuck_wheel", "power_loss", "gnss_jump", "late_physics"]
LosableSensor = Literal["imu", "magnetometer", "barometer", "gnss", "camera", "encoder", "laser"]

# What each kind needs to be told; it is told nothing else but when.
_NEEDED: dict[FaultKind, tuple[str, ...]] = {
    "sensor_loss": ("sensor",),
    "stuck_wheel": ("wheel", "stuck"),
    "power_loss": (),
    "gnss_jump": ("offset_m",),
    "late_physics": ("stall_s",),
}
_DETAILS = ("sensor", "wheel", "stuck", "offset_m", "stall_s")


class Event(Table, frozen=True):
    """One fault; the details are those of its kind."""

    kind: FaultKind
    time_s: float  # simulated
    duration_s: float | None = None  # None: to the end
    sensor: LosableSensor | None = None  # of sensor_loss: it says nothing any more; encoders count no further
    wheel: int | None = None  # of stuck_wheel: place in the rover file, from 0
    stuck: Literal["held", "free"] | None = None  # of stuck_wheel: blocked, or turning without its motor
    offset_m: tuple[float, float, float] | None = None  # of gnss_jump: east, north, up
    stall_s: float | None = None  # of late_physics: one answer to an autopilot outside comes so late

    @property
    def end_s(self) -> float:
        """When it is over."""
        return inf if self.duration_s is None else self.time_s + self.duration_s

    def active(self, time_s: float) -> bool:
        """Whether it lasts at a time; begin included, end not."""
        return self.time_s - 1e-9 <= time_s < self.end_s - 1e-9


LIMITS: dict[str, tuple[float, float]] = {
    "event.time_s": (0.1, 1e6),  # every rover starts sound
    "event.duration_s": (0.01, 1e6),
    "event.wheel": (0, 99),
    "event.offset_m": (-1e4, 1e4),
    "event.stall_s": (0.001, 60.0),
}


def check_events(scenario: Scenario, source: str) -> None:
    """Raise a `ScenarioError` for an event without its details, with those of another kind, or of what is not there."""
    for number, event in enumerate(scenario.event):
        where = f"{source}: event[{number}]"
        for key in _DETAILS:
            given, needed = getattr(event, key) is not None, key in _NEEDED[event.kind]
            if needed and not given:
                raise ScenarioError(f'{where}.{key}: this key is required with kind = "{event.kind}"')
            if given and not needed:
                allowed = ", ".join(("time_s", "duration_s", *_NEEDED[event.kind]))
                raise ScenarioError(f'{where}.{key}: kind = "{event.kind}" takes {allowed}')
        if event.kind == "late_physics" and event.duration_s is not None:
            raise ScenarioError(f'{where}.duration_s: kind = "late_physics" takes stall_s instead')
        if event.time_s >= scenario.goal.time_limit_s:
            raise ScenarioError(
                f"{where}.time_s = {event.time_s:g}: must be before goal.time_limit_s = {scenario.goal.time_limit_s:g}"
            )
        _check_carried(scenario, event, where)


def _check_carried(scenario: Scenario, event: Event, where: str) -> None:
    carried = {
        "gnss": scenario.sensors.gnss,
        "laser": scenario.sensors.laser,
        "camera": scenario.camera.rate_hz > 0.0,
    }
    if event.sensor is not None and not carried.get(event.sensor, True):
        raise ScenarioError(f"{where}.sensor = {event.sensor}: the scenario gives the rover none")
    if event.kind == "gnss_jump" and not scenario.sensors.gnss:
        raise ScenarioError(f"{where}.kind = gnss_jump: sensors.gnss is false")


def describe(event: Event) -> str:
    """The fault in a few words."""
    match event.kind:
        case "sensor_loss":
            return f"{event.sensor} silent"
        case "stuck_wheel":
            return f"wheel {event.wheel} {'blocked' if event.stuck == 'held' else 'without its motor'}"
        case "power_loss":
            return "motors without power"
        case "gnss_jump":
            east, north, up = event.offset_m or (0.0, 0.0, 0.0)
            return f"gnss off by {east:g}, {north:g}, {up:g} m"
        case "late_physics":
            return f"physics {event.stall_s:g} s late"
