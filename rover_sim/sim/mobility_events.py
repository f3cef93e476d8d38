"""Named events of mobility, found in the true state: what befell the rover, when, where and at which wheel.

Each condition has a level at which it begins and a laxer one at which it ends, and must hold for some time or wheel
travel, so that one event is reported once. The slip stop of 40 % within one wheel revolution is that of the Mars
Exploration Rovers; no public definition of trap, support loss, high-centring and embedding was found: those are ours.
The alarm of tip-over takes from the force-angle measure (Papadopoulos and Rey 2000) the angles between weight and axes
and carries them ahead: the measure itself is as low whenever the rover is light, as behind the top of a bump.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import pi
from typing import NamedTuple

import numpy as np
from numba import njit

from rover_sim.sim.rover import RoverModel
from rover_sim.sim.vehicle_state import VehicleState
from worlds.types import BoolArray, FloatArray, Vector3

Motion = tuple[FloatArray, FloatArray, FloatArray, FloatArray]  # quaternion, velocity, rate; speeds of the wheels


class Kind(StrEnum):
    """What can befall a rover; the values are those of ``summary.json`` and the names of the trace's columns."""

    TRACTION_LOSS = "traction_loss"  # a wheel turns in vain, or slides
    EMBEDDING = "embedding"  # a wheel slips past the stop limit and still sinks
    WHEEL_TRAP = "wheel_trap"  # a wheel turns in vain in a pit, a gap between rocks, or wedged
    SUPPORT_LOSS = "support_loss"  # a wheel carries next to nothing
    HIGH_CENTRED = "high_centred"  # the belly rests on ground or rock
    TIP_OVER = "imminent_tip_over"  # the rover is about to roll or pitch over


KINDS = tuple(Kind)
TRACTION_LOSS, EMBEDDING, WHEEL_TRAP, SUPPORT_LOSS, HIGH_CENTRED, TIP_OVER = range(len(KINDS))  # rows


@dataclass(frozen=True)
class MobilityEvent:
    """One event at its beginning."""

    kind: Kind
    time_s: float
    position_m: Vector3  # of the hub or, for an event of the whole rover, of the body
    wheel: int | None  # place in the rover file; None: the whole rover


class MobilityLimits(NamedTuple):
    """Where events begin and end."""

    slip: float = 0.40  # the stop limit; a rover on 15 degrees of loose sand stays just under it
    slip_over: float = 0.30
    slip_revolutions: float = 0.5  # of the wheel; one revolution is the time allowed, half is left to stop
    least_speed_m_s: float = 0.05  # of rim or hub; below it a slip ratio says nothing
    load: float = 0.05  # share of the wheel's static load
    load_over: float = 0.10
    unloaded_s: float = 0.2  # a wheel that hops over a stone at 0.5 m/s is in the air for less
    clearance_m: float = 0.001  # zero, but for the margin at which obstacles are felt
    clearance_over_m: float = 0.01
    resting_s: float = 0.1  # a brush of the belly is shorter
    pit_radii: float = 0.3  # depth of a pit, in wheel radii
    pit_over_radii: float = 0.2
    vain_radii: float = 1.5  # wheel travel lost in the pit; rolling through the widest at 25 % slip loses 1.3
    growth_m: float = 0.003  # of the sinkage since slip went over the limit; load shifts make less of it
    tip_angle_rad: float = 0.10  # left to any tip-over axis ...
    tip_angle_over_rad: float = 0.20
    foresight_s: float = 0.6  # ... after so long at the present rate; see benchmarks/tip_alarm.py
    ended_s: float = 0.5  # the laxer level must be kept for this long


class Standards(NamedTuple):
    """The limits, and what they are measured in: one rover under one gravity."""

    limits: MobilityLimits
    radius_m: float
    shear_radius_m: float
    static_load_N: float  # of a wheel
    sideways_m: FloatArray  # (wheels,) to the left, times the effective track ratio
    needed: FloatArray  # (kinds,) time (s) or wheel travel (m) for which a condition must hold

    @classmethod
    def of(cls, rover: RoverModel, gravity_m_s2: float, limits: MobilityLimits) -> Standards:
        """The standards of a rover; its weight rests equally on all wheels."""
        places = np.array(rover.wheel.positions_m)
        radius, shear_radius = rover.wheel.radius_m, rover.wheel_shape().shear_radius_m
        needed = np.zeros(len(KINDS))
        needed[[TRACTION_LOSS, EMBEDDING]] = limits.slip_revolutions * 2.0 * pi * shear_radius
        needed[WHEEL_TRAP] = limits.vain_radii * radius
        needed[SUPPORT_LOSS] = limits.unloaded_s
        needed[HIGH_CENTRED] = limits.resting_s
        return cls(
            limits,
            radius,
            shear_radius,
            rover.mass_kg * gravity_m_s2 / len(places),
            rover.drive.effective_track_ratio * places[:, 1],
            needed,
        )


