"""The pilot's end of a link against the vehicle, in simulated time: thrust per persona, orders, latency and loss."""

from __future__ import annotations

import pytest

from planner.mobility import STOP
from rover_sim.autopilot.modes import Mode
from rover_sim.autopilot.sticks import Sticks
from rover_sim.commands.teleop import status_line
from rover_sim.mavlink.faults import Faults
from rover_sim.mavlink.persona import ARDUPILOT, PERSONAS, PX4, Persona
from rover_sim.mavlink.pilot_link import Gaps, PilotLink, thrust
from rover_sim.mavlink.signing import Signing
from tests.mavlink_rig import Station, Yard


class Seat(Station):
    """A station's link of which the pilot has the end."""

    def listen(self, time_s: float) -> None: ...


class Cockpit:
    """A pilot and the yard that he steers in, on one clock."""

    def __init__(
        self,
        persona: Persona = ARDUPILOT,
        faults: Faults | None = None,
        keys: tuple[bytes | None, bytes | None] = (None, None),
    ) -> None:
        """``keys``: of the pilot and of the vehicle."""
        seat = Seat(faults=faults, seed=3)
        self.link = PilotLink(seat.end, signer=Signing(keys[0], lambda: 1.7e9 + self.yard.time_s))
        self.yard = Yard(seat, persona=persona, signing=Signing(keys[1], lambda: 1.7e9))

    def run(self, seconds: float, sticks: Sticks | None = None) -> None:
        end = self.yard.time_s + seconds
        while self.yard.time_s < end:
            self.link.tick(self.yard.time_s, sticks or Sticks())
            self.yard.step()


@pytest.mark.parametrize("persona", PERSONAS.values())
def test_arm_manual_drive_let_go(persona: Persona) -> None:
    cockpit = Cockpit(persona)
    cockpit.run(1.2)
    view = cockpit.link.view
    assert (view.system, view.persona, view.mode, view.armed) == (1, persona, "Hold", False)
    cockpit.run(1.0)
    assert not cockpit.yard.autopilot.armed  # nothing arms by itself
    cockpit.link.arm(cockpit.yard.time_s, on=True)
    cockpit.link.set_mode(cockpit.yard.time_s, Mode.MANUAL)
    cockpit.run(0.2)
    assert (view.mode, view.armed) == ("Manual", True)
    cockpit.run(1.0, Sticks(0.5, 0.2))
    motion = cockpit.yard.autopilot.motion
    assert motion.linear_m_s > 0.2
    assert motion.yaw_rate_rad_s < 0.0
    cockpit.run(0.2)
    assert cockpit.yard.autopilot.motion == STOP
    cockpit.run(1.0, Sticks(-0.5, 0.0))
    assert cockpit.yard.autopilot.motion.linear_m_s < -0.2
    cockpit.link.arm(cockpit.yard.time_s, on=False)
    cockpit.run(0.1)
    assert not cockpit.yard.autopilot.armed
    assert "Disarmed" in cockpit.link.take_texts()
    assert cockpit.link.take_texts() == []


def test_thrust() -> None:
    assert [thrust(value, ARDUPILOT) for value in (-1.0, -0.5, 0.0, 1.0)] == [-1000, -500, 0, 1000]
    assert [thrust(value, PX4) for value in (-1.0, -0.5, 0.0, 1.0)] == [0, 250, 500, 1000]


def test_a_refusal_is_told_with_its_reason() -> None:
    cockpit = Cockpit()
    cockpit.link.arm(0.0, on=True)
    assert cockpit.link.take_texts() == ["no vehicle yet"]
    cockpit.run(1.0)
    cockpit.yard.rover.position_sd_m = 50.0
    cockpit.run(0.2)
    cockpit.link.arm(cockpit.yard.time_s, on=True)
    cockpit.run(0.2)
    texts = cockpit.link.take_texts()
    assert "arm or disarm: failed" in texts
    assert "PreArm: position uncertain by 50.0 m" in texts


def test_latency_and_loss_are_those_of_the_link() -> None:
    cockpit = Cockpit(faults=Faults(loss=0.2, delay_s=0.1))
    cockpit.run(30.0)
    assert cockpit.link.gaps.share == pytest.approx(0.2, abs=0.05)
    assert cockpit.link.view.round_trip_s == pytest.approx(0.2, abs=0.05)
    line = status_line(cockpit.link, Sticks(0.5, -0.1), 0.5, cockpit.yard.time_s)
    assert line.startswith("Hold disarmed  battery unknown  round trip 2")
    assert "throttle  +50 %  steer  -10 %" in line


def test_a_clean_link_shows_no_loss() -> None:
    cockpit = Cockpit()
    cockpit.run(10.0)
    assert cockpit.link.gaps.share == 0.0


def test_silence_is_told() -> None:
    cockpit = Cockpit()
    assert status_line(cockpit.link, Sticks(), 0.5, 0.0) == "waiting for a vehicle"
    cockpit.run(1.0)
    assert cockpit.link.connected(cockpit.yard.time_s)
    assert status_line(cockpit.link, Sticks(), 0.5, cockpit.yard.time_s + 3.1) == "the vehicle is silent"


def test_overtaken_and_doubled_frames_are_no_loss() -> None:
    gaps = Gaps()
    for sequence in (254, 255, 1, 0, 1, 2):
        gaps.note(sequence)
    assert gaps.share == pytest.approx(1 / 5)


def test_signed_sticks_steer_a_vehicle_that_believes_no_others() -> None:
    right, wrong = bytes(range(32)), bytes(32)
    for keys, steers in (((right, right), True), ((wrong, right), False), ((None, right), False)):
        cockpit = Cockpit(keys=keys)
        cockpit.run(1.0)
        cockpit.link.arm(cockpit.yard.time_s, on=True)
        cockpit.link.set_mode(cockpit.yard.time_s, Mode.MANUAL)
        cockpit.run(0.2)
        cockpit.run(1.0, Sticks(0.5, 0.0))
        assert (cockpit.yard.autopilot.motion.linear_m_s > 0.2) is steers
