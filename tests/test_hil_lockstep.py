from __future__ import annotations

import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_sim.errors import InputError, LinkError
from rover_sim.hil.lockstep import Datagram, Lockstep, Peer, Request
from rover_sim.hil.servo_port import ServoPort
from tests.ardupilot_double import NEUTRAL, pack

ME: Peer = ("127.0.0.1", 40000)
OTHER: Peer = ("127.0.0.1", 40001)


def packet(count: int, peer: Peer = ME) -> Datagram:
    return pack(240, count, NEUTRAL), peer


def heard(lockstep: Lockstep, *datagrams: Datagram, now_s: float = 0.0) -> Request:
    request = lockstep.hear(datagrams, now_s)
    assert request is not None
    return request


def answered(lockstep: Lockstep, *counts: int) -> None:
    for count in counts:
        lockstep.answer(heard(lockstep, packet(count)), [])


def test_a_new_count_is_a_new_request() -> None:
    lockstep = Lockstep(loopback_only=True)
    first = heard(lockstep, packet(0))
    assert (first.packet.frame_count, first.peer, first.repeated, first.restarted) == (0, ME, False, False)
    lockstep.answer(first, [])
    assert not heard(lockstep, packet(1)).repeated


def test_a_count_that_was_answered_is_a_repeated_one() -> None:
    lockstep = Lockstep(loopback_only=True)
    answered(lockstep, 0, 1)
    assert heard(lockstep, packet(1)).repeated


def test_what_waited_in_the_queue_is_answered_once() -> None:
    lockstep = Lockstep(loopback_only=True)
    assert not heard(lockstep, packet(0), packet(0), packet(0)).repeated


def test_a_duplicate_with_something_newer_behind_it_needs_no_reply() -> None:
    lockstep = Lockstep(loopback_only=True)
    answered(lockstep, 0, 1)
    request = heard(lockstep, packet(1), packet(1), packet(2))
    assert (request.packet.frame_count, request.repeated) == (2, False)


def test_what_came_during_the_step_is_answered_by_its_reply() -> None:
    lockstep = Lockstep(loopback_only=True)
    request = heard(lockstep, packet(7))
    assert lockstep.answer(request, [packet(7), packet(7), packet(3, OTHER)]) == [packet(3, OTHER)]


def test_a_packet_that_was_overtaken_is_dropped_and_no_restart() -> None:
    lockstep = Lockstep(loopback_only=True)
    answered(lockstep, 0, 1, 2, 3)
    assert lockstep.hear([packet(2)], 0.0) is None
    assert lockstep.dropped == {"late packet": 1}
    assert not heard(lockstep, packet(4)).restarted


def test_a_count_that_falls_to_nothing_is_a_restart() -> None:
    lockstep = Lockstep(loopback_only=True)
    answered(lockstep, 0, 1, 2)
    request = heard(lockstep, packet(0))
    assert (request.restarted, request.repeated) == (True, False)
    lockstep.answer(request, [])
    assert not heard(lockstep, packet(1)).restarted


def test_the_first_packet_may_be_of_an_autopilot_that_was_running() -> None:
    request = heard(Lockstep(loopback_only=True), packet(5000))
    assert (request.restarted, request.repeated) == (False, False)


def test_a_second_autopilot_is_dropped_while_the_first_one_speaks() -> None:
    lockstep = Lockstep(loopback_only=True)
    answered(lockstep, 0)
    assert lockstep.hear([packet(0, OTHER)], 1.0) is None
    assert lockstep.hear([packet(0, OTHER)], 2.0) is None
    assert lockstep.dropped == {"second autopilot": 2}
    (note,) = lockstep.take_notes()
    assert "127.0.0.1:40001" in note
    assert lockstep.take_notes() == []
    assert not heard(lockstep, packet(1), now_s=2.1).restarted


@pytest.mark.parametrize("answers", [(0,), (0, 1, 2)])
def test_a_new_process_takes_over_once_the_old_one_is_silent(answers: tuple[int, ...]) -> None:
    """A restarted autopilot has another port; its count may be the one that the old one stopped at."""
    lockstep = Lockstep(loopback_only=True)
    answered(lockstep, *answers)
    assert lockstep.hear([packet(0, OTHER)], 1.1) is None
    request = heard(lockstep, packet(0, OTHER), packet(0, OTHER), now_s=3.3)
    assert (request.peer, request.restarted, request.repeated) == (OTHER, True, False)


@pytest.mark.parametrize("data", [b"", b"\x1a\x48", pack(240, 0, NEUTRAL)[:-1], b'\n{"timestamp":1.0}\n'])
def test_what_is_no_servo_packet_is_dropped_and_said_once(data: bytes) -> None:
    lockstep = Lockstep(loopback_only=True)
    assert lockstep.hear([(data, ME), (data, OTHER)], 0.0) is None
    assert lockstep.dropped == {"no servo packet": 2}
    (note,) = lockstep.take_notes()
    assert f"{len(data)} bytes" in note
    assert "40 bytes with magic 18458" in note


def test_other_machines_are_heard_only_where_the_port_is_open_to_them() -> None:
    stranger = packet(0, ("192.0.2.7", 5000))
    assert Lockstep(loopback_only=True).hear([stranger], 0.0) is None
    assert Lockstep(loopback_only=False).hear([stranger], 0.0) is not None


@given(st.lists(st.tuples(st.integers(0, 4), st.booleans(), st.binary(max_size=45)), max_size=30))
def test_no_sequence_of_datagrams_breaks_it(script: list[tuple[int, bool, bytes]]) -> None:
    lockstep = Lockstep(loopback_only=True)
    for number, (count, real, junk) in enumerate(script):
        request = lockstep.hear([packet(count) if real else (junk, OTHER)], 0.1 * number)
        if request is not None:
            assert request.repeated is False or request.restarted is False
            assert lockstep.answer(request, [packet(count)]) == []


def test_a_port_takes_what_has_come_and_replies_to_who_sent_it() -> None:
    port = ServoPort("127.0.0.1:0")
    peer = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    peer.settimeout(5.0)
    try:
        assert port.on_loopback
        assert port.take() == []
        peer.sendto(b"one", port.address)
        peer.sendto(b"two", port.address)
        assert port.wait(5.0)
        (one, sender), (two, _) = port.take()
        assert (one, two) == (b"one", b"two")
        port.send(b"reply", sender)
        assert peer.recv(100) == b"reply"
    finally:
        peer.close()
        port.close()


def test_a_port_in_use_is_said_in_one_line() -> None:
    port = ServoPort("127.0.0.1:0")
    host, number = port.address
    try:
        with pytest.raises(LinkError, match=rf"--bind {host}:{number}: port {number} is in use.*another physics"):
            ServoPort(f"{host}:{number}")
    finally:
        port.close()


@pytest.mark.parametrize("bind", ["", "9002", "127.0.0.1:", "127.0.0.1:70000", ":9002", "127.0.0.1:x"])
def test_a_bad_address_is_a_user_error(bind: str) -> None:
    with pytest.raises(InputError, match="HOST:PORT"):
        ServoPort(bind)
