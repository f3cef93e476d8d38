"""Force-angle measure of tip-over stability (Papadopoulos and Rey, Vehicle System Dynamics 33(1), 29-48, 2000)."""

from __future__ import annotations

from math import acos, sqrt

from numba import njit

from worlds.types import FloatArray, Vector3


@njit(cache=True)
def force_angle(contacts: FloatArray, centre: FloatArray, force: FloatArray, moment: FloatArray) -> float:
    """Smallest of angle x lever x force over the tip-over axes, N m; negative while the rover tips.

    ``contacts`` (m, 3) clockwise seen from above; ``centre`` (3,) of mass; ``force`` and ``moment`` (3,) on the
    vehicle without the ground's reactions (gravity minus mass times acceleration, and pushes from outside).
    """
    count = contacts.shape[0]
    least = 1e300
    for i in range(count):
        axis, lever = _axis_and_lever(contacts, centre, i)
        push = _across(axis, (force[0], force[1], force[2]))
        turning = axis[0] * moment[0] + axis[1] * moment[1] + axis[2] * moment[2]
        least = min(least, _about_axis(axis, lever, push, turning))
    return least


@njit(cache=True)
def tip_angles(
    contacts: FloatArray, centre: FloatArray, down: FloatArray, rate: FloatArray, angles: FloatArray, rates: FloatArray
) -> None:
    """Write the angle (rad) left until the weight acts over each axis, and the rate of falling over it.

    Axis i runs from contact i to the next; past it the angle is negative. ``down`` (3,) is the direction of gravity,
    ``rate`` (3,) the rotation of the vehicle (rad/s); ``angles`` and ``rates`` are (m,).
    """
    for i in range(contacts.shape[0]):
        axis, lever = _axis_and_lever(contacts, centre, i)
        weight = _across(axis, (down[0], down[1], down[2]))
        cosine = _dot(weight, lever) / max(sqrt(_dot(weight, weight) * _dot(lever, lever)), 1e-12)
        angle = acos(max(-1.0, min(1.0, cosine)))
        angles[i] = angle if _dot(_cross(weight, lever), axis) > 0.0 else -angle
        rates[i] = -_dot(axis, (rate[0], rate[1], rate[2]))


@njit(cache=True)
def _axis_and_lever(contacts: FloatArray, centre: FloatArray, place: int) -> tuple[Vector3, Vector3]:
    """Unit vector along a tip-over axis, and the lever to it from the centre of mass, across it."""
    ax, ay, az = contacts[place, 0], contacts[place, 1], contacts[place, 2]
    end = (place + 1) % contacts.shape[0]
    bx, by, bz = contacts[end, 0], contacts[end, 1], contacts[end, 2]
    axis = _unit((bx - ax, by - ay, bz - az))
    return axis, _across(axis, (bx - centre[0], by - centre[1], bz - centre[2]))


@njit(cache=True)
def _about_axis(axis: Vector3, lever: Vector3, push: Vector3, turning: float) -> float:
    """The measure of one axis; ``lever`` from the centre of mass to it, ``push`` across it, ``turning`` about it."""
    distance = sqrt(_dot(lever, lever))
    unit = (lever[0] / distance, lever[1] / distance, lever[2] / distance)
    couple = _cross(unit, axis)
    share = turning / distance
    total = (push[0] + share * couple[0], push[1] + share * couple[1], push[2] + share * couple[2])
    size = sqrt(_dot(total, total))
    if size < 1e-9:
        return 0.0
    direction = (total[0] / size, total[1] / size, total[2] / size)
    along = _dot(lever, direction)
    arm = (direction[0] * along - lever[0], direction[1] * along - lever[1], direction[2] * along - lever[2])
    angle = acos(max(-1.0, min(1.0, _dot(direction, unit))))
    sign = 1.0 if _dot(_cross(direction, unit), axis) > 0.0 else -1.0
    return sign * angle * sqrt(_dot(arm, arm)) * size


@njit(cache=True)
def _dot(a: Vector3, b: Vector3) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _cross(a: Vector3, b: Vector3) -> Vector3:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def _unit(a: Vector3) -> Vector3:
    size = sqrt(_dot(a, a))
    return a[0] / size, a[1] / size, a[2] / size


@njit(cache=True)
def _across(axis: Vector3, a: Vector3) -> Vector3:
    """The part of ``a`` across a unit ``axis``."""
    along = _dot(axis, a)
    return a[0] - along * axis[0], a[1] - along * axis[1], a[2] - along * axis[2]
