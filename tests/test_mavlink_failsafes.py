"""Every fail-safe as a ground station sees it: text, heartbeat state and mode, as each persona shows them."""

from __future__ import annotations

import numpy as np
import pytest

from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.dialect import mavlink
from rover_sim.mavlink.persona import ARDUPILOT, PERSONAS, Persona
from tests.mavlink_rig import Station, Yard
from tests.test_mavlink_persona import command, result


def _tilt(yard: Yard) -> None:
    yard.rover.roll_rad = float(np.deg2rad(40.0))


def _slip(yard: Yard) -> None:
    yard.rover.slip = 0.7


def _stuck(yard: Yard) -> None:
    yard.autopilot.parameters.set("FS_SLIP_ENABLE", 0)
    yard.rover.slip = 1.0


def _lost(yard: Yard) -> None:
    yard.rover.position_sd_m = 9.0


@pytest.mark.parametrize("persona", PERSONAS.values(), ids=PERSONAS)
@pytest.mark.parametrize(
    ("trouble", "says"), [(_tilt, "Tilt"), (_slip, "Slip stop"), (_stuck, "Stuck"), (_lost, "Pose")]
)
def test_what_stops_the_rover_is_told_and_critical_until_the_mode_is_changed(
    persona: Persona, trouble: object, says: str
) -> None:
    station = Station()
    yard = Yard(station, persona=persona)
    assert result(yard, station, command(400, 1.0)) == 0
    assert yard.autopilot.goto((50.0, 0.0, 0.0)) is None
    yard.step(2.0)
    assert callable(trouble)
    trouble(yard)
    yard.step(9.0)
    beat = station.take("HEARTBEAT")[-1]
    assert (beat.custom_mode, beat.system_status) == (persona.numbers[Mode.HOLD], mavlink.MAV_STATE_CRITICAL)
    texts = [(text.severity, text.text) for text in station.take("STATUSTEXT")]
    told = [(severity, text) for severity, text in texts if text.startswith(says)]
    assert len(told) == 1
    assert told[0][0] <= mavlink.MAV_SEVERITY_ERROR
    assert told[0][1].endswith(", hold")
    assert yard.autopilot.set_mode(Mode.MANUAL) is None
    yard.step()
    assert station.take("HEARTBEAT")[-1].system_status != mavlink.MAV_STATE_CRITICAL


@pytest.mark.parametrize("persona", PERSONAS.values(), ids=PERSONAS)
def test_smart_return_is_a_mode_of_the_ardupilot_alone(persona: Persona) -> None:
    station = Station()
    yard = Yard(station, persona=persona)
    assert result(yard, station, command(400, 1.0)) == 0
    yard.step(0.5)
    assert yard.autopilot.goto((2.0, 0.0, 0.0)) is None
    yard.step(4.0)
    assert result(yard, station, command(176, 1.0, 12.0)) == (0 if persona is ARDUPILOT else 3)
    assert (yard.autopilot.mode is Mode.SMART_RETURN) == (persona is ARDUPILOT)
    if persona is ARDUPILOT:
        yard.step()
        assert station.take("HEARTBEAT")[-1].custom_mode == 12
        yard.step(25.0)
        assert abs(yard.rover.x_m) < 0.5
