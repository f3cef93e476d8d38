"""The compiled step of a rover on the ground: contact, plastic sinkage and shear of all wheels at once, and the belly.

Contact: a plane through seven heights under the wheel (the tyre envelops what is smaller), penetration of the rim
along its normal, a spring and damper on what the plastic sinkage leaves. Sinkage and traction relax toward the steady
Wong-Reece wheel (a table over depth of rut, load and slip) over one contact length of travel. The shear displacement
(j_x, j_y) of each wheel is a state, so that a parked wheel is held by a spring and both directions share one limit.

Ruts: wheels press their plastic sinkage into a fine map of depths below the natural ground, which stays as it is: the
elastic contact never sees its own rut, so nothing digs itself in. What counts for a wheel is the depth of the soil that
comes under it (its state PRIOR), read ahead of its contact in the direction of travel. Beside a wheel soil piles up.

numba's cache looks only at the file of the outermost function: after a change in `rut_kernels` or `motion_kernels`
save this file anew, or the old code goes on running.
"""

from __future__ import annotations

from math import atan2, exp, sqrt

from numba import njit

from rover_sim.sim.borrowed import borrowed
from rover_sim.sim.motion_kernels import locate
from rover_sim.sim.rut_kernels import Ruts, coming, lent, press_rut, rut_depth, side_depth
from worlds.types import ByteArray, FloatArray

Triple = tuple[float, float, float]

# Columns of the state of a wheel, kept from step to step.
SHEAR_X, SHEAR_Y, SINKAGE, CONTACT, PUSHED, PRIOR = 0, 1, 2, 3, 4, 5
PRESSED_X, PRESSED_Y, PRESSED_DEPTH = 6, 7, 8  # where and how deep the wheel last pressed its rut
WORK_SHEAR, WORK_DRAG, WORK_NORMAL = 9, 10, 11  # J done on the soil since the start
BESIDE = 12  # depth of the soil that the side of the wheel meets
STATE_COLUMNS = 13
# Columns of the result: force on the wheel in the world, where it acts, and what the recorder wants.
FORCE, POINT, NORMAL, SLIP, SLIP_ANGLE, DEPTH, DRAWBAR, THRUST, SPEED = 0, 3, 6, 7, 8, 9, 10, 11, 12
RESULT_COLUMNS = 13
# Places in the vector of constants.
(
    RADIUS,
    WIDTH,
    SHEAR_RADIUS,
    STIFFNESS,
    DAMPING,
    SHEAR_DAMPING,
    SPIN_MASS,
    COHESION,
    TAN_PHI,
    LOAD_STEP,
    SETTLING,
    DEEPEST_RUT,
    PASSIVE_COHESION,
    PASSIVE_WEIGHT,
    SHEAR_MODULUS,
) = range(15)
CONSTANTS = 15

_SLIP_SPEED = 0.02  # m/s; below it a slip ratio says nothing
_BUILD_UP = 0.002  # m of travel over which the drag of the soil builds up
_SHORTEST = 1e-4  # m of contact
_SPIN_DAMPING = 0.4  # of the wheel's inertia a step; explicit damping above 1 would ring
_CLEAR = 0.01  # m above its rut a wheel forgets it
_FORGET_S = 0.05
_ONSET = 0.002  # m of penetration over which damping sets in
_PROBE_SLIP = 0.05  # where the stiffness of the unloaded shear spring is taken
_ENVELOPE = 0.5  # half length of the sampled ground, in wheel radii
_SLIDING_SPEED = 0.02  # m/s over which friction of the belly builds up
_PRESS_STEP = 0.5  # texels of travel after which a wheel presses its rut anew
_DEEPER = 5e-4  # m of sinkage after which it does so on the spot
_SHALLOWEST = 1e-5  # m; less leaves no rut
_HIGHEST_BERM = 0.2  # m, more than wheels pile up


@njit(cache=True)
def ground_height(heights: FloatArray, x0: float, y0: float, inverse_cell: float, x: float, y: float) -> float:
    """Height (m) at world x, y on a grid of ``1 / inverse_cell`` m from (x0, y0); its edge goes on outside."""
    rows, columns = heights.shape
    u = min(max((x - x0) * inverse_cell, 0.0), columns - 1.000001)
    v = min(max((y - y0) * inverse_cell, 0.0), rows - 1.000001)
    i, j = int(u), int(v)
    a, b = u - i, v - j
    near = heights[j, i] + a * (heights[j, i + 1] - heights[j, i])
    far = heights[j + 1, i] + a * (heights[j + 1, i + 1] - heights[j + 1, i])
    height: float = near + b * (far - near)
    return height


