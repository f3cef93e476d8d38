"""The double itself: it refuses what ArduPilot was measured to refuse."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.ardupilot_double import ArduPilotDouble, RefusalError, SitlAbortError, mix, servos

EXAMPLE = (
    '{"timestamp":0.005,"imu":{"gyro":[0.0,0.0,0.0],"accel_body":[0.0,0.0,-9.80665]},'
    '"position":[0.0,0.0,0.0],"attitude":[0.0,0.0,0.0],"velocity":[0.0,0.0,0.0]}'
)
GOOD = f"\n{EXAMPLE}\n".encode()


def lenient(rate_hz: int = 200) -> ArduPilotDouble:
    return ArduPilotDouble(rate_hz=rate_hz, step_s=None, strict=False)


def at(time_s: float, text: str = EXAMPLE) -> bytes:
    return f"\n{text.replace('0.005', repr(time_s))}\n".encode()


def exchange(double: ArduPilotDouble, reply: bytes, now_s: float = 0.0) -> list[bytes]:
    double.packets(now_s)
    double.deliver(reply)
    return double.packets(now_s)


def test_the_example_is_accepted() -> None:
    double = ArduPilotDouble(rate_hz=200, step_s=0.005)
    (first,) = double.packets(0.0)
    assert first == bytes.fromhex("1a48 c800 00000000" + "dc05" * 4 + "e803" * 12)
    assert double.packets(0.0) == []  # one packet is outstanding
    double.deliver(GOOD)
    (second,) = double.packets(0.0)
    assert second[4:8] == b"\1\0\0\0"
    assert double.clock_s == 0.005
    assert double.values["imu.accel_body"] == (0.0, 0.0, -9.80665)


def test_a_space_after_a_colon_breaks_an_array() -> None:
    double = lenient()
    (again,) = exchange(double, at(0.005, EXAMPLE.replace('"gyro":', '"gyro": ')))
    assert again[4:8] == b"\0\0\0\0"
    assert double.log == ["Did not receive attitude or quaternion"]
    assert double.count == 0


def test_a_space_after_a_colon_is_nothing_to_a_scalar() -> None:
    double = lenient()
    exchange(double, GOOD.replace(b'"timestamp":', b'"timestamp": '))
    assert double.count == 1


def test_without_the_first_line_end_the_first_message_only_is_lost() -> None:
    double = lenient()
    exchange(double, GOOD[1:])
    assert (double.count, double.log) == (0, ["no message between two line ends"])
    for _ in range(3):
        double.deliver(GOOD[1:])
        double.packets(0.0)
    assert double.count == 3
    assert len(double.log) == 1


def test_without_a_velocity_there_is_no_step() -> None:
    double = lenient()
    exchange(double, GOOD.replace(b'"velocity"', b'"speed"'))
    assert double.count == 0
    assert "Failed to find key velocity" in double.log[0]


def test_velocity_wind_before_velocity_is_taken_for_it() -> None:
    double = lenient()
    exchange(double, at(0.005, EXAMPLE.replace('"velocity":[0.0,0.0,0.0]', '"velocity":[1.0,2.0,3.0]')))
    exchange(double, at(0.010, EXAMPLE.replace('"velocity":', '"velocity_wind":[9.0,9.0,9.0],"velocity":')))
    assert double.count == 2
    assert double.values["velocity"] == (1.0, 2.0, 3.0)  # stale
    assert double.log == ["Failed to parse velocity"]


def test_not_a_number_ends_the_process() -> None:
    double = lenient()
    double.packets(0.0)
    double.deliver(GOOD.replace(b'"velocity":[0.0', b'"velocity":[NaN'))
    with pytest.raises(SitlAbortError):
        double.packets(0.0)
    assert not double.alive


@pytest.mark.parametrize(("length", "replies"), [(192, 339), (145, 449)])
def test_refused_text_jams_the_buffer(length: int, replies: int) -> None:
    """Measured: 339 replies of 192 bytes, 449 of 145."""
    bad = b"\n" + b"x" * (length - 2) + b"\n"
    double = lenient()
    double.packets(0.0)
    for number in range(1, replies + 1):
        assert not double.jammed
        double.deliver(bad)
        assert len(double.packets(0.0)) == 1, number
    assert double.jammed
    double.deliver(GOOD)
    assert double.packets(0.0) == []
    assert len(double.packets(1.2)) == 1  # what is left is to ask again after silence
    assert double.count == 0


def test_a_good_reply_empties_the_buffer() -> None:
    double = lenient()
    double.packets(0.0)
    for number in range(1, 4):
        for _ in range(200):
            double.deliver(b"\n" + b"x" * 190 + b"\n")
            double.packets(0.0)
        double.deliver(at(0.005 * number))
        double.packets(0.0)
    assert not double.jammed
    assert double.count == 3


@pytest.mark.parametrize(
    ("change", "key", "kept"),
    [
        (lambda text: text.replace('"attitude":[0.0,', '"attitude":[1.0,null,'), "attitude", (1.0, 0.0, 0.0)),
        (lambda text: text.replace('"velocity":[0.0,0.0,0.0]', '"velocity":[4.0]'), "velocity", (4.0, 0.0, 0.0)),
    ],
)
def test_of_a_bad_array_the_elements_before_are_taken(
    change: Callable[[str], str], key: str, kept: tuple[float, ...]
) -> None:
    double = lenient()
    exchange(double, GOOD)
    exchange(double, at(0.010, change(EXAMPLE)))
    assert double.count == 2
    assert double.values[key] == kept


def test_a_space_before_a_comma_is_harmful_and_one_after_it_is_not() -> None:
    double = lenient()
    exchange(double, GOOD.replace(b"[0.0,0.0,-9", b"[ 0.0, 0.0, -9"))
    assert (double.count, double.log) == (1, [])
    exchange(double, GOOD.replace(b"[0.0,0.0,-9", b"[0.0 ,0.0,-9"))
    assert double.count == 1


def test_exponents_are_read() -> None:
    double = lenient()
    exchange(double, GOOD.replace(b'"velocity":[0.0,', b'"velocity":[-1.5e-07,'))
    assert double.values["velocity"][0] == -1.5e-07


def test_silence_is_followed_by_the_same_bytes() -> None:
    double = ArduPilotDouble()
    (first,) = double.packets(0.0)
    assert [double.packets(0.1 * tenth) for tenth in range(1, 11)] == [[]] * 10
    assert double.packets(1.1) == [first]
    assert double.packets(2.1) == []
    assert double.packets(2.2) == [first]
    assert double.clock_s == 0.0


def test_a_surplus_reply_is_used_for_a_later_frame() -> None:
    double = lenient()
    double.packets(0.0)
    double.deliver(at(0.005))
    double.deliver(at(0.010))
    assert [packet[4] for packet in double.packets(0.0)] == [1, 2]


def test_time_that_goes_back_is_a_reset_and_adds_nothing() -> None:
    double = lenient()
    exchange(double, at(5.0))
    exchange(double, at(0.005))
    assert double.log == ["Detected physics reset"]
    assert (double.clock_s, double.count) == (5.0, 2)
    exchange(double, at(0.010))
    assert double.clock_s == pytest.approx(5.005)


def test_the_same_time_twice_moves_the_count_only() -> None:
    double = lenient()
    exchange(double, at(0.005))
    exchange(double, at(0.005))
    assert (double.clock_s, double.count) == (0.005, 2)


def test_steps_of_a_fifth_of_a_second_are_taken_and_leave_the_rate() -> None:
    double = lenient(rate_hz=1200)
    for number in range(1, 6):
        exchange(double, at(0.2 * number))
    assert double.clock_s == pytest.approx(1.0)
    assert double.rate_hz == 1200.0


def test_the_rate_is_that_of_the_physics_and_creeps_to_its_own() -> None:
    double = lenient(rate_hz=1200)
    (packet,) = exchange(double, at(0.005))
    assert int.from_bytes(packet[2:4], "little") == 201  # 1 / dt, one Hz on its way to 1200


def test_a_disabled_output_arrives_as_full_speed_astern() -> None:
    double = ArduPilotDouble(pwm=lambda _time_s, _state: (0,) * 16)
    (packet,) = double.packets(0.0)
    assert packet[8:14] == b"\xe8\x03\x00\x00\xe8\x03"


def test_the_mixer_turns_right_by_driving_left() -> None:
    assert mix(0.0, 1.0) == (2000, 1000)
    assert mix(0.5, 0.25) == (1875, 1625)
    assert mix(1.0, 1.0) == (2000, 1500)
    assert servos(1600, 1400)[:4] == (1600, 1500, 1400, 1500)


@pytest.mark.parametrize(
    "reply",
    [
        GOOD[1:],
        GOOD[:-1],
        GOOD.replace(b'"velocity"', b'"speed"'),
        GOOD.replace(b'"gyro":', b'"gyro": '),
        GOOD.replace(b'"velocity":[0.0,0.0,0.0]', b'"velocity":[0.0,0.0,null]'),
        GOOD.replace(b"0.005", b"0.006"),
        b'\n{"velocity":[0.0,0.0,0.0],' + GOOD[2:].replace(b',"velocity":[0.0,0.0,0.0]', b""),
    ],
    ids=["no line end before", "none after", "a key is missing", "a space", "null", "another step", "another order"],
)
def test_strict_mode_refuses(reply: bytes) -> None:
    double = ArduPilotDouble(rate_hz=200, step_s=0.005)
    with pytest.raises(RefusalError):
        exchange(double, reply)


def test_strict_mode_refuses_a_second_reply() -> None:
    double = ArduPilotDouble(rate_hz=200, step_s=0.005)
    double.packets(0.0)
    double.deliver(GOOD)
    with pytest.raises(RefusalError, match="more than one reply"):
        double.deliver(GOOD)


def test_strict_mode_refuses_another_reply_to_the_same_frame() -> None:
    double = ArduPilotDouble(rate_hz=200, step_s=0.005)
    double.packets(0.0)
    double.packets(1.1)
    double.deliver(GOOD)
    with pytest.raises(RefusalError, match="two different replies"):
        double.deliver(at(0.010))


def test_a_restarted_process_begins_anew() -> None:
    double = ArduPilotDouble(rate_hz=200, step_s=0.005)
    exchange(double, GOOD)
    double.restart()
    (first,) = double.packets(0.0)
    assert first[4:8] == b"\0\0\0\0"
    assert double.states == []
