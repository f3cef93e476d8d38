"""A gamepad as sticks, by pygame, which is an optional extra."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

from rover_sim.autopilot.sticks import Sticks
from rover_sim.errors import InputError

INSTALL = 'pygame is not installed; install it with `pip install "rover-sim[teleop]"` or `uv sync --extra teleop`'
LAYOUT = "left stick: throttle, right stick: steering; buttons: start arm, back disarm, A Manual, B Hold"
# Axes and buttons of the common layout (an Xbox controller as SDL numbers it).
_THROTTLE_AXIS, _STEER_AXIS = 1, 3
BUTTONS = {0: "M", 1: "H", 6: "D", 7: "A"}


@dataclass(frozen=True)
class PadState:
    """One look at the gamepad."""

    sticks: Sticks
    pressed: tuple[str, ...]  # the keys that its buttons stand for
    present: bool


def pad_sticks(axes: tuple[float, ...]) -> Sticks:
    """Deflections from axes between -1 and 1; up is minus one for SDL. A missing axis is in the middle."""
    throttle = -axes[_THROTTLE_AXIS] if len(axes) > _THROTTLE_AXIS else 0.0
    steer = axes[_STEER_AXIS] if len(axes) > _STEER_AXIS else 0.0
    return Sticks(min(max(throttle, -1.0), 1.0), min(max(steer, -1.0), 1.0))


class Gamepad:
    """The first gamepad of this machine; raises InputError if there is none, or no pygame."""

    def __init__(self) -> None:
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # no window is needed
        os.environ.setdefault("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        try:
            import pygame
        except ImportError as error:
            raise InputError(f"--gamepad: {INSTALL}") from error
        pygame.init()
        if pygame.joystick.get_count() == 0:
            pygame.quit()
            raise InputError("--gamepad: no gamepad is connected; allowed: one that the system lists, or the keyboard")
        self._pygame: Any = pygame
        self._stick = pygame.joystick.Joystick(0)

    def look(self) -> PadState:
        """Sticks and fresh presses; centred, for good, once the gamepad is unplugged."""
        pressed, present = [], True
        for event in self._pygame.event.get():
            if event.type == self._pygame.JOYBUTTONDOWN and event.button in BUTTONS:
                pressed.append(BUTTONS[event.button])
            elif event.type == self._pygame.JOYDEVICEREMOVED:
                present = False
        if not present:
            return PadState(Sticks(), tuple(pressed), present)
        axes = tuple(self._stick.get_axis(number) for number in range(self._stick.get_numaxes()))
        return PadState(pad_sticks(axes), tuple(pressed), present)

    def close(self) -> None:
        """Let go of the gamepad."""
        self._pygame.quit()
