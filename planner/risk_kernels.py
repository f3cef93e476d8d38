"""The compiled rollout of a reduced rover along a way: steady soil, rigid body on four wheels, the path follower.

The rover stands on the heights under its wheels at each moment; its slips are the steady ones of `planner.risk_soil`;
it is steered as `planner.mobility.follow_path` steers. Only tipping over and speed have dynamics of their own.

numba's cache looks only at the file of the outermost function: after a change in `risk_soil` or `mobility` save this
file anew, or the old code goes on running.
"""

from __future__ import annotations

from math import atan, atan2, cos, exp, hypot, pi, sin, sqrt, tan

import numpy as np
from numba import njit

from planner.mobility import arc_on_path, point_at
from planner.risk_soil import SINKAGE, looked_up, slips
from worlds.types import FloatArray

ARRIVED, ROLLOVER, IMMOBILISED = range(3)
END, ARC, LATERAL, LEAST_MARGIN, MOST_SLIP, RESULTS = range(6)  # columns of a result
STEP_S = 0.1
# Places in the vector of the vehicle and its driving.
(
    TRACK,
    WHEELBASE,
    RADIUS,
    COM_AHEAD,
    COM_LEFT,
    COM_UP,  # above the ground
    HALF_TRACK,  # effective, of a skid-steer turn
    GRAVITY,
    CRUISE,
    CREEP,
    ACCELERATION,
    LOOKAHEAD,
    LOOKAHEAD_S,
    SLOW_RADIUS,
    SLOW_DISTANCE,
    ARRIVAL,
    TIGHTEST,
    MOST_DRIFT,
    SLIP_LIMIT,
    SLIPPING,  # m of wheel travel
    SMOOTHING,  # m of wheel travel
    TILT_LIMIT,
    TILT_S,
    STUCK_S,
    GIVE,  # m, of a wheel under its static load
) = range(25)
CONSTANTS = 25
_BUMP_M = 0.15  # of travel, over which a wheel stands on the same bump
_INERTIA = 1.35  # of a body tipping over an edge, over that of a point mass at its centre
_TIPPED_RAD = 0.5  # from where it balanced: no way back
_LEAST_COURSE_M_S = 0.1
_STUCK_M = 0.10
_MOST_SKID = 0.5
_MOST_SCRUB = 0.9
# Places in the memory of a rollout.
X, Y, YAW, RIM, ALONG, DRIFT, SLIP, SLIPPED, TILTED, STANDING, ANCHOR_X, ANCHOR_Y = range(12)
MEMORY = 12


@njit(cache=True)
def roll_out(
    heights: FloatArray,
    grid: tuple[float, float, float],
    way: FloatArray,
    curve: FloatArray,
    load_exponent: float,
    car: FloatArray,
    place_error: FloatArray,
    roughness_m: float,
    bumps: FloatArray,
    result: FloatArray,
) -> None:
    """One drive over ``heights`` (ny, nx), on ``grid`` x0, y0, 1 / cell, along ``way`` (N, 2) in a soil's ``curve``.

    ``place_error`` (2,): of the rover's own position; ``bumps`` (steps, 4): normal numbers, a row a step, which bound
    the time; ``result`` (RESULTS,) is written. The rover begins at rest on the first point, headed for the next.
    """
    me, lift, fallen, falling = np.zeros(MEMORY), roughness_m * bumps[0], np.zeros(4), np.zeros(4)
    me[X], me[Y] = me[ANCHOR_X], me[ANCHOR_Y] = way[0, 0], way[0, 1]
    me[YAW] = atan2(way[1, 1] - way[0, 1], way[1, 0] - way[0, 0])
    result[:] = 0.0
    result[END], result[LEAST_MARGIN] = IMMOBILISED, 10.0
    for step in range(bumps.shape[0]):
        arrived, result[ARC], curvature, wanted = _steer(way, me, place_error, result[ARC], car)
        if arrived:
            result[END] = ARRIVED
            return
        change = min(max(wanted - me[RIM], -car[ACCELERATION] * STEP_S), car[ACCELERATION] * STEP_S)
        me[RIM] += change
        climb, lean = _stand(heights, grid, me, lift, car)
        pull = change / STEP_S / car[GRAVITY] * (1.0 - max(me[ALONG], 0.0))
        ahead, aside = _slide(curve, climb + pull, lean, curvature, me, car)
        depth = looked_up(curve, SINKAGE, abs(me[ALONG]))
        push_x = climb + pull
        push_y = lean + curvature * ahead * ahead / car[GRAVITY]
        push_x = tan(atan(push_x) + _sunk(depth, load_exponent, push_x, car[WHEELBASE], car))
        push_y = tan(atan(push_y) + _sunk(depth, load_exponent, push_y, car[TRACK], car))
        result[LEAST_MARGIN] = min(result[LEAST_MARGIN], _tip(push_x, push_y, car, fallen, falling))
        if fallen.max() > _TIPPED_RAD:
            result[END] = ROLLOVER
            return
        if _stopped(me, ahead, atan(hypot(push_x, push_y)), car):
            return
        result[MOST_SLIP] = max(result[MOST_SLIP], me[SLIP])
        _move(me, climb, lean, ahead, aside, curvature)
        near_x, near_y = point_at(way, arc_on_path(way, me[X], me[Y], result[ARC])[0])
        result[LATERAL] = max(result[LATERAL], hypot(me[X] - near_x, me[Y] - near_y))
        fade = exp(-STEP_S * abs(ahead) / _BUMP_M)
        lift[:] = fade * lift + sqrt(1.0 - fade * fade) * roughness_m * bumps[step]