@njit(cache=True)
def steady(
    table: FloatArray, constants: FloatArray, rut: float, load: float, slip: float
) -> tuple[float, float, float, float]:
    """Thrust and resistance per load, sinkage and contact length in a rut, at a load (N) and slip (0..1), trilinear."""
    sheets, rows, columns = table.shape[0], table.shape[1], table.shape[2]
    w = min(sqrt(max(rut, 0.0) / constants[DEEPEST_RUT]) * (sheets - 1), sheets - 1.000001)
    u = min(sqrt(max(load, 0.0)) / constants[LOAD_STEP], rows - 1.000001)
    v = min(sqrt(min(max(slip, 0.0), 1.0)) * (columns - 1), columns - 1.000001)
    k, i, j = int(w), int(u), int(v)
    a, b, c = u - i, v - j, w - k
    thrust = resist = sink = length = 0.0
    for corner in range(8 if c > 0.0 else 4):
        p, q, r = corner & 1, (corner >> 1) & 1, corner >> 2
        share = (b if p else 1.0 - b) * (a if q else 1.0 - a) * (c if r else 1.0 - c)
        thrust += share * table[k + r, i + q, j + p, 0]
        resist += share * table[k + r, i + q, j + p, 1]
        sink += share * table[k + r, i + q, j + p, 2]
        length += share * table[k + r, i + q, j + p, 3]
    return thrust, resist, rut + sink, length


@njit(cache=True)
def _unit(x: float, y: float, z: float) -> tuple[float, float, float]:
    length = sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@njit(cache=True)
def _ground_plane(
    ground: FloatArray,
    grid: tuple[float, float, float],
    hub: tuple[float, float],
    forward: tuple[float, float],
    spans: tuple[float, float],
) -> tuple[float, float, float]:
    """Height and slopes (along ``forward``, to its left) of the plane that fits the ground under a wheel."""
    x0, y0, inverse = grid
    hx, hy = hub
    fx, fy = forward
    half, side = spans
    h0 = ground_height(ground, x0, y0, inverse, hx, hy)
    h1 = ground_height(ground, x0, y0, inverse, hx + half * fx, hy + half * fy)
    h2 = ground_height(ground, x0, y0, inverse, hx - half * fx, hy - half * fy)
    h3 = ground_height(ground, x0, y0, inverse, hx + 0.5 * half * fx, hy + 0.5 * half * fy)
    h4 = ground_height(ground, x0, y0, inverse, hx - 0.5 * half * fx, hy - 0.5 * half * fy)
    h5 = ground_height(ground, x0, y0, inverse, hx - side * fy, hy + side * fx)
    h6 = ground_height(ground, x0, y0, inverse, hx + side * fy, hy - side * fx)
    level = (3.0 * h0 + 2.0 * (h3 + h4) + h1 + h2) / 9.0
    along = ((h1 - h2) + 0.5 * (h3 - h4)) / (2.5 * half)  # least squares over the five
    return level, along, (h5 - h6) / (2.0 * side)


@njit(cache=True)
def _cross(a: Triple, b: Triple) -> Triple:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def _dot(a: Triple, b: Triple) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _contact(
    ground: FloatArray, grid: tuple[float, float, float], hub: Triple, axle: Triple, spans: tuple[float, float]
) -> tuple[Triple, Triple, Triple, Triple, float]:
    """Ground normal, direction from the lowest point of the rim to the hub, forward and left along the ground, reach.

    All are unit vectors in the world; the reach (m) goes from the hub to the ground along the wheel.
    """
    forward = _unit(axle[1], -axle[0], 0.0)  # axle x up: level
    level, along, across = _ground_plane(ground, grid, (hub[0], hub[1]), (forward[0], forward[1]), spans)
    fx, fy = forward[0], forward[1]
    normal = _unit(-along * fx + across * fy, -along * fy - across * fx, 1.0)
    # The lowest point of the rim lies along the normal projected into the plane of the wheel.
    tilt = _dot(normal, axle)
    dx, dy, dz = normal[0] - tilt * axle[0], normal[1] - tilt * axle[1], normal[2] - tilt * axle[2]
    cosine = sqrt(dx * dx + dy * dy + dz * dz)
    spoke = (dx / cosine, dy / cosine, dz / cosine)
    ahead = _cross(axle, spoke)
    return normal, spoke, ahead, _cross(normal, ahead), (hub[2] - level) * normal[2] / cosine


