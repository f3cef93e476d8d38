"""The same session on a real port of this machine, with PX4's double as a client in a thread."""

from __future__ import annotations

import socket

import pytest

from rover_sim.errors import InputError, LinkError
from rover_sim.hil.px4_link import open_port
from rover_sim.pacing import Pace, wait_for_news
from tests.px4_double import Outputs, Px4Double, Px4Process, armed_from
from tests.px4_rig import Drive, session
from tests.sim_factory import make_world, slope

ANY_PORT = "127.0.0.1:0"


def test_lockstep_on_a_real_port_as_fast_as_px4_answers() -> None:
    px4 = Px4Double(armed_from(0.0, 0.3, 0.3))
    port, drive = open_port(ANY_PORT), Drive(make_world(slope(0.0)), 8.0)
    try:
        with Px4Process(port.port, px4) as process:
            summary = session(drive, port, wait_for_news).run()
    finally:
        port.close()
    assert px4.checks.believed.sensors >= 1990  # the last few may still be on their way
    assert summary["hil"]["lockstep"]["most_steps"] <= 1
    assert process.poll_timeouts == 0
    assert summary["hil"]["beat"]["rate_hz"] > 0.0


def test_px4_killed_and_started_again_on_a_real_port() -> None:
    """A second PX4 that comes too early waits until the first is gone; then the traverse begins anew for it."""
    port, world = open_port(ANY_PORT), make_world(slope(0.0))
    second = Px4Process(port.port, Px4Double(armed_from(0.2, 0.3, 0.3)))

    def kill(step: int) -> None:
        if step == 100:
            second.__enter__()
            assert second.connected.wait(10.0)
        if step == 250:
            first.end()

    try:
        with Px4Process(port.port, Px4Double(armed_from(0.0, 0.3, 0.3))) as first:
            summary = session([Drive(world, 3.0, kill), Drive(world, 2.0)], port, wait_for_news).run()
    finally:
        port.close()
        second.end()
    assert (summary["hil"]["restarts"], summary["hil"]["steps"]) == (1, 500)
    assert second.px4.checks.believed.sensors >= 490


def test_the_simulator_restarts_on_the_port_that_it_had() -> None:
    """A new PX4 is started with it, as one that has lost its simulator does not connect again."""
    port = open_port(ANY_PORT)
    bind = f"127.0.0.1:{port.port}"
    for _ in range(2):
        px4 = Px4Double(armed_from(0.0, 0.3, 0.3))
        with Px4Process(int(bind.rpartition(":")[2]), px4):
            session(Drive(make_world(slope(0.0)), 1.0), port, wait_for_news).run()
            port.close()
        assert px4.checks.believed.sensors >= 200
        port = open_port(bind)
    port.close()


def test_the_pace_of_the_wall_clock() -> None:
    """One simulated second takes one of wall time; how steady it is, is measured and told."""
    port, drive, pace = open_port(ANY_PORT), Drive(make_world(slope(0.0)), 1.0), Pace(0.25)
    try:
        with Px4Process(port.port, Px4Double(lambda _: Outputs(True, 0.1, 0.1))):
            summary = session(drive, port, wait_for_news, left_s=pace.left_s).run()
    finally:
        port.close()
    assert summary["hil"]["beat"]["rate_hz"] < 260.0


def test_a_port_in_use_is_told_in_a_line() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        bind = f"127.0.0.1:{other.getsockname()[1]}"
        with pytest.raises(LinkError, match=rf"^--bind {bind}: port \d+ is in use; .*another simulator"):
            open_port(bind)


@pytest.mark.parametrize("bind", ["4560", "127.0.0.1:", "127.0.0.1:70000", ":4560"])
def test_a_bad_address_is_told_with_what_is_allowed(bind: str) -> None:
    with pytest.raises(InputError, match=r"allowed: HOST:PORT, such as 127\.0\.0\.1:4560"):
        open_port(bind)
