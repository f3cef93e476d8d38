"""Missions: typed items in world coordinates, and what the autopilot can do with them."""

from __future__ import annotations

from dataclasses import dataclass

from worlds.types import Vector3


@dataclass(frozen=True)
class Home:
    """A home position at the head of the item list: kept for the numbering, never driven to."""


@dataclass(frozen=True)
class DriveTo:
    """Drive to a place and wait there for ``hold_s``; ``radius_m`` 0 means the autopilot's own radius."""

    position_w: Vector3
    hold_s: float = 0.0
    radius_m: float = 0.0


@dataclass(frozen=True)
class TurnTo:
    """Turn on the spot to a heading (from +x counter-clockwise), or by an angle if ``relative``."""

    heading_rad: float
    relative: bool = False


@dataclass(frozen=True)
class SetSpeed:
    """Cruise at this speed from here on."""

    speed_m_s: float


@dataclass(frozen=True)
class SetReverse:
    """Drive with the rear (or again the front) first from here on."""

    reverse: bool


@dataclass(frozen=True)
class Wait:
    """Stand still for a while."""

    duration_s: float


@dataclass(frozen=True)
class ReturnHome:
    """Drive to where "return" leads, a rally point or home, in a straight line."""


@dataclass(frozen=True)
class Jump:
    """Go on with another item, so many times in a mission; below 0 always."""

    index: int
    times: int


@dataclass(frozen=True)
class SetHome:
    """Home is here from now on, or where the rover is if ``position_w`` is None."""

    position_w: Vector3 | None = None


@dataclass(frozen=True)
class SetFence:
    """Switch the fence."""

    on: bool


Item = Home | DriveTo | TurnTo | SetSpeed | SetReverse | Wait | ReturnHome | Jump | SetHome | SetFence


@dataclass(frozen=True)
class Mission:
    """An item list; indices are those that its sender gave, home included if the sender put it first."""

    items: tuple[Item, ...] = ()

    @property
    def first(self) -> int:
        """Index of the first item to execute: 1 behind a leading home, else 0."""
        return 1 if self.items and isinstance(self.items[0], Home) else 0

    @property
    def empty(self) -> bool:
        """Whether there is nothing to execute."""
        return len(self.items) <= self.first