@njit(cache=True)
def _sink(
    table: FloatArray, constants: FloatArray, state: FloatArray, normal: float, speeds: Triple, dt: float
) -> None:
    """Move contact length and plastic sinkage of a wheel toward the steady wheel; ``speeds`` as in `_traction`."""
    rim, vx, vy = speeds
    length = max(state[CONTACT], _SHORTEST)
    slip = min(abs(state[SHEAR_X]) / length, 1.0)  # grousers dig along the wheel; sliding sideways does not
    _, _, sink, length = steady(table, constants, state[PRIOR], normal, slip)
    state[CONTACT] = max(length, _SHORTEST)
    # At once where the load grows, else over the ground that comes under the wheel.
    renewal = dt * (max(abs(rim), abs(vx)) + abs(vy)) / state[CONTACT]
    if sink > state[SINKAGE]:
        renewal += dt * constants[SETTLING]
    state[SINKAGE] += (sink - state[SINKAGE]) * (1.0 - exp(-renewal))


@njit(cache=True)
def _shear(state: FloatArray, speeds: Triple, dt: float) -> tuple[float, float]:
    """Advance the shear displacement of a wheel; its rates (m/s). The leak is implicit: any slip speed is stable."""
    rim, vx, vy = speeds
    length, old_x, old_y = state[CONTACT], state[SHEAR_X], state[SHEAR_Y]
    leak = 1.0 + dt * max(abs(rim), abs(vx)) / length
    new_x, new_y = (old_x + dt * (rim - vx)) / leak, (old_y - dt * vy) / leak
    shrink = min(1.0, length / max(sqrt(new_x * new_x + new_y * new_y), 1e-12))
    state[SHEAR_X], state[SHEAR_Y] = shrink * new_x, shrink * new_y
    return (state[SHEAR_X] - old_x) / dt, (state[SHEAR_Y] - old_y) / dt


@njit(cache=True)
def _drag(constants: FloatArray, state: FloatArray, resistance: float, vx: float, dt: float) -> float:
    """Resistance (N) of the soil ahead of a wheel: builds up over a short way, against the way made by the hub.

    So it only ever resists: a wheel that spins on the spot digs in and is not pushed back, and one at rest has none.
    """
    old = state[PUSHED]
    state[PUSHED] = max(-_BUILD_UP, min(_BUILD_UP, old + dt * vx))
    damping = constants[SHEAR_DAMPING] * sqrt(resistance / _BUILD_UP) * (state[PUSHED] - old) / dt
    drag: float = max(-resistance, min(resistance, resistance * state[PUSHED] / _BUILD_UP + damping))
    return drag


@njit(cache=True)
def _slip_ratio(rim: float, vx: float) -> float:
    """Driving 1 - v / (omega r), braking (omega r - v) / v; mirrored for backward travel, fading near standstill."""
    sign = 1.0 if (rim if abs(rim) >= abs(vx) else vx) >= 0.0 else -1.0
    return max(-1.0, min(1.0, sign * (rim - vx) / max(abs(rim), abs(vx), _SLIP_SPEED)))


@njit(cache=True)
def _walls(constants: FloatArray, state: FloatArray, slip: float) -> tuple[float, float]:
    """Largest resistance (N) of the soil wall beside a wheel, and of that before one that skids: bulldozing.

    Passive earth pressure after Rankine, 2 c sqrt(K_p) + gamma h K_p at a depth h, over the segment of the wheel's side
    in the soil (a parabola), and over the width of a wheel that pushes instead of rolling. A driven wheel has its soil
    flow forward in the Wong-Reece stress already.
    """
    height = max(state[SINKAGE] - state[BESIDE], 0.0)
    chord = sqrt(2.0 * constants[RADIUS] * height)
    cohesion, weight = constants[PASSIVE_COHESION], constants[PASSIVE_WEIGHT]
    side = chord * height * (4.0 / 3.0 * cohesion + 16.0 / 15.0 * weight * height)
    height = max(state[SINKAGE] - state[PRIOR], 0.0)
    front = constants[WIDTH] * height * (cohesion + weight * height) * max(-slip, 0.0)
    return side, front


