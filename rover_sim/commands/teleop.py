"""``rover-sim teleop URL``: steer a rover by keyboard or gamepad."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rover_sim.autopilot.sticks import Sticks
    from rover_sim.mavlink.pilot_link import PilotLink
    from rover_sim.teleop.gamepad import Gamepad
    from rover_sim.teleop.terminal import Terminal

_SHOW_S = 0.2
_LOOP_S = 0.01
_GOODBYES = 5  # neutral sticks at the end: one may be lost


def configure(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""
    parser.add_argument(
        "url", metavar="URL", help="link to the vehicle, such as udpin:127.0.0.1:14550 (docs/mavlink.md)"
    )
    parser.add_argument("--gamepad", action="store_true", help="steer by gamepad instead of keys (extra `teleop`)")
    parser.add_argument(
        "--system",
        type=_system,
        default=255,
        help="own system number, 1 to 255 (default: 255, that of ground stations)",
    )

    parser.add_argument(
        "--signing-key", type=Path, metavar="FILE", help="sign, and hear signed frames only; key or passphrase in FILE"
    )


def execute(args: argparse.Namespace) -> int:
    """Steer until ``q`` or Ctrl-C; the last thing sent is neutral."""
    from rover_sim.mavlink.pilot_link import PilotLink
    from rover_sim.mavlink.signing import Signing
    from rover_sim.mavlink.signing_file import load_key
    from rover_sim.mavlink.transport import open_link
    from rover_sim.pacing import WallClock, unix_time_s
    from rover_sim.stop_flag import stop_flag
    from rover_sim.teleop.gamepad import Gamepad
    from rover_sim.teleop.terminal import open_terminal

    signing = Signing(None if args.signing_key is None else load_key(args.signing_key), unix_time_s)
    with open_terminal() as terminal, stop_flag(hang_up=True) as stopped:
        pad = Gamepad() if args.gamepad else None
        transport = open_link(args.url)
        try:
            _steer(PilotLink(transport, args.system, signing), terminal, pad, stopped, WallClock().elapsed_s)
        finally:
            transport.close()
            if pad is not None:
                pad.close()
    return 0


def _steer(
    link: PilotLink, terminal: Terminal, pad: Gamepad | None, stopped: Callable[[], bool], now_s: Callable[[], float]
) -> None:
    from rover_sim.autopilot.sticks import Sticks
    from rover_sim.teleop.gamepad import LAYOUT
    from rover_sim.teleop.keyboard import HELP, Keyboard

    keyboard, shown_s = Keyboard(), -_SHOW_S
    terminal.say(HELP if pad is None else f"{LAYOUT}; q quits")
    try:
        while not (stopped() or terminal.closed):
            data = terminal.read(_LOOP_S)
            time_s = now_s()
            pressed, sticks = keyboard.look(data, time_s)
            if pad is not None:
                state = pad.look()
                sticks, pressed = state.sticks, [*pressed, *state.pressed]
                if not state.present:
                    terminal.say("the gamepad was unplugged")
                    return
            if "q" in pressed:
                return
            if not link.connected(time_s):
                sticks = Sticks()  # nobody steers blindly
            for key in pressed:
                _order(link, key, time_s)
            link.tick(time_s, sticks)
            for text in link.take_texts():
                terminal.say(text)
            if time_s - shown_s >= _SHOW_S:
                shown_s = time_s
                terminal.show(status_line(link, sticks, keyboard.hand.share, time_s))
    finally:
        for _ in range(_GOODBYES):
            link.steer(now_s(), Sticks())


def _order(link: PilotLink, key: str, time_s: float) -> None:
    """What the capital letters do."""
    from rover_sim.autopilot.modes import Mode

    match key:
        case "A" | "D":
            link.arm(time_s, on=key == "A")
        case "M":
            link.set_mode(time_s, Mode.MANUAL)
        case "H":
            link.set_mode(time_s, Mode.HOLD)


def status_line(link: PilotLink, sticks: Sticks, share: float, time_s: float) -> str:
    """Vehicle and link in one line."""
    view = link.view
    if not link.connected(time_s):
        return "waiting for a vehicle" if view.system is None else "the vehicle is silent"
    armed = "armed" if view.armed else "disarmed"
    battery = "unknown" if view.battery_pct is None else f"{view.battery_pct} %"
    trip = "?" if view.round_trip_s is None else f"{1e3 * view.round_trip_s:.0f} ms"
    return (
        f"{view.mode} {armed}  battery {battery}  round trip {trip}  loss {100 * link.gaps.share:.1f} %  "
        f"throttle {100 * sticks.throttle:+4.0f} %  steer {100 * sticks.steer:+4.0f} %  of {100 * share:.0f} %"
    )


def _system(text: str) -> int:
    if not (text.isdecimal() and 1 <= int(text) <= 255):
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 to 255")
    return int(text)
