"""A flat world of discs with a kinematic rover and a camera that sees discs: enough to close the planner's loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from planner import choice, mobility, navigator
from planner.mobility import Command
from planner.navigator_state import Decision, NavigatorState
from worlds.geometry import quaternion_from_euler
from worlds.types import BoolArray, FloatArray, Footprint, Observation, PerceivedRock, Pose, PoseEstimate

FOOTPRINT = Footprint(
    length_m=0.99,
    width_m=0.67,
    wheel_radius_m=0.165,
    track_m=0.57,
    wheelbase_m=0.51,
    clearance_m=0.13,
    max_speed_m_s=0.8,
    max_yaw_rate_rad_s=1.2,
)


def pose_at(x_m: float, y_m: float, yaw_rad: float, time_s: float = 0.0) -> PoseEstimate:
    """An exact estimate of a rover that stands at a place."""
    pose = Pose(np.array([x_m, y_m, 0.165]), quaternion_from_euler(0.0, 0.0, yaw_rad))
    return PoseEstimate(time_s, pose, np.zeros(3), 0.0, 0.02, 0.01)


def drive(state: FloatArray, command: Command, step_s: float) -> FloatArray:
    """Place and heading (3,) after ``step_s`` of a motion without slip."""
    heading = state[2] + 0.5 * step_s * command.yaw_rate_rad_s
    motion = np.array([np.cos(heading), np.sin(heading)]) * command.linear_m_s * step_s
    return np.array([state[0] + motion[0], state[1] + motion[1], state[2] + step_s * command.yaw_rate_rad_s])


@dataclass(frozen=True, eq=False)
class DiscWorld:
    """Round rocks on flat ground."""

    centre: FloatArray  # (N, 2)
    radius: FloatArray  # (N,)
    height: FloatArray  # (N,)

    @staticmethod
    def of(discs: list[tuple[float, float, float]], height_m: float = 0.3) -> DiscWorld:
        """Discs given by x, y and radius, all of one height."""
        table = np.array(discs).reshape(-1, 3)
        return DiscWorld(table[:, :2], table[:, 2], np.full(len(table), height_m))

    def near(self, place: FloatArray, range_m: float) -> DiscWorld:
        """The discs around a place."""
        kept = np.hypot(*(self.centre - place).T) < range_m
        return DiscWorld(self.centre[kept], self.radius[kept], self.height[kept])


def rock_field(cfa: float, length_m: float, rng: np.random.Generator, half_width_m: float = 10.0) -> DiscWorld:
    """Rocks of 0.1 to 1.2 m by the size-frequency law of Golombek and Rapp (1997), none near start and goal."""
    low, high = np.array([-4.0, -half_width_m]), np.array([length_m + 4.0, half_width_m])
    q = 1.79 + 0.152 / cfa
    sizes = np.linspace(0.1, 1.2, 400)
    density = cfa * q * np.exp(-q * sizes) / (np.pi * sizes**2 / 4)
    expected = density * (sizes[1] - sizes[0]) * np.prod(high - low)
    diameter = np.repeat(sizes, rng.poisson(expected))
    centre = rng.uniform(low, high, (len(diameter), 2))
    clear = 1.5 + diameter / 2
    kept = (np.hypot(*centre.T) > clear) & (np.hypot(centre[:, 0] - length_m, centre[:, 1]) > clear)
    height = diameter * rng.uniform(0.25, 0.5, len(diameter))
    return DiscWorld(centre[kept], diameter[kept] / 2, height[kept])


def look(
    world: DiscWorld, state: FloatArray, time_s: float, rng: np.random.Generator | None, range_m: float = 8.0
) -> Observation:
    """What an ideal (``rng`` None) or a noisy camera of 74 deg sees from 1.1 to 8 m, occlusion included."""
    world = world.near(state[:2], range_m + 1.0)
    offset = world.centre - state[:2]
    distance = np.hypot(*offset.T)
    bearing = np.angle(np.exp(1j * (np.arctan2(offset[:, 1], offset[:, 0]) - state[2])))
    half_view = np.deg2rad(37.0)
    visible = (np.abs(bearing) < half_view) & (distance > 1.1) & (distance < range_m) & (world.height > 0.04)
    index = np.flatnonzero(visible & ~_hidden(world, distance, bearing))
    rocks = []
    for n in index:
        along = 0.02 + 0.006 * distance[n] ** 2
        shift, size, height, seen = np.zeros(2), 1.0, 1.0, True
        if rng is not None:
            sight = offset[n] / distance[n]
            shift = sight * rng.normal(0, along) + np.array([-sight[1], sight[0]]) * rng.normal(0, 0.01 * distance[n])
            size, height = 1.0 + rng.normal(0, 0.1, 2)
            seen = rng.random() > 0.1
        if seen:
            x, y = world.centre[n] + shift
            width = 2 * float(world.radius[n]) * size
            rocks.append(
                PerceivedRock(
                    (x, y, 0.0), width, width, float(world.height[n]) * height, 0.0, 0.8, 0, float(distance[n]), along
                )
            )
    if rng is not None and rng.random() < 0.2:  # a shadow taken for a rock
        r, angle = rng.uniform(1.5, 6.0), state[2] + rng.uniform(-0.5, 0.5)
        place = (state[0] + r * np.cos(angle), state[1] + r * np.sin(angle), 0.0)
        rocks.append(PerceivedRock(place, 0.3, 0.3, 0.15, 0.0, 0.5, 0, r, 0.02 + 0.006 * r**2))
    angles = state[2] + np.linspace(-half_view, half_view, 9)
    arc = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    outline = state[:2] + np.vstack([1.1 * arc, range_m * arc[::-1]])
    outline = outline[::-1] if _area(outline) < 0 else outline
    return Observation(time_s, tuple(rocks), np.zeros((0, 0), dtype="<U1"), np.zeros((0, 0, 2)), outline)


def _area(outline: FloatArray) -> float:
    x, y = outline.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def _hidden(world: DiscWorld, distance: FloatArray, bearing: FloatArray) -> BoolArray:
    """Whether a nearer rock's shadow from a camera 1.1 m up covers the top of each rock."""
    camera_m = 1.1
    top = (camera_m - world.height) / distance  # falls as the top is seen higher up
    nearer = distance[None] < distance[:, None] - world.radius[None]
    width = np.arcsin(np.clip(world.radius / np.maximum(distance, 1e-6), 0, 1))
    covered = np.abs(np.angle(np.exp(1j * (bearing[:, None] - bearing[None])))) < width[None]
    hidden: BoolArray = np.any(nearer & covered & (top[None] < top[:, None]), axis=1)
    return hidden