class Memory(NamedTuple):
    """What is kept from look to look; arrays are (kinds, wheels + 1), the last column the whole rover."""

    active: BoolArray
    built_up: FloatArray  # toward the beginning, s or m of wheel travel
    faded_s: FloatArray  # toward the end
    least_sinkage_m: FloatArray  # (wheels,) since slip went over the limit


def begin(wheels: int) -> Memory:
    """Nothing has happened yet."""
    shape = len(KINDS), wheels + 1
    none = np.zeros(shape, dtype=np.bool_)
    return Memory(none, np.zeros(shape), np.zeros(shape), np.full(wheels, np.inf))


def watch(
    memory: Memory, state: VehicleState, standards: Standards, step_s: float
) -> tuple[Memory, tuple[MobilityEvent, ...]]:
    """The memory after a look at ``state``, ``step_s`` after the one before, and the events that begin with it."""
    after, begun = _look(
        memory,
        standards,
        _motion(state),
        state.normal_force_N,
        state.sinkage_m,
        state.pit_depth_m,
        state.wedged,
        state.belly_clearance_m,
        state.tip_angle_rad,
        state.tip_rate_rad_s,
        step_s,
    )
    return after, tuple(_event(row, column, state) for row, column in np.argwhere(begun)) if begun.any() else ()


@njit(cache=True)
def _look(
    before: Memory,
    standards: Standards,
    motion: Motion,
    load_N: FloatArray,
    sinkage_m: FloatArray,
    pit_m: FloatArray,
    wedged: BoolArray,
    clearance_m: float,
    tip_angle: FloatArray,
    tip_rate: FloatArray,
    step_s: float,
) -> tuple[Memory, BoolArray]:
    """The memory after a look, and which events (kinds, wheels + 1) begin: the conditions of each kind, one by one."""
    rim, hub = _rolling(motion, standards.shear_radius_m, standards.sideways_m)
    limits, wheels = standards.limits, len(rim)
    after = Memory(
        np.zeros_like(before.active),
        np.zeros_like(before.built_up),
        np.zeros_like(before.faded_s),
        np.full(wheels, np.inf),
    )
    begun = np.zeros_like(before.active)
    for i in range(wheels):
        speed, lost = max(abs(rim[i]), abs(hub[i])), abs(rim[i] - hub[i])
        slip, load = lost / max(speed, limits.least_speed_m_s), load_N[i] / standards.static_load_N
        slipping, gripping = slip >= limits.slip, slip < limits.slip_over
        mute = speed < limits.least_speed_m_s or load < limits.load  # says nothing, as the wheel stands or hangs
        if slipping:
            after.least_sinkage_m[i] = min(before.least_sinkage_m[i], sinkage_m[i])
        grown = slipping and sinkage_m[i] - after.least_sinkage_m[i] >= limits.growth_m
        pit, in_vain = pit_m[i] / standards.radius_m, lost if abs(rim[i]) > abs(hub[i]) else 0.0
        if mute:
            for kind in (TRACTION_LOSS, EMBEDDING):
                _keep(before, after, kind, i, limits.ended_s)
        else:
            travel, ended = speed * step_s, limits.ended_s
            _feel(before, after, begun, TRACTION_LOSS, i, slipping, gripping, travel, standards.needed, step_s, ended)
            _feel(before, after, begun, EMBEDDING, i, grown, gripping, travel, standards.needed, step_s, ended)
        on, off = pit > limits.pit_radii or wedged[i], pit < limits.pit_over_radii and not wedged[i]
        travel = in_vain * step_s
        _feel(before, after, begun, WHEEL_TRAP, i, on, off, travel, standards.needed, step_s, limits.ended_s)
        on, off = load < limits.load, load > limits.load_over
        _feel(before, after, begun, SUPPORT_LOSS, i, on, off, step_s, standards.needed, step_s, limits.ended_s)
    on, off = clearance_m <= limits.clearance_m, clearance_m > limits.clearance_over_m
    _feel(before, after, begun, HIGH_CENTRED, wheels, on, off, step_s, standards.needed, step_s, limits.ended_s)
    left = float(np.min(tip_angle - limits.foresight_s * tip_rate))
    on, off = left < limits.tip_angle_rad, left > limits.tip_angle_over_rad
    _feel(before, after, begun, TIP_OVER, wheels, on, off, step_s, standards.needed, step_s, limits.ended_s)
    return after, begun


