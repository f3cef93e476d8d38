"""The compiled step of a rover on the ground: contact, plastic sinkage and shear of all wheels at once, and the belly.

Contact: a plane through seven heights under the wheel (the tyre envelops what is smaller), penetration of the rim
along its normal, a spring and damper on what the plastic sinkage leaves. Sinkage and traction relax toward the steady
Wong-Reece wheel (a table over load and slip) over one contact length of travel. The shear displacement (j_x, j_y) of
each wheel is a state, so that a parked wheel is held by a spring and both directions share one limit.

One file on purpose: numba's cache looks only at the file of the outermost function, so compiled code that is called
from another file would go on running after it was changed.
"""

from __future__ import annotations

from math import atan2, cos, exp, sin, sqrt

from numba import njit

from worlds.types import FloatArray

Triple = tuple[float, float, float]

# Columns of the motion of body and wheels.
BODY_COLUMNS = 18
MOTION_COLUMNS = 13
# Columns of a passive arm: what it sits on, its pivot with every arm level, then its motion in body axes.
ARM_PARENT, ARM_PIVOT, ARM_SIN, ARM_COS, ARM_X, ARM_Z, ARM_VX, ARM_VZ, ARM_RATE = 0, 1, 4, 5, 6, 7, 8, 9, 10
ARM_COLUMNS = 11
# Columns of the state of a wheel, kept from step to step.
SHEAR_X, SHEAR_Y, SINKAGE, CONTACT, PUSHED = 0, 1, 2, 3, 4
STATE_COLUMNS = 5
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
) = range(11)
CONSTANTS = 11

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
def steady(table: FloatArray, load_step: float, load: float, slip: float) -> tuple[float, float, float, float]:
    """Thrust and resistance per load, sinkage and contact length at a load (N) and slip (0..1), bilinear."""
    rows, columns = table.shape[0], table.shape[1]
    u = min(sqrt(max(load, 0.0)) / load_step, rows - 1.000001)
    v = min(sqrt(min(max(slip, 0.0), 1.0)) * (columns - 1), columns - 1.000001)
    i, j = int(u), int(v)
    a, b = u - i, v - j
    w00, w01, w10, w11 = (1 - a) * (1 - b), (1 - a) * b, a * (1 - b), a * b
    thrust = w00 * table[i, j, 0] + w01 * table[i, j + 1, 0] + w10 * table[i + 1, j, 0] + w11 * table[i + 1, j + 1, 0]
    resist = w00 * table[i, j, 1] + w01 * table[i, j + 1, 1] + w10 * table[i + 1, j, 1] + w11 * table[i + 1, j + 1, 1]
    sink = w00 * table[i, j, 2] + w01 * table[i, j + 1, 2] + w10 * table[i + 1, j, 2] + w11 * table[i + 1, j + 1, 2]
    length = w00 * table[i, j, 3] + w01 * table[i, j + 1, 3] + w10 * table[i + 1, j, 3] + w11 * table[i + 1, j + 1, 3]
    return thrust, resist, sink, length


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
    slip = min(sqrt(state[SHEAR_X] ** 2 + state[SHEAR_Y] ** 2) / length, 1.0)
    _, _, sink, length = steady(table, constants[LOAD_STEP], normal, slip)
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
def _traction(
    table: FloatArray, constants: FloatArray, state: FloatArray, normal: float, speeds: Triple, dt: float
) -> Triple:
    """Thrust forward and left, and drag (N), of a wheel under load; advances its state.

    ``speeds``: of the rim, of the hub forward and of the contact to the left (m/s).
    """
    _sink(table, constants, state, normal, speeds, dt)
    rate_x, rate_y = _shear(state, speeds, dt)
    length, load_step = state[CONTACT], constants[LOAD_STEP]
    size = sqrt(state[SHEAR_X] ** 2 + state[SHEAR_Y] ** 2)
    thrust0 = steady(table, load_step, normal, 0.0)[0]
    thrust, resistance, _, _ = steady(table, load_step, normal, size / length)
    gain = normal * (thrust - thrust0) / max(size, 1e-12)
    stretch = max(size / length, _PROBE_SLIP)
    spring = normal * max(steady(table, load_step, normal, stretch)[0] - thrust0, 0.0) / (stretch * length)
    damping = min(constants[SHEAR_DAMPING] * sqrt(spring), _SPIN_DAMPING * constants[SPIN_MASS] / dt)
    drag = _drag(constants, state, normal * resistance, speeds[1], dt)
    # A wheel that rolls freely is sheared forward a little; that part comes and goes with the drag, which outweighs it.
    force_x = gain * state[SHEAR_X] + damping * rate_x + normal * thrust0 * state[PUSHED] / _BUILD_UP
    force_y = gain * state[SHEAR_Y] + damping * rate_y
    limit = constants[COHESION] * constants[WIDTH] * length + normal * constants[TAN_PHI]
    share = min(1.0, limit / max(sqrt(force_x * force_x + force_y * force_y), 1e-12))
    return share * force_x, share * force_y, drag


