"""What the simulator knows and no vehicle could measure, for people at a ground station and for the log.

It is said by a component of its own, each text begins with SIM and each name with sim_, and the planner's link does not
carry it: the rover drives by what it believes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rover_sim.autopilot.modes import Severity
from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.endpoint import Endpoint
from rover_sim.mavlink.status import status_texts
from rover_sim.sim.mobility_events import Kind, MobilityEvent
from rover_sim.sim.vehicle_state import VehicleState

_PERIOD_S = 1.0
_SEVERITY: Mapping[Kind, Severity] = {
    Kind.TRACTION_LOSS: Severity.WARNING,
    Kind.WHEEL_TRAP: Severity.WARNING,
    Kind.SUPPORT_LOSS: Severity.INFO,  # a rover without springs lifts a wheel often
    Kind.HIGH_CENTRED: Severity.WARNING,
    Kind.TIP_OVER: Severity.CRITICAL,
    Kind.EMBEDDING: Severity.WARNING,
}


class Narrator:
    """Speaks as the simulator on the links of one endpoint."""

    def __init__(self, endpoint: Endpoint) -> None:
        self._endpoint = endpoint
        self._due_s = 0.0
        self._texts = 0

    def tell(self, state: VehicleState, begun: Sequence[MobilityEvent], wheels: Sequence[str]) -> None:
        """A STATUSTEXT for each kind of event that begins, and once a second NAMED_VALUE_FLOAT of the true state.

        ``wheels``: names of the wheels as in `rover_urdf.wheel_names`.
        """
        for kind in dict.fromkeys(event.kind for event in begun):
            at = [event.wheel for event in begun if event.kind is kind and event.wheel is not None]
            self.say(_SEVERITY[kind], event_text(kind, at, wheels))
        if state.time_s >= self._due_s:
            self._due_s = state.time_s + _PERIOD_S
            for name, value in named_values(state).items():
                boot_ms = int(1e3 * state.time_s) & 0xFFFFFFFF
                message = mavlink.MAVLink_named_value_float_message(boot_ms, name.encode("ascii"), value)
                self._endpoint.tell_as_simulator(message)

    def say(self, severity: Severity, text: str) -> None:
        """A STATUSTEXT."""
        self._texts = self._texts % 60000 + 1
        for message in status_texts(severity, text, self._texts):
            self._endpoint.tell_as_simulator(message)


def event_text(kind: Kind, at: Sequence[int], wheels: Sequence[str]) -> str:
    """One sentence: what, and at which wheels."""
    text = f"SIM: {kind.value}"
    if at:
        text += ", all wheels" if len(at) == len(wheels) else "".join(f", {wheels[place]}" for place in at)
    return text.replace("wheel_left", "left").replace("wheel_right", "right").replace("_", " ")


def named_values(state: VehicleState) -> dict[str, float]:
    """True slip (mean), sinkage (deepest, m), stability margin and belly clearance (m), by names of 10 characters."""
    return {
        "sim_slip": float(np.abs(state.slip).mean()),
        "sim_sink": float(state.sinkage_m.max()),
        "sim_margin": state.stability_margin,
        "sim_clear": state.belly_clearance_m,
    }
