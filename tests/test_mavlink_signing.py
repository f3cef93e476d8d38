"""Message signing: pymavlink as the other side, forgers, replays, clocks that are wrong, restarts."""

from __future__ import annotations

import socket
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from rover_sim.mavlink.dialect import MAVLINK_2, Message, Parser, mavlink
from rover_sim.mavlink.endpoint import Channel, Endpoint, Link
from rover_sim.mavlink.faults import Faults
from rover_sim.mavlink.faulty import FaultyLink
from rover_sim.mavlink.signing import TICKS_PER_S, Signing
from rover_sim.mavlink.streams import GROUND_STATION_RATES, Streams
from rover_sim.mavlink.tlog import TlogWriter, read_tlog
from rover_sim.mavlink.transport import parse_url
from rover_sim.mavlink.udp import UdpIn
from tests.mavlink_rig import Station, Yard
from tests.mavlink_signer import ARM, KEY, PING, Clock, Signer


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def signing(clock: Clock) -> Signing:
    return Signing(KEY, clock)


@pytest.fixture
def station() -> Station:
    return Station()


@pytest.fixture
def yard(station: Station, signing: Signing) -> Yard:
    return Yard(station, signing=signing)


def obeyed(yard: Yard, station: Station, frame: bytes) -> bool:
    """Whether a frame with a PING or a command is answered."""
    station.take("PING", "COMMAND_ACK")
    station.send_bytes(frame, yard.time_s)
    yard.step()
    return bool(station.take("PING", "COMMAND_ACK"))


def test_signed_frames_pass_both_ways(yard: Yard, station: Station, signing: Signing, clock: Clock) -> None:
    sender = Signer(clock)
    assert obeyed(yard, station, sender.pack(ARM))
    for name in ("PING", "HEARTBEAT", "ATTITUDE"):
        station.send_bytes(sender.pack(PING), yard.time_s)
        yard.step(1.1)
        assert station.take(name), name
    assert signing.refused == 0


def test_what_the_vehicle_says_passes_pymavlinks_check(yard: Yard, station: Station, clock: Clock) -> None:
    receiver = Signer(clock).mav
    yard.step(1.0)
    frames = [bytes(message.get_msgbuf()) for message in station.heard]
    assert len(frames) > 20
    for frame in frames:
        assert frame[2] == 1
        receiver.decode(bytearray(frame))  # raises for a bad signature or an old timestamp
    assert receiver.signing.badsig_count == 0


@pytest.mark.parametrize("message", [ARM, PING])
def test_unsigned_and_wrongly_signed_frames_do_nothing(
    yard: Yard, station: Station, clock: Clock, signing: Signing, message: Message
) -> None:
    assert not obeyed(yard, station, station.packer.pack(message))
    assert not obeyed(yard, station, Signer(clock, b"x" * 32).pack(message))
    station.packer.version_1 = True
    assert not obeyed(yard, station, station.packer.pack(message))
    frame = bytearray(Signer(clock).pack(message))
    for at in range(len(frame) - 13, len(frame)):  # link, timestamp and hash are all covered
        wrong = bytearray(frame)
        wrong[at] ^= 1
        assert not obeyed(yard, station, bytes(wrong)), at
    assert signing.refused == 16
    assert not yard.autopilot.armed
    assert obeyed(yard, station, bytes(frame))


def test_replays_are_refused_and_links_count_each_for_itself(yard: Yard, station: Station, clock: Clock) -> None:
    sender, other_link = Signer(clock), Signer(clock, link=1)
    first, second = sender.pack(PING), sender.pack(PING)
    assert obeyed(yard, station, first)
    assert not obeyed(yard, station, first)
    assert obeyed(yard, station, second)
    assert not obeyed(yard, station, first)
    assert obeyed(yard, station, other_link.pack(PING))


def test_a_frame_recorded_on_one_link_is_refused_on_another(clock: Clock, signing: Signing) -> None:
    one, other = Station(), Station()
    yard = Yard(one, other, signing=signing)
    frame = Signer(clock).pack(PING)
    assert obeyed(yard, one, frame)
    assert not obeyed(yard, other, frame)


def test_old_and_future_first_frames_are_refused(yard: Yard, station: Station, clock: Clock) -> None:
    sender = Signer(clock)
    assert not obeyed(yard, station, sender.pack(PING, -61.0))
    assert not obeyed(yard, station, sender.pack(PING, 61.0))
    assert not obeyed(yard, station, sender.pack(PING, 1e9))
    assert obeyed(yard, station, sender.pack(PING, -59.0))
    assert obeyed(yard, station, sender.pack(PING, 59.0))


def test_no_forger_locks_a_sender_out(yard: Yard, station: Station, clock: Clock) -> None:
    """The forged future timestamp that pymavlink would store."""
    sender, forger = Signer(clock), Signer(clock, b"y" * 32)
    assert obeyed(yard, station, sender.pack(PING))
    for later_s in (1.0, 59.0, 1e6, 2e9):
        assert not obeyed(yard, station, forger.pack(PING, later_s))
        assert obeyed(yard, station, sender.pack(PING))
    ours = Signer(clock).mav  # pymavlink itself, for comparison
    ours.decode(bytearray(sender.pack(PING)))
    with pytest.raises(mavlink.MAVError):
        ours.decode(bytearray(forger.pack(PING, 1e6)))
    with pytest.raises(mavlink.MAVError):
        ours.decode(bytearray(sender.pack(PING)))  # locked out