@njit(cache=True)
def _slip_ratio(rim: float, vx: float) -> float:
    """Driving 1 - v / (omega r), braking (omega r - v) / v; mirrored for backward travel, fading near standstill."""
    sign = 1.0 if (rim if abs(rim) >= abs(vx) else vx) >= 0.0 else -1.0
    return max(-1.0, min(1.0, sign * (rim - vx) / max(abs(rim), abs(vx), _SLIP_SPEED)))


@njit(cache=True)
def wheel_forces(
    ground: FloatArray,
    grid: tuple[float, float, float],
    table: FloatArray,
    constants: FloatArray,
    motion: FloatArray,
    state: FloatArray,
    result: FloatArray,
    dt: float,
) -> None:
    """Advance the soil under every wheel by ``dt`` and write the forces on the wheels.

    ``motion`` (n, 13): hub position, hub velocity, unit axle (left), carrier rate (all world), rotation rate of the
    wheel about its axle. ``state`` (n, 5) is updated, ``result`` (n, 13) written; columns as named above.
    """
    radius, shear_radius = constants[RADIUS], constants[SHEAR_RADIUS]
    spans = (_ENVELOPE * radius, 0.5 * constants[WIDTH])
    for i in range(motion.shape[0]):
        m, out, own = motion[i], result[i], state[i]
        hub, velocity, rate = (m[0], m[1], m[2]), (m[3], m[4], m[5]), (m[9], m[10], m[11])
        normal, spoke, ahead, left, reach = _contact(ground, grid, hub, (m[6], m[7], m[8]), spans)
        vx = _dot(velocity, ahead)
        vy = _dot(velocity, left) - reach * _dot(_cross(rate, spoke), left)
        rim = m[12] * shear_radius
        elastic = radius - reach - own[SINKAGE]
        load = 0.0
        if elastic > 0.0:
            onset = min(elastic / _ONSET, 1.0)
            load = max(constants[STIFFNESS] * elastic - constants[DAMPING] * onset * _dot(velocity, normal), 0.0)
        thrust = side = drag = 0.0
        if load > 0.0:
            thrust, side, drag = _traction(table, constants, own, load, (rim, vx, vy), dt)
        else:
            own[SHEAR_X] = own[SHEAR_Y] = own[PUSHED] = 0.0
            if elastic < -_CLEAR:  # fresh soil next time
                own[SINKAGE] *= exp(-dt / _FORGET_S)
        # Forces act at the bottom of the rim. The normal force moves ahead of the axle by what gives the torque of
        # a thrust at the shearing radius and of a drag at the hub.
        arm = radius - max(elastic, 0.0)
        shift = (drag * arm + thrust * (shear_radius - arm)) / load if load > 0.0 else 0.0
        for k in range(3):
            out[FORCE + k] = load * normal[k] + (thrust - drag) * ahead[k] + side * left[k]
            out[POINT + k] = hub[k] - arm * spoke[k] + shift * ahead[k]
        out[NORMAL], out[DRAWBAR], out[THRUST], out[DEPTH] = load, thrust - drag, thrust, own[SINKAGE]
        out[SLIP], out[SLIP_ANGLE], out[SPEED] = _slip_ratio(rim, vx), atan2(vy, max(abs(vx), _SLIP_SPEED)), vx


@njit(cache=True)
def belly_wrench(
    ground: FloatArray,
    grid: tuple[float, float, float],
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
def body_motion(raw: FloatArray, body: FloatArray) -> None:
    """Position, velocity, rate and rotation matrix (18,) from ``raw`` (13,): position, quaternion, velocity, rate."""
    x, y, z, w = raw[3], raw[4], raw[5], raw[6]
    for k in range(3):  # a slice assignment would take numba two seconds to compile
        body[k], body[3 + k], body[6 + k] = raw[k], raw[7 + k], raw[10 + k]
    body[9], body[10], body[11] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    body[12], body[13], body[14] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    body[15], body[16], body[17] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)