@njit(cache=True)
def _steer(
    way: FloatArray, me: FloatArray, place_error: FloatArray, arc: float, car: FloatArray
) -> tuple[bool, float, float, float]:
    """Whether the rover believes to have arrived, how far it believes to be, curvature and speed that it wants."""
    x, y = me[X] + place_error[0], me[Y] + place_error[1]
    arc, length = arc_on_path(way, x, y, arc)
    to_end = hypot(way[-1, 0] - x, way[-1, 1] - y)
    arrived = (to_end < min(car[ARRIVAL], 0.3 * length) and length - arc < 2.0) or (
        to_end < 1.0 and length - arc < 1e-3
    )
    reach = car[LOOKAHEAD] + car[LOOKAHEAD_S] * me[RIM] * (1.0 - max(me[SLIP], 0.0))
    ahead_x, ahead_y = point_at(way, arc + reach)
    drift = min(max(me[DRIFT], -car[MOST_DRIFT]), car[MOST_DRIFT])
    error = _wrapped(atan2(ahead_y - y, ahead_x - x) - me[YAW]) - drift
    curvature = 2.0 * sin(error) / max(hypot(ahead_x - x, ahead_y - y), 0.2)
    curvature = min(max(curvature, -car[TIGHTEST]), car[TIGHTEST])
    bent = min(1.0, 1.0 / max(abs(curvature) * car[SLOW_RADIUS], 1e-9))
    ending = min(1.0, max(to_end, length - arc) / car[SLOW_DISTANCE])
    return arrived, arc, curvature, max(car[CRUISE] * bent * ending, car[CREEP])


@njit(cache=True)
def _stand(
    heights: FloatArray, grid: tuple[float, float, float], me: FloatArray, lift: FloatArray, car: FloatArray
) -> tuple[float, float]:
    """Rise over run ahead, and down to the left, of the plane through the ground under the wheels.

    Wheels in the order front left, rear left, front right, rear right.
    """
    c, s = cos(me[YAW]), sin(me[YAW])
    z = np.empty(4)
    for k in range(4):
        dx = (0.5 if k % 2 == 0 else -0.5) * car[WHEELBASE]
        dy = (0.5 if k < 2 else -0.5) * car[TRACK]
        z[k] = height(heights, grid, me[X] + c * dx - s * dy, me[Y] + s * dx + c * dy) + lift[k]
    climb = 0.5 * (z[0] + z[2] - z[1] - z[3]) / car[WHEELBASE]
    return climb, 0.5 * (z[2] + z[3] - z[0] - z[1]) / car[TRACK]


@njit(cache=True)
def height(heights: FloatArray, grid: tuple[float, float, float], x: float, y: float) -> float:
    """Height (m) of the bilinear surface at a place; the edge goes on outside."""
    rows, columns = heights.shape
    u = min(max((x - grid[0]) * grid[2], 0.0), columns - 1.000001)
    v = min(max((y - grid[1]) * grid[2], 0.0), rows - 1.000001)
    i, j = int(u), int(v)
    near = heights[j, i] + (u - i) * (heights[j, i + 1] - heights[j, i])
    far = heights[j + 1, i] + (u - i) * (heights[j + 1, i + 1] - heights[j + 1, i])
    level: float = near + (v - j) * (far - near)
    return level