@njit(cache=True)
def _traction(
    table: FloatArray,
    constants: FloatArray,
    state: FloatArray,
    normal: float,
    speeds: Triple,
    dt: float,
) -> Triple:
    """Thrust forward and left, and drag (N), of a wheel under load; advances its state.

    ``speeds``: of the rim, of the hub forward and of the contact to the left (m/s).
    """
    _sink(table, constants, state, normal, speeds, dt)
    rate_x, rate_y = _shear(state, speeds, dt)
    length, rut = state[CONTACT], state[PRIOR]
    size = sqrt(state[SHEAR_X] ** 2 + state[SHEAR_Y] ** 2)
    thrust0 = steady(table, constants, rut, normal, 0.0)[0]
    thrust = steady(table, constants, rut, normal, size / length)[0]
    resistance = steady(table, constants, rut, normal, abs(state[SHEAR_X]) / length)[1]
    gain = normal * (thrust - thrust0) / max(size, 1e-12)
    stretch = max(size / length, _PROBE_SLIP)
    spring = normal * max(steady(table, constants, rut, normal, stretch)[0] - thrust0, 0.0) / (stretch * length)
    damping = min(constants[SHEAR_DAMPING] * sqrt(spring), _SPIN_DAMPING * constants[SPIN_MASS] / dt)
    wall, front = _walls(constants, state, _slip_ratio(speeds[0], speeds[1]))
    drag = _drag(constants, state, normal * resistance + front, speeds[1], dt)
    # A wheel that rolls freely is sheared forward a little; that part comes and goes with the drag, which outweighs it.
    force_x = gain * state[SHEAR_X] + damping * rate_x + normal * thrust0 * state[PUSHED] / _BUILD_UP
    force_y = gain * state[SHEAR_Y] + damping * rate_y
    limit = constants[COHESION] * constants[WIDTH] * length + normal * constants[TAN_PHI]
    share = min(1.0, limit / max(sqrt(force_x * force_x + force_y * force_y), 1e-12))
    # The wall beside the wheel is another body of soil: its resistance comes on top of the shear under the wheel, and
    # builds up as the wedge behind it is sheared: from nothing, as it is fresh, at the front of the contact. The mean
    # of 1 - exp(-j / K) over a displacement that grows evenly along the contact to that of the state.
    build = abs(state[SHEAR_Y]) / constants[SHEAR_MODULUS]
    wall *= 1.0 - (1.0 - exp(-build)) / build if build > 1e-3 else 0.5 * build
    wall = wall if state[SHEAR_Y] > 0.0 else -wall
    return share * force_x, share * force_y + wall, drag


@njit(cache=True)
def _meet(
    ruts: Ruts,
    constants: FloatArray,
    own: FloatArray,
    foot: tuple[float, float],
    ahead: tuple[float, float],
    speeds: Triple,
    load: float,
    dt: float,
) -> None:
    """Tell a wheel how deep the soil is that comes under it, and on the side that it leans against."""
    if ruts[0].shape[0] == 0:
        return
    if load <= 0.0:  # in the air: it will land on what is under it
        own[PRIOR] = own[BESIDE] = max(rut_depth(ruts, foot[0], foot[1]), 0.0)
        return
    reach = sqrt(2.0 * constants[RADIUS] * max(own[SINKAGE] - own[PRIOR], 0.0))
    half = 0.5 * constants[WIDTH]
    depth = coming(ruts, foot, ahead, (reach, half), (speeds[1], speeds[2]))
    beside = half + 1.0 / ruts[6]
    wall = side_depth(ruts, foot, ahead, reach, beside if own[SHEAR_Y] < 0.0 else -beside)
    # Over the way made: a wheel that rocks on the spot must not gain by what it reads now here and now there.
    way = dt * (abs(speeds[1]) + abs(speeds[2]))
    renewal = 1.0 - exp(-way / max(own[CONTACT], 1.0 / ruts[6]))
    own[PRIOR] += (depth - own[PRIOR]) * renewal
    own[BESIDE] += (wall - own[BESIDE]) * renewal