def test_a_clock_that_was_wrong_does_not_lock_a_sender_out(yard: Yard, station: Station, clock: Clock) -> None:
    clock.s += 1e7
    assert obeyed(yard, station, Signer(clock).pack(PING))
    clock.s -= 1e7  # ours and theirs are set right
    yard.step(1.1)
    assert obeyed(yard, station, Signer(clock).pack(PING))
    sent = [int.from_bytes(bytes(one.get_msgbuf())[-12:-6], "little") for one in station.take("HEARTBEAT")]
    assert sent[-1] < clock.ticks + 60 * TICKS_PER_S


def test_strangers_hear_nothing_and_take_no_place(clock: Clock) -> None:
    """More of them than a port has places, and then the real sender."""
    port = UdpIn(parse_url("udpin:127.0.0.1:0"))
    link = FaultyLink(port, Faults(), np.random.default_rng(1))
    endpoint = Endpoint(1, 1, [Link(link, GROUND_STATION_RATES)], signer=Signing(KEY, clock))
    unsigned = Station().packer.pack(PING)
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(41)]
        for stranger in sockets[:-1]:
            stranger.sendto(unsigned, ("127.0.0.1", port.port))
            assert endpoint.poll(1.0) == []
        assert endpoint.station_count == 0
        sockets[-1].sendto(Signer(clock).pack(PING), ("127.0.0.1", port.port))
        ((client, message),) = endpoint.poll(1.0)
        assert (message.get_type(), client.channel.vouched) == ("PING", True)
        for stranger in sockets[:-1]:
            stranger.sendto(unsigned, ("127.0.0.1", port.port))
        endpoint.poll(1.1)
        assert endpoint.station_count == 1
    endpoint.close()


def test_radio_status_needs_no_signature(yard: Yard, station: Station, signing: Signing) -> None:
    status = mavlink.MAVLink_radio_status_message(1, 1, 1, 1, 1, 1, 1)
    station.send(status, yard.time_s)
    yard.step()
    assert signing.refused == 0


def test_random_changes_to_a_signed_frame_are_never_believed(clock: Clock) -> None:
    rng = np.random.default_rng(3)
    parser = Parser(Signing(KEY, clock))
    frame = bytearray(Signer(clock).pack(ARM))
    for _ in range(3000):
        wrong = bytearray(frame)
        for _ in range(int(rng.integers(1, 4))):
            wrong[int(rng.integers(len(wrong)))] = int(rng.integers(256))
        if wrong != frame:
            assert parser.datagram(bytes(wrong)) == []
    assert len(parser.datagram(bytes(frame))) == 1


def setup(key: bytes, ticks: int = 0) -> Message:
    return mavlink.MAVLink_setup_signing_message(1, 1, list(key), ticks)


@pytest.fixture
def private() -> Station:
    """A station on a cable."""
    cable = Station()
    cable.link = Link(cable.link.transport, GROUND_STATION_RATES, is_cable=True)
    return cable


def test_a_station_on_a_cable_sets_the_key(private: Station, clock: Clock) -> None:
    signing = Signing(None, clock)
    yard = Yard(private, signing=signing)
    (text,) = yard.ask(private, setup(KEY, clock.ticks), "STATUSTEXT")
    assert text.text.startswith("Signing is on")
    assert signing.key == KEY
    assert not obeyed(yard, private, private.packer.pack(PING))
    sender = Signer(clock)
    assert obeyed(yard, private, sender.pack(PING))
    private.send(setup(bytes(32)), yard.time_s)  # unsigned: not believed any more
    yard.step()
    assert signing.active
    private.send_bytes(sender.pack(setup(bytes(32))), yard.time_s)
    yard.step()
    assert obeyed(yard, private, private.packer.pack(PING))


def test_no_key_over_a_network_nor_while_armed(private: Station, clock: Clock) -> None:
    station, signing = Station(), Signing(None, clock)
    yard = Yard(station, private, signing=signing)
    (text, *_) = yard.ask(station, setup(KEY), "STATUSTEXT")
    assert text.text.startswith("Signing key refused: it may come")
    yard.autopilot.arm(force=True)
    texts = [one.text for one in yard.ask(private, setup(KEY), "STATUSTEXT")]
    assert "Signing key refused: armed" in texts
    assert not signing.active


def test_an_absurd_first_timestamp_is_not_taken(clock: Clock) -> None:
    signing = Signing(None, clock)
    signing.set_key(KEY, 2**47)
    assert abs(signing.stamp() - clock.ticks) <= 1


@pytest.mark.parametrize(
    ("peer", "private"),
    [("127.0.0.1:5", True), ("::1:5", True), ("192.168.0.1:5", False), ("fe80::1:5", False), ("memory", False)],
)
def test_loopback_is_private(peer: str, private: bool) -> None:
    link = Link(Station().link.transport, {})
    assert Channel(link, peer, 1, Parser(), Streams({})).is_private == private


def test_the_log_holds_neither_signatures_nor_keys(tmp_path: Path, private: Station, clock: Clock) -> None:
    log = tmp_path / "telemetry.tlog"
    yard = Yard(private, signing=Signing(None, clock), log=Link(TlogWriter(log), GROUND_STATION_RATES))
    private.send(setup(KEY), yard.time_s)
    yard.step()
    private.send_bytes(Signer(clock).pack(PING), yard.time_s)
    yard.step(1.0)
    yard.vehicle.close()
    frames = [frame for _, frame in read_tlog(log)]
    assert KEY not in log.read_bytes()
    assert all(frame[0] == MAVLINK_2 and frame[2] == 0 for frame in frames)
    parser = Parser()
    names = {message.get_type() for frame in frames for message in parser.datagram(frame)}
    assert {"PING", "HEARTBEAT"} <= names
    assert sum(len(parser.datagram(frame)) for frame in frames) == len(frames)