@njit(cache=True)
def _slide(
    curve: FloatArray, climb: float, lean: float, curvature: float, me: FloatArray, car: FloatArray
) -> tuple[float, float]:
    """Speeds (m/s) ahead and to the left along the ground, downhill where the soil lets the rover slide."""
    along, across = slips(curve, climb, lean, min(0.5 * car[WHEELBASE] * abs(curvature), _MOST_SCRUB))
    me[ALONG] = max(along, -_MOST_SKID)
    ahead = me[RIM] * (1.0 - me[ALONG]) if me[ALONG] >= 0.0 else me[RIM] / (1.0 + me[ALONG])
    return ahead, across * max(me[RIM], ahead)


@njit(cache=True)
def _sunk(depth: float, exponent: float, push: float, base: float, car: FloatArray) -> float:
    """Angle by which wheels a ``base`` apart lean more under a push over the weight: the loaded ones are deeper."""
    moved = min(max(2.0 * car[COM_UP] * push / base, -0.98), 0.98)
    soil = depth * ((1.0 + moved) ** exponent - (1.0 - moved) ** exponent)
    return atan((soil + 2.0 * moved * car[GIVE]) / base)


@njit(cache=True)
def _tip(push_x: float, push_y: float, car: FloatArray, fallen: FloatArray, falling: FloatArray) -> float:
    """Least angle (rad) left to the four edges; ``fallen`` and ``falling`` (4,) over them advance by a step.

    ``push_x``: to the rear, ``push_y``: to the left, both over the part of gravity into the ground.
    """
    least = 10.0
    for edge in range(4):  # rear, front, left, right
        sign = 1.0 if edge % 2 == 0 else -1.0
        if edge < 2:
            half, push = 0.5 * car[WHEELBASE] + sign * car[COM_AHEAD], sign * push_x
        else:
            half, push = 0.5 * car[TRACK] - sign * car[COM_LEFT], sign * push_y
        lever = hypot(half, car[COM_UP])
        left = atan2(half, car[COM_UP]) - atan(push)
        least = min(least, left)
        falling[edge] += STEP_S * car[GRAVITY] / (_INERTIA * lever) * sin(fallen[edge] - left)
        fallen[edge] += STEP_S * falling[edge]
        if fallen[edge] <= 0.0:
            fallen[edge] = falling[edge] = 0.0
    return least


@njit(cache=True)
def _stopped(me: FloatArray, ahead: float, tilt: float, car: FloatArray) -> bool:
    """Whether a fail-safe of the autopilot stops the rover: slip, tilt, no progress."""
    travel = STEP_S * me[RIM]
    share = 1.0 - exp(-travel / car[SMOOTHING])
    me[SLIP] += share * (min(max(1.0 - ahead / max(me[RIM], 1e-6), -1.0), 1.5) - me[SLIP])
    me[SLIPPED] = me[SLIPPED] + travel if me[SLIP] > car[SLIP_LIMIT] else 0.0
    me[TILTED] = me[TILTED] + STEP_S if tilt > car[TILT_LIMIT] else 0.0
    me[STANDING] += STEP_S
    if hypot(me[X] - me[ANCHOR_X], me[Y] - me[ANCHOR_Y]) > _STUCK_M:
        me[ANCHOR_X], me[ANCHOR_Y], me[STANDING] = me[X], me[Y], 0.0
    stopped: bool = me[SLIPPED] > car[SLIPPING] or me[TILTED] > car[TILT_S] or me[STANDING] > car[STUCK_S]
    return stopped


@njit(cache=True)
def _move(me: FloatArray, climb: float, lean: float, ahead: float, aside: float, curvature: float) -> None:
    """A step on the map: speeds along the ground are longer than those seen from above."""
    c, s = cos(me[YAW]), sin(me[YAW])
    forward, left = ahead / sqrt(1.0 + climb * climb), aside / sqrt(1.0 + lean * lean)
    me[DRIFT] = atan2(aside, max(ahead, _LEAST_COURSE_M_S))
    me[X] += STEP_S * (forward * c - left * s)
    me[Y] += STEP_S * (forward * s + left * c)
    me[YAW] = _wrapped(me[YAW] + STEP_S * curvature * ahead)


@njit(cache=True)
def _wrapped(angle: float) -> float:
    """The angle within -pi to pi."""
    return (angle + pi) % (2.0 * pi) - pi
