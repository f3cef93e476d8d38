from __future__ import annotations

import os
import socket

import numpy as np
import pytest

from rover_sim.errors import InputError, LinkError
from rover_sim.mavlink.endpoint import Endpoint, Link
from rover_sim.mavlink.faults import Faults
from rover_sim.mavlink.memory import memory_link
from rover_sim.mavlink.sockets import bound
from rover_sim.mavlink.tcp import TcpClient, TcpServer
from rover_sim.mavlink.transport import Transport, open_link, parse_url
from rover_sim.mavlink.udp import PEER_EXPIRES_S, UdpIn, UdpOut


def receive(link: Transport, least: int = 1) -> list[tuple[str, bytes]]:
    """Poll until the loopback has delivered; bounded by tries, not by a clock."""
    chunks: list[tuple[str, bytes]] = []
    for _ in range(100_000):
        chunks += link.receive(0.0)
        if len(chunks) >= least:
            break
    return chunks


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("/dev/ttyUSB0,fast", "speed 'fast'"),
        ("serial0", "unknown kind 'serial0'"),
        ("http://x:80", "unknown kind 'http'"),
        ("udpout:127.0.0.1", "no host"),
        ("udpin::14550", "no host"),
        ("udpout:127.0.0.1:0", "port '0'"),
        ("udpout:127.0.0.1:70000", "port '70000'"),
        ("udpout:127.0.0.1:x", "port 'x'"),
        ("udpin:127.0.0.1:\u0661", "port '\u0661'"),
        ("", "unknown kind ''"),
    ],
)
def test_a_bad_url_is_one_line_that_says_what_is_allowed(text: str, says: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_url(text)
    message = str(caught.value)
    assert says in message
    assert repr(text) in message
    assert "allowed:" in message
    assert "\n" not in message


def test_good_urls() -> None:
    url = parse_url("udpin:0.0.0.0:14550")
    assert (url.kind, url.host, url.port) == ("udpin", "0.0.0.0", 14550)  # noqa: S104
    assert parse_url("tcp://127.0.0.1:5760").host == "127.0.0.1"
    assert parse_url("udpout:[::1]:14550").host == "::1"
    for text in ("/dev/ttyUSB0,115200", "serial:/dev/ttyUSB0:115200"):
        url = parse_url(text)
        assert (url.kind, url.host, url.port) == ("serial", "/dev/ttyUSB0", 115200)
    assert parse_url("/dev/ttyACM1").port == 57600


def test_port_in_use_and_unknown_host() -> None:
    taken = UdpIn(parse_url("udpin:127.0.0.1:0"))
    with pytest.raises(LinkError, match=f"udpin:127.0.0.1:{taken.port}.*port {taken.port} is in use"):
        open_link(f"udpin:127.0.0.1:{taken.port}")
    taken.close()
    with pytest.raises(InputError, match=r"host .no\.such\.host\.invalid. is unknown"):
        open_link("udpout:no.such.host.invalid:14550")
    with pytest.raises(LinkError, match=r"cannot listen on .192\.0\.2\.1."):
        open_link("udpin:192.0.2.1:14550")


def test_nobody_listening_on_tcp_is_a_link_error() -> None:
    free = bound(parse_url("tcpin:127.0.0.1:0"), socket.SOCK_STREAM)
    port = free.getsockname()[1]
    free.close()
    with pytest.raises(LinkError, match=f"tcp:127.0.0.1:{port}.*cannot connect"):
        open_link(f"tcp:127.0.0.1:{port}")


def test_udp_learns_its_peers_and_forgets_silent_ones() -> None:
    listener = UdpIn(parse_url("udpin:127.0.0.1:0"))
    one, two = (UdpOut(parse_url(f"udpout:127.0.0.1:{listener.port}")) for _ in range(2))
    assert listener.peers(0.0) == ()
    one.send(b"one", one.peers(0.0)[0], 0.0)
    two.send(b"two", two.peers(0.0)[0], 0.0)
    assert sorted(data for _, data in receive(listener, 2)) == [b"one", b"two"]
    assert len(listener.peers(0.0)) == 2
    for peer in listener.peers(0.0):
        listener.send(b"hello", peer, 0.0)
    assert [data for _, data in receive(one)] == [b"hello"]
    assert [data for _, data in receive(two)] == [b"hello"]
    assert listener.peers(PEER_EXPIRES_S + 0.1) == ()
    for link in (listener, one, two):
        link.close()


def test_udp_out_survives_that_nobody_listens() -> None:
    free = UdpIn(parse_url("udpin:127.0.0.1:0"))
    link = UdpOut(parse_url(f"udpout:127.0.0.1:{free.port}"))
    free.close()
    for _ in range(5):
        link.send(b"anyone?", link.peers(0.0)[0], 0.0)
        assert link.receive(0.0) == []
    assert link.lost_frames > 0
    link.close()


def test_tcp_both_ways_and_a_client_that_leaves() -> None:
    server = TcpServer(parse_url("tcpin:127.0.0.1:0"))
    client = TcpClient(parse_url(f"tcp:127.0.0.1:{server.port}"))
    client.send(b"ping", client.peers(0.0)[0], 0.0)
    assert [data for _, data in receive(server)] == [b"ping"]
    server.send(b"pong", server.peers(0.0)[0], 0.0)
    assert [data for _, data in receive(client)] == [b"pong"]
    client.close()
    for _ in range(100_000):
        server.receive(0.0)
        if not server.peers(0.0):
            break
    assert server.peers(0.0) == ()
    server.close()


def test_the_memory_link_delays_by_the_clock_it_is_given() -> None:
    here, there = memory_link(Faults(delay_s=0.5))
    here.send(b"x", "memory", 1.0)
    assert there.receive(1.49) == []
    assert there.receive(1.5) == [("memory", b"x")]
    assert there.receive(9.0) == []


def test_memory_losses_repeat_with_the_seed() -> None:
    def survivors(seed: int) -> list[bytes]:
        here, there = memory_link(Faults(loss=0.5), np.random.default_rng(seed))
        for number in range(100):
            here.send(bytes([number]), "memory", 0.0)
        return [data for _, data in there.receive(0.0)]

    assert survivors(1) == survivors(1) != survivors(2)
    assert 30 < len(survivors(1)) < 70
    with pytest.raises(ValueError, match="random generator"):
        memory_link(Faults(loss=0.1))


def test_a_closed_memory_link_has_no_peer() -> None:
    here, there = memory_link()
    here.close()
    assert there.peers(0.0) == ()
    there.send(b"x", "memory", 0.0)
    here.close()


def test_tcp_reconnects_by_the_clock_it_is_given() -> None:
    server = TcpServer(parse_url("tcpin:127.0.0.1:0"))
    url = f"127.0.0.1:{server.port}"
    client = TcpClient(parse_url(f"tcp:{url}"))
    client.send(b"one", client.peers(0.0)[0], 0.0)
    assert [data for _, data in receive(server)] == [b"one"]
    server.close()
    for _ in range(100_000):
        client.receive(0.0)
        if not client.peers(0.0):
            break
    for time_s in np.arange(1.0, 5.0, 0.02):
        client.receive(float(time_s))
        assert client.peers(time_s) == ()  # nobody listens
    server = TcpServer(parse_url(f"tcpin:{url}"))
    for time_s in np.arange(10.0, 2000.0, 0.02):
        client.receive(float(time_s))
        if client.peers(time_s):
            break
    client.send(b"two", client.peers(0.0)[0], 0.0)
    assert [data for _, data in receive(server)] == [b"two"]
    client.close()
    client.receive(1e6)
    assert client.peers(1e6) == ()
    server.close()


def test_a_serial_line_both_ways_and_its_end() -> None:
    host, device = os.openpty()
    link = open_link(f"{os.ttyname(device)},57600")
    (peer,) = link.peers(0.0)
    link.send(b"\xfd\x00\x11\n\r", peer, 0.0)
    assert os.read(host, 100) == b"\xfd\x00\x11\n\r"  # raw: no byte means anything to the line
    os.write(host, b"\x03\x04\xff")
    assert [data for _, data in receive(link)] == [b"\x03\x04\xff"]
    os.close(device)
    os.close(host)
    link.receive(0.0)
    assert link.peers(0.0) == ()
    link.close()


@pytest.mark.parametrize(
    ("url", "kind", "says"),
    [
        ("/dev/no-such-device,57600", LinkError, "No such file"),
        ("/dev/null,57600", LinkError, "not a serial device"),
        ("/dev/null,12345", InputError, "speed 12345"),
    ],
)
def test_a_serial_device_that_is_none(url: str, kind: type[Exception], says: str) -> None:
    with pytest.raises(kind, match=says):
        open_link(url)


def test_an_endpoint_wakes_up_for_news_on_any_link_and_not_before() -> None:
    """A closed connection or a full server must not keep it awake."""
    udp, server = UdpIn(parse_url("udpin:127.0.0.1:0")), TcpServer(parse_url("tcpin:127.0.0.1:0"))
    inner, outer = memory_link()
    endpoint = Endpoint(1, 1, [Link(link, {}) for link in (udp, server, inner)])
    assert not endpoint.wait(0.0)
    outer.send(b"?", "memory", 0.0)  # a link in memory has a clock of its own
    assert not endpoint.wait(0.0)
    out = UdpOut(parse_url(f"udpout:127.0.0.1:{udp.port}"))
    out.send(b"?", out.peers(0.0)[0], 0.0)
    assert endpoint.wait(5.0)
    endpoint.poll(0.0)
    assert not endpoint.wait(0.0)
    client = TcpClient(parse_url(f"tcp:127.0.0.1:{server.port}"))
    assert endpoint.wait(5.0)
    endpoint.poll(0.0)
    assert not endpoint.wait(0.0)
    client.close()
    assert endpoint.wait(5.0)
    endpoint.poll(0.0)
    assert not endpoint.wait(0.0)
    out.close()
    endpoint.close()