@njit(cache=True)
def arm_motion(raw: FloatArray, wheels: int, arms: FloatArray) -> None:
    """Where passive arms (m, ARM_COLUMNS) on joints about body y are, and how they move against the chassis.

    ``raw`` holds their angles and then their rates behind the joint rates of the ``wheels``. Arms come after the
    arm that they sit on; angles turn x towards -z.
    """
    count = arms.shape[0]
    for k in range(count):
        own, parent = arms[k], int(arms[k, ARM_PARENT])
        angle, rate = raw[13 + wheels + k], raw[13 + wheels + count + k]
        s, c = sin(angle), cos(angle)
        x, z, vx, vz = own[ARM_PIVOT], own[ARM_PIVOT + 2], 0.0, 0.0
        if parent >= 0:
            up = arms[parent]
            dx, dz = x - up[ARM_PIVOT], z - up[ARM_PIVOT + 2]
            rx, rz = up[ARM_COS] * dx + up[ARM_SIN] * dz, up[ARM_COS] * dz - up[ARM_SIN] * dx
            x, z = up[ARM_X] + rx, up[ARM_Z] + rz
            vx, vz = up[ARM_VX] + up[ARM_RATE] * rz, up[ARM_VZ] - up[ARM_RATE] * rx
            s, c = s * up[ARM_COS] + c * up[ARM_SIN], c * up[ARM_COS] - s * up[ARM_SIN]
            rate += up[ARM_RATE]
        own[ARM_SIN], own[ARM_COS], own[ARM_X], own[ARM_Z] = s, c, x, z
        own[ARM_VX], own[ARM_VZ], own[ARM_RATE] = vx, vz, rate


@njit(cache=True)
def wheel_motion(body: FloatArray, hubs: FloatArray, arms: FloatArray, raw: FloatArray, motion: FloatArray) -> None:
    """Motion (n, 13) of wheels on axles along body y; ``hubs`` (n, 4) relative to the centre of mass, and their arm."""
    wx, wy, wz = body[6], body[7], body[8]
    ax, ay, az = body[10], body[13], body[16]
    turning = wx * ax + wy * ay + wz * az
    for i in range(hubs.shape[0]):
        px, py, pz = hubs[i, 0], hubs[i, 1], hubs[i, 2]
        ux, uz, swing = 0.0, 0.0, 0.0  # velocity and rate against the chassis
        if hubs[i, 3] >= 0.0:
            arm = arms[int(hubs[i, 3])]
            dx, dz = px - arm[ARM_PIVOT], pz - arm[ARM_PIVOT + 2]
            lx, lz = arm[ARM_COS] * dx + arm[ARM_SIN] * dz, arm[ARM_COS] * dz - arm[ARM_SIN] * dx
            px, pz, swing = arm[ARM_X] + lx, arm[ARM_Z] + lz, arm[ARM_RATE]
            ux, uz = arm[ARM_VX] + swing * lz, arm[ARM_VZ] - swing * lx
        rx = body[9] * px + body[10] * py + body[11] * pz
        ry = body[12] * px + body[13] * py + body[14] * pz
        rz = body[15] * px + body[16] * py + body[17] * pz
        m = motion[i]
        m[0], m[1], m[2] = body[0] + rx, body[1] + ry, body[2] + rz
        m[3] = body[3] + wy * rz - wz * ry + body[9] * ux + body[11] * uz
        m[4] = body[4] + wz * rx - wx * rz + body[12] * ux + body[14] * uz
        m[5] = body[5] + wx * ry - wy * rx + body[15] * ux + body[17] * uz
        m[6], m[7], m[8] = ax, ay, az
        m[9], m[10], m[11] = wx + swing * ax, wy + swing * ay, wz + swing * az
        m[12] = raw[13 + i] + turning + swing


@njit(cache=True)
def locate(raw: FloatArray, hubs: FloatArray, arms: FloatArray, body: FloatArray, motion: FloatArray) -> None:
    """Where body, arms and wheels are and how they move: writes ``body``, ``arms`` and ``motion``."""
    body_motion(raw, body)
    arm_motion(raw, hubs.shape[0], arms)
    wheel_motion(body, hubs, arms, raw, motion)


@njit(cache=True)
def ground_forces(
    ground: FloatArray,
    grid: tuple[float, float, float],
    table: FloatArray,
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
    locate(raw, hubs, arms, body, motion)
    wheel_forces(ground, grid, table, wheel_constants, motion, state, result, dt)
    return belly_wrench(ground, grid, belly_points, body, belly_constants, wrench)
