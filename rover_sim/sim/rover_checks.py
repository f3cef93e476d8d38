"""Rovers that cannot be: parts that do not fit together, each complaint one line with file, key, value and remedy."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

from worlds.errors import ScenarioError
from worlds.types import Vector3

if TYPE_CHECKING:
    from rover_sim.sim.rover import RoverModel

_MOST_WHEELS = 12


def check_rover(model: RoverModel, source: str) -> None:
    """Raise `ScenarioError` for parts that do not fit together."""
    _check_wheel_places(model, source)
    _check_wheel_size(model, source)
    _check_arms(model, source)
    _check_inertia(model.chassis.inertia_kg_m2, "chassis", source)
    for number, arm in enumerate(model.suspension.arm):
        _check_inertia(arm.inertia_kg_m2, f"suspension.arm[{number}]", source)


def _check_wheel_places(model: RoverModel, source: str) -> None:
    """An even number, the left ones from front to rear, then the right ones."""
    places = model.wheel.positions_m
    half = len(places) // 2
    if len(places) % 2 or not 4 <= len(places) <= _MOST_WHEELS:
        raise ScenarioError(
            f"{source}: wheel.positions_m: {len(places)} wheels; allowed is an even number from 4 to {_MOST_WHEELS}"
        )
    for number, place in enumerate(places):
        side = 1.0 if number < half else -1.0
        behind = number not in (0, half) and place[0] >= places[number - 1][0]
        if place[1] * side <= 0.0 or behind:
            raise ScenarioError(
                f"{source}: wheel.positions_m[{number}] = {list(place)}: "
                "the order is left front to left rear, then right front to right rear (x forward, y left)"
            )


def _check_wheel_size(model: RoverModel, source: str) -> None:
    """Wheels smaller than the rover, that leave each other room."""
    wheel = model.wheel
    if not model.chassis.box:
        raise ScenarioError(f"{source}: chassis.box: at least one box is needed")
    longest = max(box.size_m[0] for box in model.chassis.box)
    if 2.0 * wheel.radius_m > max(longest, model.wheelbase_m):
        raise ScenarioError(
            f"{source}: wheel.radius_m = {wheel.radius_m:g}: wheels larger than the rover; the hull is {longest:g} m "
            f"long and the wheelbase {model.wheelbase_m:g} m"
        )
    half = len(wheel.positions_m) // 2
    sides = (wheel.positions_m[:half], wheel.positions_m[half:])
    gap = min(before[0] - after[0] for side in sides for before, after in pairwise(side))
    if gap < 2.0 * wheel.radius_m or model.track_m < 2.0 * wheel.width_m:
        raise ScenarioError(
            f"{source}: wheel.radius_m = {wheel.radius_m:g}, wheel.width_m = {wheel.width_m:g}: wheels overlap; "
            f"the axles are {gap:g} m apart and the track is {model.track_m:g} m"
        )
    if wheel.grouser_m > 0.5 * wheel.radius_m:
        raise ScenarioError(f"{source}: wheel.grouser_m = {wheel.grouser_m:g}: at most half of the wheel radius")


def _check_arms(model: RoverModel, source: str) -> None:
    """Arms hang on the chassis or on arms before them; every wheel and the differential name arms that exist."""
    suspension = model.suspension
    numbers = suspension.arm_numbers()
    if len(numbers) != len(suspension.arm) + 1:
        raise ScenarioError(f"{source}: suspension.arm: two arms of one name, or one named 'chassis'")
    for number, arm in enumerate(suspension.arm):
        key = f"{source}: suspension.arm[{number}]"
        if numbers.get(arm.parent, number) >= number:
            allowed = ", ".join(list(numbers)[: number + 1])
            raise ScenarioError(f"{key}.parent = {arm.parent!r}: allowed here: {allowed}")
        low, high = arm.limits_deg
        if not low < 0.0 < high:
            raise ScenarioError(
                f"{key}.limits_deg = {list(arm.limits_deg)}: must be [lowest, highest] with zero in between"
            )
    count = len(model.wheel.positions_m)
    if (suspension.arm or suspension.wheel_arms) and len(suspension.wheel_arms) != count:
        raise ScenarioError(
            f"{source}: suspension.wheel_arms: {len(suspension.wheel_arms)} names for {count} wheels; one each, "
            "in the order of wheel.positions_m"
        )
    for name in (*suspension.wheel_arms, *(suspension.differential or ())):
        if name not in numbers:
            raise ScenarioError(f"{source}: suspension: no arm {name!r}; allowed are {', '.join(numbers)}")
    _check_differential(model, source)


def _check_differential(model: RoverModel, source: str) -> None:
    """It joins one arm of the chassis on each side."""
    suspension = model.suspension
    if suspension.differential is None:
        return
    joined = [arm for arm in suspension.arm if arm.name in suspension.differential]
    opposite = len(joined) == 2 and joined[0].pivot_m[1] * joined[1].pivot_m[1] < 0.0
    if not opposite or any(arm.parent != "chassis" for arm in joined):
        raise ScenarioError(
            f"{source}: suspension.differential = {list(suspension.differential)}: "
            "must be one left and one right arm that sit on the chassis"
        )


def _check_inertia(inertia: Vector3, key: str, source: str) -> None:
    a, b, c = sorted(inertia)
    if a + b < c:
        raise ScenarioError(
            f"{source}: {key}.inertia_kg_m2 = {list(inertia)}: no body has one moment "
            "larger than the sum of the other two"
        )