def collides(world: DiscWorld, state: FloatArray, height_m: float = 0.10) -> bool:
    """Whether the rover's outline meets a rock higher than ``height_m``."""
    world = world.near(state[:2], 1.5)
    offset = world.centre[world.height > height_m] - state[:2]
    sin, cos = np.sin(state[2]), np.cos(state[2])
    x, y = offset[:, 0] * cos + offset[:, 1] * sin, offset[:, 1] * cos - offset[:, 0] * sin
    out = np.hypot(np.maximum(np.abs(x) - FOOTPRINT.length_m / 2, 0), np.maximum(np.abs(y) - FOOTPRINT.width_m / 2, 0))
    return bool((out < world.radius[world.height > height_m]).any())


@dataclass(frozen=True, eq=False)
class Traverse:
    """How a closed-loop traverse went."""

    end: str  # arrived, no_path, timeout
    reason: str
    track: FloatArray  # (T, 3)
    collisions: int  # ticks with the outline over a high rock
    missions: int  # times the way changed
    looks: int
    backs: int
    sim_time_s: float
    decision_s: list[float]
    state: NavigatorState

    @property
    def length_m(self) -> float:
        """Driven way."""
        return float(np.hypot(*np.diff(self.track[:, :2], axis=0).T).sum())


def traverse(
    world: DiscWorld,
    goal: tuple[float, float],
    *,
    rng: np.random.Generator | None = None,
    time_limit_s: float = 200.0,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    clock: Callable[[], float] | None = None,
    on_decision: Callable[[float, FloatArray, Decision, NavigatorState], None] | None = None,
    models: choice.Models | None = None,
) -> Traverse:
    """Drive from ``start`` to ``goal``: a decision and a picture every 0.5 s, motion every 0.05 s."""
    pose = np.array(start, dtype=float)
    state = navigator.begin(goal, 0.5, FOOTPRINT, (start[0], start[1]), models=models)
    limits, progress, command = mobility.Limits(), mobility.Progress(), mobility.STOP
    decision: Decision | None = None
    track, collisions, missions, looks, backs, spent = [pose], 0, 0, 0, 0, []
    backing: FloatArray | None = None
    end, reason = "timeout", ""
    time_s = 0.0
    for tick in range(int(time_limit_s / 0.05)):
        time_s = tick * 0.05
        estimate = pose_at(pose[0], pose[1], pose[2], time_s)
        if tick % 10 == 0:
            seen = look(world, pose, time_s, rng)
            began = clock() if clock else 0.0
            before = decision
            state, decision = navigator.step(state, seen, estimate, time_s)
            spent.append((clock() if clock else 0.0) - began)
            if on_decision:
                on_decision(time_s, pose, decision, state)
            if decision.kind in {"arrived", "no_path"}:
                end, reason = decision.kind, decision.reason
                break
            fresh = before is None or before.kind != decision.kind
            looks += fresh and decision.kind == "look"
            backs += fresh and decision.kind == "back_up"
            if decision.kind == "drive" and (decision.changed or fresh):
                missions, progress = missions + 1, mobility.Progress()
                limits = replace(limits, risk=decision.risk)
            if decision.kind == "back_up" and fresh:
                backing, progress = decision.waypoints_w, mobility.Progress()
        assert decision is not None
        if decision.kind == "drive":
            wanted, progress = mobility.follow_path(decision.waypoints_w, estimate, FOOTPRINT, limits, progress)
        elif decision.kind == "look":
            wanted, _ = mobility.turn_to(decision.heading_rad, estimate, FOOTPRINT, limits)
        else:
            assert backing is not None
            wanted, progress = mobility.follow_path(backing, estimate, FOOTPRINT, limits, progress, reverse=True)
        command = mobility.ramp(command, wanted, limits, 0.05)
        pose = drive(pose, command, 0.05)
        track.append(pose)
        collisions += collides(world, pose)
    return Traverse(end, reason, np.array(track), collisions, missions, int(looks), int(backs), time_s, spent, state)