@njit(cache=True)
def _leave(
    ruts: Ruts,
    constants: FloatArray,
    own: FloatArray,
    foot: tuple[float, float],
    ahead: tuple[float, float],
    speeds: Triple,
) -> None:
    """Press the rut of a wheel where it has moved on or sunk deeper since it last did."""
    sinkage = own[SINKAGE]
    if ruts[0].shape[0] == 0 or sinkage < _SHALLOWEST:
        return
    dx, dy = foot[0] - own[PRESSED_X], foot[1] - own[PRESSED_Y]
    step = _PRESS_STEP / ruts[6]
    if dx * dx + dy * dy < step * step and sinkage < own[PRESSED_DEPTH] + _DEEPER:
        return
    own[PRESSED_X], own[PRESSED_Y], own[PRESSED_DEPTH] = foot[0], foot[1], sinkage
    lean = speeds[2] / (abs(speeds[1]) + abs(speeds[2]) + 1e-3)
    press_rut(ruts, foot, ahead, (constants[RADIUS], 0.5 * constants[WIDTH]), sinkage, lean)


@njit(cache=True)
def soil_at(soils: ByteArray, grid: tuple[float, float, float], x: float, y: float) -> int:
    """Which soil lies at a point: that of the nearest sample."""
    rows, columns = soils.shape
    i = min(max(int((x - grid[0]) * grid[2] + 0.5), 0), columns - 1)
    j = min(max(int((y - grid[1]) * grid[2] + 0.5), 0), rows - 1)
    soil: int = soils[j, i]
    return soil


@njit(cache=True)
def wheel_forces(
    ground: FloatArray,
    grid: tuple[float, float, float],
    soils: ByteArray,
    ruts: Ruts,
    tables: FloatArray,
    constants: FloatArray,
    motion: FloatArray,
    state: FloatArray,
    result: FloatArray,
    dt: float,
) -> None:
    """Advance the soil under every wheel by ``dt`` and write the forces on the wheels.

    ``soils`` (ny, nx) says which of ``tables`` (S, ruts, loads, slips, 4) and ``constants`` (S, 15) holds where, or is
    (1, 1) where one does everywhere. ``motion`` (n, 13): hub position, hub velocity, unit axle (left), carrier rate
    (all world), rotation rate of the wheel about its axle. ``state`` (n, 13) is updated, ``result`` (n, 13) written;
    columns as named above.
    """
    for i in range(motion.shape[0]):
        m, out, own = motion[i], result[i], state[i]
        hub, velocity, rate = (m[0], m[1], m[2]), (m[3], m[4], m[5]), (m[9], m[10], m[11])
        soil = soil_at(soils, grid, hub[0], hub[1])
        of, table = constants[soil], tables[soil]
        radius, shear_radius = of[RADIUS], of[SHEAR_RADIUS]
        spans = (_ENVELOPE * radius, 0.5 * of[WIDTH])
        normal, spoke, ahead, left, reach = _contact(ground, grid, hub, (m[6], m[7], m[8]), spans)
        vx = _dot(velocity, ahead)
        vy = _dot(velocity, left) - reach * _dot(_cross(rate, spoke), left)
        rim = m[12] * shear_radius
        elastic = radius - reach - own[SINKAGE]
        rise = _dot(velocity, normal)
        load = 0.0
        if elastic > 0.0:
            onset = min(elastic / _ONSET, 1.0)
            load = max(of[STIFFNESS] * elastic - of[DAMPING] * onset * rise, 0.0)
        level = _unit(ahead[0], ahead[1], 0.0)
        foot, way = (hub[0] - radius * spoke[0], hub[1] - radius * spoke[1]), (level[0], level[1])
        _meet(ruts, of, own, foot, way, (rim, vx, vy), load, dt)
        thrust = side = drag = 0.0
        if load > 0.0:
            thrust, side, drag = _traction(table, of, own, load, (rim, vx, vy), dt)
            _leave(ruts, of, own, foot, way, (rim, vx, vy))
        else:
            own[SHEAR_X] = own[SHEAR_Y] = own[PUSHED] = 0.0
            if elastic < -_CLEAR:  # it forgets its own rut and meets what lies under it
                own[SINKAGE] += (own[PRIOR] - own[SINKAGE]) * (1.0 - exp(-dt / _FORGET_S))
        own[WORK_SHEAR] += dt * (thrust * (rim - vx) - side * vy)
        own[WORK_DRAG] += dt * drag * vx
        own[WORK_NORMAL] -= dt * load * rise
        # Forces act at the bottom of the rim. The normal force moves ahead of the axle by what gives the torque of
        # a thrust at the shearing radius and of a drag at the hub.
        arm = radius - max(elastic, 0.0)
        shift = (drag * arm + thrust * (shear_radius - arm)) / load if load > 0.0 else 0.0
        for k in range(3):
            out[FORCE + k] = load * normal[k] + (thrust - drag) * ahead[k] + side * left[k]
            # PyBullet takes the lever from where the link was a step ago; without this the load would lie that much
            # ahead of the axle, and brake.
            out[POINT + k] = hub[k] - dt * velocity[k] - arm * spoke[k] + shift * ahead[k]
        out[NORMAL], out[DRAWBAR], out[THRUST], out[DEPTH] = load, thrust - drag, thrust, own[SINKAGE]
        out[SLIP], out[SLIP_ANGLE], out[SPEED] = _slip_ratio(rim, vx), atan2(vy, max(abs(vx), _SLIP_SPEED)), vx


