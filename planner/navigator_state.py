"""What a navigator knows, intends and decides."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from planner.choice import Models, Place
from planner.corridor import SpeedModel
from planner.obstacle_map import NO_OBSTACLES
from planner.recovery import Ladder, Manoeuvre
from planner.room import NOT_DUG, turning
from planner.row_search import Candidate
from planner.terrain_map import MemoryModel, TerrainMemory
from planner.track import NO_TRACK
from worlds.geometry import euler_from_quaternion, rotation_from_quaternion
from worlds.types import FloatArray, PoseEstimate

Kind = Literal["drive", "look", "back_up", "arrived", "no_path", "lost"]


@dataclass(frozen=True)
class NavigatorModel:
    """How long a way is kept and when the navigator gives up."""

    memory: MemoryModel = MemoryModel()  # noqa: RUF009 - frozen
    keep_gain_m: float = 1.0  # a new way must be better by this
    keep_share: float = 0.06  # and by this share
    extend_below_m: float = 3.8  # a way that ends sooner, and not at the goal, is renewed
    off_way_m: float = 0.45
    blocked_m: float = 1.2  # a way that is blocked farther off is as good as what is free of it
    wobble_m: float = 0.05  # a rock that moves so much into a way does not break it
    arrival_share: tuple[float, float] = (0.8, 0.9)  # of the goal's radius, at least and at most ...
    arrival_sigmas: float = 2.0  # ... within which the rover is there although it errs by so many sigmas
    patience_m: float = 40.0  # driven without getting nearer, beside twice the first distance
    speed: SpeedModel = SpeedModel()  # noqa: RUF009 - frozen; where a laser scanner leads
    progress_m: float = 1.5  # away from the last recovery: the ladder starts anew


@dataclass(frozen=True, eq=False)
class Decision:
    """What to do until the next decision."""

    kind: Kind
    reason: str
    waypoints_w: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))  # (N, 2) from the rover on
    changed: bool = False  # the waypoints are not those of the decision before
    narrow: bool = False  # drive: with the smaller margin
    traversability: float = 0.0
    candidates: tuple[Candidate, ...] = ()
    scores: tuple[float, ...] = ()  # traversability of each candidate
    heading_rad: float = 0.0  # look: turn to it
    speed_m_s: float | None = None  # drive, back_up: at most so fast now; None: as the risk allows

    @property
    def risk(self) -> float:
        """0..1 for the speed of driving."""
        return float(np.clip(1.0 - self.traversability, 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class NavigatorState:
    """All that the navigator knows and intends."""

    models: Models
    model: NavigatorModel
    goal_w: tuple[float, float]
    goal_radius_m: float
    memory: TerrainMemory
    avoid_w: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))  # (M, 3) x, y, radius of trouble met
    dug_w: FloatArray = field(default_factory=lambda: NOT_DUG)  # (D, 2) where turns on the spot were in vain
    track_w: FloatArray = field(default_factory=lambda: NO_TRACK)  # (N, 3) poses driven, see `planner.track`
    fence: FloatArray = field(default_factory=lambda: NO_OBSTACLES)  # (K, 7) round the ground that may be driven on
    forbidden: FloatArray = field(default_factory=lambda: NO_OBSTACLES)  # (L, 7) of the map, see `retarget`
    way: Decision | None = None  # the way being driven
    detour: bool = False
    manoeuvre: Manoeuvre | None = None
    ladder: Ladder = Ladder()  # noqa: RUF009 - frozen
    warned: tuple[float, float, int] = (np.inf, np.inf, 0)  # where a rock lay ahead, and what was done there
    end: Decision | None = None
    slope_rad: float = 0.0  # smoothed
    downhill_w: tuple[float, float] = (0.0, 0.0)  # rise over run, smoothed
    travelled_m: float = 0.0
    place_w: tuple[float, float] | None = None
    lately: tuple[tuple[float, float, float], ...] = ()  # time and place of the last looks
    best_m: float = np.inf  # nearest to the goal so far
    best_at_m: float = 0.0  # travelled then
    first_m: float = 0.0  # distance to the goal at the start


def place_of(state: NavigatorState, estimate: PoseEstimate) -> Place:
    """Where the rover is, as choosing a way sees it."""
    x, y = (float(value) for value in estimate.pose.position_w[:2])
    yaw = euler_from_quaternion(estimate.pose.quaternion_w)[2]
    slope_deg, speed = float(np.rad2deg(state.slope_rad)), float(np.linalg.norm(estimate.velocity_w[:2]))
    bold, downhill = state.ladder.bold, state.downhill_w
    held = turning(state.memory.rocks, estimate.pose.position_w[:2], yaw, state.models.footprint, state.dug_w)
    down_deg = -float(np.rad2deg(np.arcsin(np.clip(rotation_from_quaternion(estimate.pose.quaternion_w)[2, 0], -1, 1))))
    return Place((x, y), yaw, state.goal_w, state.goal_radius_m, slope_deg, bold, speed, downhill, held, down_deg)