@njit(cache=True)
def _feel(
    before: Memory,
    after: Memory,
    begun: BoolArray,
    kind: int,
    column: int,
    on: bool,
    off: bool,
    progress: float,
    needed: FloatArray,
    step_s: float,
    ended_s: float,
) -> None:
    """One condition of one wheel, or of the rover: whether it holds, or has ceased, and how much builds up."""
    built_up = before.built_up[kind, column] + progress if on else 0.0
    faded = before.faded_s[kind, column] + step_s if off else 0.0
    lasting = before.active[kind, column]
    begun[kind, column] = on and not lasting and built_up >= needed[kind]
    active = begun[kind, column] or (lasting and faded < ended_s)
    after.active[kind, column] = active
    after.built_up[kind, column] = 0.0 if active else built_up
    after.faded_s[kind, column] = faded


@njit(cache=True)
def _keep(before: Memory, after: Memory, kind: int, column: int, ended_s: float) -> None:
    """A condition of which nothing can be said now."""
    faded = before.faded_s[kind, column]
    active = before.active[kind, column] and faded < ended_s
    after.active[kind, column] = active
    after.built_up[kind, column] = 0.0 if active else before.built_up[kind, column]
    after.faded_s[kind, column] = faded


def rolling_speeds(state: VehicleState, standards: Standards) -> tuple[FloatArray, FloatArray]:
    """Speeds (wheels,) of the rims, and those at which rims would have to turn for the motion of the body.

    A skid-steer rover turns slower than its wheel speeds say; this much is part of turning and no loss of traction,
    so the sides are judged by the effective track, as the rover's own monitor does.
    """
    return _rolling(_motion(state), standards.shear_radius_m, standards.sideways_m)


def _motion(state: VehicleState) -> Motion:
    return state.pose.quaternion_w, state.linear_velocity_w, state.angular_velocity_w, state.wheel_speed_rad_s


@njit(cache=True)
def _rolling(motion: Motion, radius_m: float, sideways_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    quaternion, velocity, rate, wheel_speed = motion
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    ahead = (1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w))
    up = (2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y))
    forward = ahead[0] * velocity[0] + ahead[1] * velocity[1] + ahead[2] * velocity[2]
    yaw_rate = up[0] * rate[0] + up[1] * rate[1] + up[2] * rate[2]
    return wheel_speed * radius_m, forward - yaw_rate * sideways_m


def active_kinds(memory: Memory) -> dict[Kind, bool]:
    """Which kinds of events last at the moment, at any wheel."""
    lasting = np.asarray(memory.active.any(axis=1)).tolist()
    return dict(zip(KINDS, lasting, strict=True))


def _event(row: int, column: int, state: VehicleState) -> MobilityEvent:
    wheels = len(state.hubs_w)
    x, y, z = (state.hubs_w[column] if column < wheels else state.pose.position_w).tolist()
    return MobilityEvent(KINDS[row], state.time_s, (x, y, z), int(column) if column < wheels else None)


class MobilityLog:
    """Watches one traverse and keeps what happened."""

    def __init__(self, rover: RoverModel, gravity_m_s2: float, limits: MobilityLimits | None = None) -> None:
        self.events: list[MobilityEvent] = []
        self._standards = Standards.of(rover, gravity_m_s2, limits or MobilityLimits())
        self.memory = begin(len(rover.wheel.positions_m))

    def look(self, state: VehicleState, step_s: float) -> tuple[MobilityEvent, ...]:
        """Events that begin with this look."""
        self.memory, begun = watch(self.memory, state, self._standards, step_s)
        self.events += begun
        return begun

    def digging(self, state: VehicleState) -> bool:
        """Whether at least half of the wheels are embedding, and turn."""
        if not self.memory.active[EMBEDDING].any():
            return False
        rim, _ = rolling_speeds(state, self._standards)
        turning = np.abs(rim) > self._standards.limits.least_speed_m_s
        return bool(2 * np.count_nonzero(self.memory.active[EMBEDDING, :-1] & turning) >= len(turning))
