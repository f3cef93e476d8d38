"""Fail-safes of the ground station's link and of the battery: parameters, texts, states, as each persona has them."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from rover_sim.autopilot.modes import Mode
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.persona import ARDUPILOT, GENERIC, PX4, Persona
from rover_sim.sim.battery import CELLS, Battery
from rover_sim.sim.rover import load_rover
from rover_sim.sim.simulation import Simulation
from tests.mavlink_rig import Station, Yard
from tests.sim_factory import make_world, slope
from tests.test_mavlink_fence import POINTS, RALLY
from tests.test_mavlink_mission import ITEMS, upload
from tests.test_mavlink_persona import command, result
from worlds.types import BatteryReading, SensorReadings

GCS_BEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
COMPUTER_BEAT = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
FULL = BatteryReading(25.0, 2.0, 0.0, 0.0, 20000.0)


class Powered(Yard):
    """A yard whose rover has a battery that the test sets."""

    battery = FULL

    def __init__(self, *stations: Station, persona: Persona = ARDUPILOT) -> None:
        super().__init__(*stations, persona=persona)
        plain = self.rover.readings

        def readings() -> SensorReadings:
            return replace(plain(), battery=self.battery)

        self.rover.readings = readings  # type: ignore[method-assign]


def going(yard: Yard, station: Station) -> None:
    """Drive to a place far away, in mode Guided."""
    assert result(yard, station, command(400, 1.0)) == 0
    assert yard.autopilot.goto((50.0, 0.0, 0.0)) is None
    yard.step(2.0)


def mode_of(yard: Yard) -> Mode:
    return yard.autopilot.mode


def texts(station: Station) -> list[str]:
    return [message.text for message in station.take("STATUSTEXT")]


def beat(yard: Yard, station: Station, seconds: float, message: Message = GCS_BEAT) -> None:
    for _ in range(int(seconds)):
        station.send(message, yard.time_s)
        yard.step(1.0)


@pytest.mark.parametrize(
    ("persona", "settings", "mode"),
    [
        (ARDUPILOT, {"FS_GCS_ENABLE": 1}, Mode.HOLD),
        (ARDUPILOT, {"FS_GCS_ENABLE": 1, "FS_ACTION": 1}, Mode.RETURN),
        (ARDUPILOT, {"FS_GCS_ENABLE": 1, "FS_ACTION": 3}, Mode.SMART_RETURN),
        (ARDUPILOT, {"FS_GCS_ENABLE": 1, "FS_ACTION": 0}, Mode.GUIDED),
        (GENERIC, {"FS_GCS_ENABLE": 1, "FS_ACTION": 1}, Mode.RETURN),
        (PX4, {"NAV_DLL_ACT": 1}, Mode.HOLD),
        (PX4, {"NAV_DLL_ACT": 2}, Mode.RETURN),
    ],
)
def test_a_lost_ground_station_is_answered(persona: Persona, settings: dict[str, float], mode: Mode) -> None:
    station = Station()
    yard = Yard(station, persona=persona)
    for name, value in settings.items():
        assert yard.autopilot.parameters.set(name, value)
    beat(yard, station, 2)
    going(yard, station)
    yard.step((10.0 if persona is PX4 else 6.5) - 3.5)  # the last heartbeat is 3 s old
    assert mode_of(yard) is Mode.GUIDED
    yard.step(1.0)
    assert mode_of(yard) is mode
    word = "" if mode is Mode.GUIDED else f", {mode.name.lower().replace('_', ' ')}"
    assert f"Ground station lost{word}" in texts(station)
    state = station.take("HEARTBEAT")[-1].system_status
    assert (state == mavlink.MAV_STATE_CRITICAL) == (mode is not Mode.GUIDED)
    beat(yard, station, 1)
    assert "Ground station is back" in texts(station)
    assert mode_of(yard) is mode  # a person decides what comes next


def test_it_is_off_at_first_and_needs_a_heartbeat_that_counts() -> None:
    station, stranger = Station(), Station(245, 190)
    yard = Yard(station, stranger)
    going(yard, station)
    beat(yard, station, 2)
    yard.step(10.0)
    assert mode_of(yard) is Mode.GUIDED  # FS_GCS_ENABLE is 0
    station, stranger = Station(), Station(245, 190)
    other = Yard(station, stranger)
    other.autopilot.parameters.set("FS_GCS_ENABLE", 1)
    going(other, station)
    beat(other, stranger, 2)
    beat(other, station, 2, COMPUTER_BEAT)
    other.step(10.0)
    assert mode_of(other) is Mode.GUIDED  # none of them is MAV_GCS_SYSID's ground station
    beat(other, station, 2)
    beat(other, stranger, 10)  # another one goes on
    assert mode_of(other) is Mode.HOLD


def test_a_mission_goes_on_without_its_station_where_that_is_wanted() -> None:
    station = Station()
    yard = Yard(station)
    yard.autopilot.parameters.set("FS_GCS_ENABLE", 2)
    beat(yard, station, 1)
    upload(yard, station, ITEMS)
    assert result(yard, station, command(400, 1.0)) == 0
    assert yard.autopilot.start_mission() is None
    yard.step(8.0)
    assert mode_of(yard) is Mode.AUTO
    assert "Ground station lost" in texts(station)


def test_in_hold_there_is_nothing_to_do() -> None:
    station = Station()
    yard = Yard(station)
    yard.autopilot.parameters.set("FS_GCS_ENABLE", 1)
    yard.autopilot.parameters.set("FS_ACTION", 1)
    beat(yard, station, 1)
    assert result(yard, station, command(400, 1.0)) == 0
    yard.step(8.0)
    assert mode_of(yard) is Mode.HOLD
    assert not yard.autopilot.tripped


def test_a_low_battery_is_told_and_a_critical_one_sends_the_rover_to_a_rally_point() -> None:
    station = Station()
    yard = Powered(station)
    upload(yard, station, POINTS, RALLY)
    for name, value in (
        ("BATT_LOW_MAH", 4000.0),
        ("BATT_CRT_MAH", 2000.0),
        ("BATT_FS_CRT_ACT", 1),
        ("RALLY_INCL_HOME", 0),
    ):
        assert yard.autopilot.parameters.set(name, value)
    going(yard, station)
    yard.battery = replace(FULL, used_mah=17000.0)
    yard.step(0.5)
    assert "Battery low: 15 %, 25.0 V" in texts(station)
    assert mode_of(yard) is Mode.GUIDED
    yard.battery = replace(FULL, used_mah=18400.0)
    yard.step(0.5)
    said = texts(station)
    assert "Battery critical: 8 %, 25.0 V, return" in said
    assert "Returning to a rally point" in said
    assert station.take("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_CRITICAL
    yard.battery = FULL  # it recovers, or so it says
    yard.step(12.0)
    assert mode_of(yard) is Mode.RETURN
    assert not any("Battery" in text for text in texts(station))
    yard.autopilot.disarm()
    assert yard.autopilot.arm() == "battery critical"


def test_a_sagging_voltage_must_last() -> None:
    station = Station()
    yard = Powered(station)
    yard.autopilot.parameters.set("BATT_FS_LOW_ACT", 2)
    going(yard, station)
    for _ in range(4):
        yard.battery = replace(FULL, voltage_v=20.5)
        yard.step(6.0)
        yard.battery = FULL
        yard.step(1.0)
    assert mode_of(yard) is Mode.GUIDED
    yard.battery = replace(FULL, voltage_v=20.5)
    yard.step(10.5)
    assert mode_of(yard) is Mode.HOLD
    assert "Battery low: 100 %, 20.5 V, hold" in texts(station)


@pytest.mark.parametrize(
    ("action", "critical", "emergency"), [(0, None, None), (2, "hold", "hold"), (3, "return", "hold")]
)
def test_px4s_shares_and_actions(action: int, critical: str | None, emergency: str | None) -> None:
    station = Station()
    yard = Powered(station, persona=PX4)
    assert yard.autopilot.parameters.set("COM_LOW_BAT_ACT", action)
    going(yard, station)
    for used, level, mode in (
        (17500.0, "low: 12", None),
        (18700.0, "critical: 6", critical),
        (19500.0, "emergency: 2", emergency),
    ):
        yard.battery = replace(FULL, used_mah=used)
        yard.step(0.5)
        told = [text for text in texts(station) if text.startswith("Battery")]
        assert told == [f"Battery {level} %, 25.0 V" + (f", {mode}" if mode else "")]


def test_arming_needs_the_charge_that_the_parameter_asks_for() -> None:
    yard = Powered(Station())
    yard.step()
    yard.autopilot.parameters.set("BATT_ARM_MAH", 5000.0)
    yard.battery = replace(FULL, used_mah=16000.0)
    yard.step()
    assert yard.autopilot.arm() == "battery has 4000 mAh left"


def test_battery_status_is_what_the_battery_says() -> None:
    station = Station()
    yard = Powered(station)
    yard.battery = BatteryReading(22.2, 3.0, 5000.0, 3.6e5, 20000.0)
    yard.step(2.1)
    status = station.take("BATTERY_STATUS")[-1]
    assert (status.voltages[0], status.current_battery, status.battery_remaining) == (22200, 300, 75)
    assert status.voltages[1:] == [65535] * 9
    assert (status.current_consumed, status.energy_consumed, status.charge_state) == (5000, 3600, 1)
    assert status.time_remaining == 18000  # 15 Ah at 3 A
    health = station.take("SYS_STATUS")[-1]
    assert (health.voltage_battery, health.current_battery, health.battery_remaining) == (22200, 300, 75)
    assert health.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    yard.autopilot.parameters.set("BATT_LOW_MAH", 16000.0)
    yard.step(2.1)
    assert station.take("BATTERY_STATUS")[-1].charge_state == mavlink.MAV_BATTERY_CHARGE_STATE_LOW


def test_a_rover_without_battery_says_unknown() -> None:
    station = Station()
    Yard(station).step(2.1)
    assert station.take("BATTERY_STATUS")[-1].battery_remaining == -1
    assert station.take("SYS_STATUS")[-1].voltage_battery == 65535


def test_the_battery_gives_what_is_taken_plus_its_losses() -> None:
    rover = load_rover("husky")
    battery = Battery(rover)
    idle_W = rover.motor.idle_power_W
    first = battery.read(0.0, 0.0)
    assert 4.1 * CELLS < first.voltage_v < 4.18 * CELLS
    energy_J = 0.0
    for second in range(1, 3601):
        energy_J += idle_W + 70.0  # W at the axles
        reading = battery.read(float(second), energy_J)
    assert reading.used_j == pytest.approx(3600.0 * (idle_W + 70.0 / rover.battery.efficiency), rel=1e-6)
    assert reading.used_mah == pytest.approx(1000.0 * reading.used_j / 3600.0 / 24.1, rel=0.03)  # mean V
    assert reading.left_share == pytest.approx(1.0 - reading.used_mah / (1000.0 * rover.battery.capacity_Ah))
    assert battery.read(3600.0, energy_J) == reading  # asked twice


def test_an_empty_battery_is_empty_and_an_impossible_load_gets_the_most_there_is() -> None:
    battery = Battery(load_rover("husky"), charge=0.001)
    reading = battery.read(1.0, 1e6)
    assert 0.0 < reading.voltage_v < 12.0
    reading = battery.read(3600.0, 2e6)
    assert (battery.empty, reading.left_share) == (True, 0.0)


def _drive(charge: float, seconds: float) -> tuple[BatteryReading, float, float]:
    """The battery after a drive on level ground, the work that was done and the way that was made."""
    world = make_world(slope(0.0), "firm")
    rover = msgspec.structs.replace(world.scenario.rover, charge=charge)
    world = replace(world, scenario=msgspec.structs.replace(world.scenario, rover=rover))
    with Simulation(world, load_rover("husky"), np.random.default_rng(0)) as simulation:
        readings = simulation.read_sensors()
        for step in range(int(240 * seconds)):
            simulation.step([4.0] * 4)
            if step % 5 == 4:
                readings = simulation.read_sensors()
        assert readings.battery is not None
        return readings.battery, simulation.state.energy_J, float(simulation.state.pose.position_w[0])


def test_driving_drains_the_simulated_battery_and_an_empty_one_moves_nothing() -> None:
    reading, energy_J, way_m = _drive(1.0, 3.0)
    assert way_m > 1.0
    assert reading.used_j > energy_J  # losses between battery and axle
    assert 0.0 < reading.used_mah < 20.0
    assert reading.current_a > 1.5
    reading, _, way_m = _drive(0.0, 1.0)
    assert reading.left_share == 0.0
    assert abs(way_m) < 0.01
