"""Keys and gamepads as sticks: pure functions, and what a terminal may send in pieces."""

from __future__ import annotations

import sys
import types

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_sim.autopilot.sticks import Sticks
from rover_sim.errors import InputError
from rover_sim.teleop.gamepad import Gamepad, pad_sticks
from rover_sim.teleop.keyboard import AXES, FOCUS_LOST, Hand, Keyboard, keys, press, sticks


@pytest.mark.parametrize(
    ("key", "throttle", "steer"),
    [("i", 0.5, 0.0), ("u", 0.5, -0.5), ("l", 0.0, 0.5), (".", -0.5, 0.5), ("down", -0.5, 0.0), ("k", 0.0, 0.0)],
)
def test_a_key_deflects_while_it_is_held(key: str, throttle: float, steer: float) -> None:
    hand = press(Hand(), key, 10.0)
    assert sticks(hand, 10.0) == Sticks(throttle, steer)
    assert sticks(hand, 10.69) == Sticks(throttle, steer)  # until a terminal begins to repeat
    assert sticks(hand, 10.71) == Sticks()


def test_a_repeated_key_is_let_go_sooner() -> None:
    hand = press(press(Hand(), "i", 0.0), "i", 0.5)
    assert sticks(hand, 0.69) == Sticks(0.5, 0.0)
    assert sticks(hand, 0.71) == Sticks()
    other = press(hand, "j", 0.6)  # another key is a first press again
    assert sticks(other, 1.2) == Sticks(0.0, -0.5)


def test_the_share_has_limits_and_does_not_move_the_sticks() -> None:
    hand = Hand()
    for _ in range(12):
        hand = press(hand, "+", 0.0)
    assert hand.share == 1.0
    for _ in range(12):
        hand = press(hand, "-", 0.0)
    assert hand.share == pytest.approx(0.1)
    assert sticks(hand, 0.0) == Sticks()


@pytest.mark.parametrize("key", [FOCUS_LOST, "k", " "])
def test_without_the_focus_and_at_the_stop_keys_sticks_are_centred_at_once(key: str) -> None:
    hand = press(press(Hand(), "i", 0.0), key, 0.1)
    assert sticks(hand, 0.1).centred


def test_escape_sequences_are_never_taken_for_letters() -> None:
    assert keys(b"\x1b[A\x1bOD\x1b[Oi") == (["up", "left", FOCUS_LOST, "i"], b"")
    assert keys(b"\x1b[1;5A\x1b[3~\x1bAx") == (["x"], b"")  # control and arrow, delete, alt and A
    keyboard = Keyboard()
    for piece in (b"\x1b", b"[", b"D"):
        pressed, where = keyboard.look(piece, 0.0)
    assert (pressed, where) == (["left"], Sticks(0.0, -0.5))


@given(st.binary(max_size=40), st.lists(st.integers(0, 40), max_size=4))
def test_pieces_say_the_same_as_the_whole(data: bytes, cuts: list[int]) -> None:
    whole = keys(data)
    names, rest, at = [], b"", 0
    for cut in (*sorted(min(cut, len(data)) for cut in cuts), len(data)):
        found, rest = keys(rest + data[at:cut])
        names += found
        at = cut
    assert (names, rest) == whole


@given(st.lists(st.tuples(st.sampled_from([*AXES, "+", "-", "A", FOCUS_LOST]), st.floats(0.0, 1.0)), max_size=20))
def test_no_order_of_keys_deflects_longer_than_a_moment(presses: list[tuple[str, float]]) -> None:
    hand, time_s = Hand(), 0.0
    for key, wait_s in presses:
        time_s += wait_s
        hand = press(hand, key, time_s)
        assert abs(sticks(hand, time_s).throttle) <= 1.0
    assert sticks(hand, time_s + 0.7001) == Sticks()


def test_axes_of_a_gamepad() -> None:
    assert pad_sticks((0.0, -1.0, 0.0, 0.25)) == Sticks(1.0, 0.25)
    assert pad_sticks((0.0, 1.0001, 0.0, -1.2)) == Sticks(-1.0, -1.0)
    assert pad_sticks(()) == Sticks(0.0, 0.0)


def test_without_pygame_one_line_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(InputError, match=r"pygame is not installed; install it with .*rover-sim\[teleop\]"):
        Gamepad()


class FakePygame(types.ModuleType):
    """As much of pygame as a gamepad needs."""

    JOYBUTTONDOWN, JOYDEVICEREMOVED = 1539, 1542

    def __init__(self, count: int) -> None:
        super().__init__("pygame")
        self.events: list[types.SimpleNamespace] = []
        self.joystick = types.SimpleNamespace(get_count=lambda: count, Joystick=lambda _number: self)
        self.event = types.SimpleNamespace(get=lambda: [self.events.pop() for _ in range(len(self.events))])
        self.axes = (0.0, -0.5, 0.0, 0.5)

    def init(self) -> None: ...

    def quit(self) -> None: ...

    def get_numaxes(self) -> int:
        return len(self.axes)

    def get_axis(self, number: int) -> float:
        return self.axes[number]


def test_a_gamepad_steers_arms_and_is_centred_once_unplugged(monkeypatch: pytest.MonkeyPatch) -> None:
    fake = FakePygame(1)
    monkeypatch.setitem(sys.modules, "pygame", fake)
    pad = Gamepad()
    fake.events.append(types.SimpleNamespace(type=fake.JOYBUTTONDOWN, button=7))
    state = pad.look()
    assert (state.sticks, state.pressed, state.present) == (Sticks(0.5, 0.5), ("A",), True)
    assert pad.look().pressed == ()
    fake.events.append(types.SimpleNamespace(type=fake.JOYDEVICEREMOVED))
    state = pad.look()
    assert (state.sticks, state.present) == (Sticks(), False)
    pad.close()


def test_no_gamepad_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", FakePygame(0))
    with pytest.raises(InputError, match="no gamepad is connected"):
        Gamepad()