@njit(cache=True)
def belly_wrench(
    ground: FloatArray,
    grid: tuple[float, float, float],
    ruts: Ruts,
    points: FloatArray,
    body: FloatArray,
    constants: FloatArray,
    wrench: FloatArray,
) -> int:
    """Write force (N) and moment about the centre of mass (N m), world axes, into ``wrench`` (6,); points in contact.

    ``points`` (n, 3) relative to the centre of mass in body axes; ``body`` (18,): its position, velocity, rate (world)
    and the rotation body to world, row by row; ``constants``: stiffness N/m, damping N s/m, friction coefficient.
    """
    x0, y0, inverse = grid
    stiffness, damping, friction = constants[0], constants[1], constants[2]
    for k in range(6):
        wrench[k] = 0.0
    touching = 0
    for i in range(points.shape[0]):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        rx = body[9] * px + body[10] * py + body[11] * pz
        ry = body[12] * px + body[13] * py + body[14] * pz
        rz = body[15] * px + body[16] * py + body[17] * pz
        depth = ground_height(ground, x0, y0, inverse, body[0] + rx, body[1] + ry) - (body[2] + rz)
        if depth > -_HIGHEST_BERM and ruts[0].shape[0] > 0:
            depth -= rut_depth(ruts, body[0] + rx, body[1] + ry)
        if depth <= 0.0:
            continue
        touching += 1
        vx = body[3] + body[7] * rz - body[8] * ry
        vy = body[4] + body[8] * rx - body[6] * rz
        vz = body[5] + body[6] * ry - body[7] * rx
        up = max(stiffness * depth - damping * min(depth / 0.005, 1.0) * vz, 0.0)
        drag = friction * up / max(sqrt(vx * vx + vy * vy), _SLIDING_SPEED)
        fx, fy = -drag * vx, -drag * vy
        wrench[0] += fx
        wrench[1] += fy
        wrench[2] += up
        wrench[3] += ry * up - rz * fy
        wrench[4] += rz * fx - rx * up
        wrench[5] += rx * fy - ry * fx
    return touching


@njit(cache=True)
def ground_forces(
    ground: FloatArray,
    grid: tuple[float, float, float],
    soils: ByteArray,
    ruts: Ruts,
    tables: FloatArray,
    wheel_constants: FloatArray,
    belly_points: FloatArray,
    belly_constants: FloatArray,
    hubs: FloatArray,
    arms: FloatArray,
    raw: FloatArray,
    body: FloatArray,
    motion: FloatArray,
    state: FloatArray,
    result: FloatArray,
    wrench: FloatArray,
    dt: float,
) -> int:
    """All that the ground does to the rover in a step; points of the belly that touch.

    ``raw`` (13 + n + 2 m,): position, quaternion, velocity and rate of the chassis' centre of mass, then joint rates
    of the n wheels, angles and rates of the m arms. Writes all other arrays that carry motion, state or force.
    """
    ground, soils, tables, wheel_constants = (
        borrowed(ground),
        borrowed(soils),
        borrowed(tables),
        borrowed(wheel_constants),
    )
    ruts = lent(ruts)
    hubs, arms, raw, body, motion = borrowed(hubs), borrowed(arms), borrowed(raw), borrowed(body), borrowed(motion)
    state, result = borrowed(state), borrowed(result)
    locate(raw, hubs, arms, body, motion)
    wheel_forces(ground, grid, soils, ruts, tables, wheel_constants, motion, state, result, dt)
    return belly_wrench(ground, grid, ruts, belly_points, body, belly_constants, wrench)
