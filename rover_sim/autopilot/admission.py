"""What is refused: arming and modes, with the reason."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rover_sim.autopilot.modes import DRIVING_MODES, Mode

if TYPE_CHECKING:
    from rover_sim.autopilot.autopilot import Autopilot
    from worlds.types import PoseEstimate, Vector3


def unfit(autopilot: Autopilot, time_s: float | None, estimate: PoseEstimate | None) -> str | None:
    """Why the rover must not drive by itself now; None if it may."""
    if time_s is None:
        return "no pose estimate yet"
    return autopilot.failsafe.unfit(time_s, estimate, autopilot.parameters)


def arming_refusal(autopilot: Autopilot, time_s: float | None, estimate: PoseEstimate | None) -> str | None:
    """Why the rover must not be armed now."""
    reason = unfit(autopilot, time_s, estimate) or autopilot.failsafe.leaning(autopilot.parameters)
    reason = reason or autopilot.pilot.unfit()
    if reason is None and estimate is not None:
        reason = autopilot.fence.unfit(estimate.pose.position_w, autopilot.home_w)
    return reason or autopilot.battery.unfit()


def mode_refusal(autopilot: Autopilot, mode: Mode, time_s: float | None, estimate: PoseEstimate | None) -> str | None:
    """Why a mode is not possible now."""
    if mode is Mode.AUTO and autopilot.auto.mission.empty:
        return "no mission"
    if mode is Mode.SMART_RETURN and autopilot.returns.way_back().empty:
        return "the way back is not known"
    reason = unfit(autopilot, time_s, estimate) if mode in DRIVING_MODES else None
    if reason is None and mode is Mode.AUTO:
        return autopilot.fence.leads_out(autopilot.auto.mission, autopilot.home_w)
    return reason


def target_refusal(autopilot: Autopilot, estimate: PoseEstimate | None, position_w: Vector3) -> str | None:
    """Why the fence does not let the rover drive straight to a place from where it is."""
    here = None if estimate is None else estimate.pose.position_w
    return autopilot.fence.target_refusal(here, position_w, autopilot.home_w)
