"""Watches the fence: what is outside of it, when the rover crosses it, and what is told of that."""

from __future__ import annotations

import math

from rover_sim.autopilot.alarm import Alarm
from rover_sim.autopilot.fence import NO_FENCE_M, Circle, Fence
from rover_sim.autopilot.mission import DriveTo, Jump, Mission, ReturnHome
from rover_sim.autopilot.modes import Severity
from rover_sim.autopilot.parameters import ParameterTable
from rover_sim.autopilot.safety_parameters import FenceRules, fence_rules
from worlds.types import FloatArray, PoseEstimate, Vector3

_LEAST_STEP_M = 0.05  # along a way that runs beside a line


class FenceGuard:
    """One crossing is one breach, and its response is given once: whoever then drives can bring the rover back."""

    def __init__(self, parameters: ParameterTable) -> None:
        self.fence = Fence()
        self.breached = False
        self.breaches = 0  # so far
        self.breach_s = 0.0  # time of the last one
        self._told = self._near = False
        self._parameters = parameters

    @property
    def on(self) -> bool:
        """Whether there is a fence that counts now."""
        rules = self._rules
        return rules.on and (rules.radius_m < NO_FENCE_M or (rules.list_on and bool(self.fence.areas)))

    def unfit(self, position_w: FloatArray | Vector3, home_w: Vector3) -> str | None:
        """Why a rover at this place must not be armed."""
        if not self.allows(position_w, home_w):
            return "outside of the fence"
        missing = self._rules.on and self._rules.must_exist and not self.on
        return "the fence is switched on, but there is none" if missing else None

    def clearance_m(self, position_w: FloatArray | Vector3, home_w: Vector3) -> float:
        """How far a place is inside of what is allowed, below 0 outside; `NO_FENCE_M` without a fence."""
        rules, x_m, y_m = self._rules, float(position_w[0]), float(position_w[1])
        if not rules.on:
            return NO_FENCE_M
        about_home = Circle((home_w[0], home_w[1]), rules.radius_m, inclusion=True).depth_m(x_m, y_m)
        if not rules.list_on:
            return about_home
        return min(about_home, self.fence.clearance_m(x_m, y_m, any_inclusion=rules.any_inclusion))

    def allows(self, position_w: FloatArray | Vector3, home_w: Vector3) -> bool:
        """Whether the rover may be at a place."""
        return self.clearance_m(position_w, home_w) >= 0.0

    def crosses(self, start_w: FloatArray | Vector3, end_w: FloatArray | Vector3, home_w: Vector3) -> bool:
        """Whether a straight way leaves what is allowed.

        The clearance changes by no more than the way that is made, so each look allows a step of that length.
        """
        way_m, at_m = math.dist(start_w[:2], end_w[:2]), 0.0
        while at_m < way_m:
            share = at_m / way_m
            x_m, y_m = (float(a + share * (b - a)) for a, b in zip(start_w[:2], end_w[:2], strict=True))
            clearance_m = self.clearance_m((x_m, y_m, 0.0), home_w)
            if clearance_m < 0.0:
                return True
            at_m += max(clearance_m, _LEAST_STEP_M)
        return not self.allows(end_w, home_w)

    def target_refusal(
        self, start_w: FloatArray | Vector3 | None, end_w: FloatArray | Vector3, home_w: Vector3
    ) -> str | None:
        """Why the rover must not drive straight to a place; a rover that is outside may come in any way."""
        if not self.allows(end_w, home_w):
            return "the target is outside of the fence"
        inside = start_w is not None and self.allows(start_w, home_w)
        if inside and start_w is not None and self.crosses(start_w, end_w, home_w):
            return "the way to the target leads out of the fence"
        return None

    def leads_out(self, mission: Mission, home_w: Vector3) -> str | None:
        """The first place of a mission, or way between two, that is not allowed; None if there is none."""
        before: Vector3 | None = None
        for index, item in enumerate(mission.items if self.on else ()):
            if isinstance(item, DriveTo):
                if not self.allows(item.position_w, home_w):
                    return f"item {index} is outside of the fence"
                if before is not None and self.crosses(before, item.position_w, home_w):
                    return f"the way to item {index} leads out of the fence"
                before = item.position_w
            elif isinstance(item, (ReturnHome, Jump)):
                before = None  # where it goes on from is not known yet
        return None

    def update(self, time_s: float, estimate: PoseEstimate, home_w: Vector3, *, armed: bool) -> Alarm | None:
        """Look at the rover's place; to be called at every control step."""
        rules = self._rules
        clearance_m = self.clearance_m(estimate.pose.position_w, home_w) if rules.on else NO_FENCE_M
        self.breached = clearance_m < 0.0
        told, self._told = self._told, self.breached and armed
        if self._told and not told:
            self.breaches += 1
            self.breach_s = time_s
            return Alarm(Severity.CRITICAL if rules.response else Severity.WARNING, "Fence breached", rules.response)
        if told and not self._told:
            return Alarm(Severity.NOTICE, "Fence: inside again") if armed else None
        return self._margin_alarm(clearance_m, rules) if armed else None

    def _margin_alarm(self, clearance_m: float, rules: FenceRules) -> Alarm | None:
        """One warning each time that the rover comes near a line; half as far again counts as gone away."""
        near, was = 0.0 <= clearance_m < rules.margin_m, self._near
        self._near = near or (was and clearance_m < 1.5 * rules.margin_m)
        return Alarm(Severity.NOTICE, f"Fence {clearance_m:.1f} m away") if near and not was else None

    @property
    def _rules(self) -> FenceRules:
        return self._parameters.derived(fence_rules)
