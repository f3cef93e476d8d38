"""Fault events: what a scenario may say, and what each kind does to sensors and wheels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from rover_sim.eyes import eyes
from rover_sim.sim.faults import WheelState, gnss_offset_w, stall_s, wheel_states
from rover_sim.sim.ned_state import STANDARD_GRAVITY_M_S2, NedState
from rover_sim.sim.rover import load_rover
from rover_sim.sim.sensed import Sensed
from rover_sim.sim.sensor_suite import SensorSuite
from rover_sim.sim.simulation import Simulation
from tests.sim_factory import make_world, slope
from worlds.errors import ScenarioError
from worlds.fault_events import Event, LosableSensor
from worlds.scenario import load_scenario
from worlds.sensor_tables import Actuator
from worlds.types import SensorReadings, World

ROVER = load_rover("husky")
PLAIN = make_world(slope(0.0, 16.0))


def with_events(*events: Event, actuator: Actuator | None = None) -> World:
    return replace(PLAIN, scenario=msgspec.structs.replace(PLAIN.scenario, event=events, actuator=actuator))


def loss(sensor: LosableSensor, time_s: float = 1.0, duration_s: float | None = 0.5) -> Event:
    return Event(kind="sensor_loss", sensor=sensor, time_s=time_s, duration_s=duration_s)


def readings(world: World, seconds: float = 2.0) -> list[SensorReadings]:
    """Every fifth step of a rover that drives ahead."""
    with Simulation(world, ROVER, np.random.default_rng(1)) as simulation:
        told = []
        for step in range(int(240 * seconds)):
            if step % 5 == 0:
                told.append(simulation.read_sensors())
            simulation.step([2.0] * 4)
        return told


def lost_times(told: list[SensorReadings], lost: list[bool]) -> tuple[float, float]:
    times = [reading.time_s for reading, silent in zip(told, lost, strict=True) if silent]
    return round(min(times), 3), round(max(times), 3)


@pytest.fixture(scope="module")
def sound() -> list[SensorReadings]:
    return readings(PLAIN)


def test_a_silent_inertial_unit_gives_nothing_from_its_time_to_its_end(sound: list[SensorReadings]) -> None:
    told = readings(with_events(loss("imu")))
    silent = [reading.imu is None for reading in told]
    assert lost_times(told, silent) == (1.0, round(71 / 48, 3))
    assert [reading.imu for reading in told if reading.imu] == [
        reading.imu for reading, gone in zip(sound, silent, strict=True) if not gone
    ]


def test_a_silent_compass_gives_no_heading_and_leaves_the_rest(sound: list[SensorReadings]) -> None:
    told = readings(with_events(loss("magnetometer")))
    assert lost_times(told, [reading.imu is not None and reading.imu.heading_rad is None for reading in told])[0] == 1.0
    assert [reading.imu and reading.imu.rate_b for reading in told] == [r.imu and r.imu.rate_b for r in sound]


def test_a_silent_receiver_gives_no_fixes_and_a_jump_shifts_them(sound: list[SensorReadings]) -> None:
    told = readings(with_events(loss("gnss")))
    gone = [before.time_s for before, now in zip(sound, told, strict=True) if before.gnss and now.gnss is None]
    assert np.round(gone, 3).tolist() == [1.0, 1.208, 1.417]
    jump = Event(kind="gnss_jump", time_s=1.0, duration_s=0.5, offset_m=(1.0, -2.0, 3.0))
    moved = readings(with_events(jump))
    for before, now in zip(sound, moved, strict=True):
        if before.gnss is not None and now.gnss is not None:
            off = np.subtract(now.gnss.position_w, before.gnss.position_w)
            assert off == pytest.approx((1.0, -2.0, 3.0) if jump.active(now.time_s) else (0.0, 0.0, 0.0))


def test_jumps_add_up() -> None:
    jumps = [Event(kind="gnss_jump", time_s=1.0, offset_m=(1.0, 0.0, 0.0)) for _ in range(2)]
    assert gnss_offset_w(jumps, 0.9) == (0.0, 0.0, 0.0)
    assert gnss_offset_w(jumps, 1.0) == (2.0, 0.0, 0.0)


def test_silent_encoders_count_no_further_and_forget_what_they_missed(sound: list[SensorReadings]) -> None:
    told = readings(with_events(loss("encoder")))
    lost = [reading.time_s > 0.1 and reading.wheel_speed_rad_s == (0.0,) * 4 for reading in told]
    assert lost_times(told, lost)[0] == 1.0
    assert told[-1].wheel_speed_rad_s == sound[-1].wheel_speed_rad_s


@pytest.mark.parametrize("name", ["camera", "laser"])
def test_a_silent_eye_looks_again_when_it_is_over(name: str) -> None:
    sensors = msgspec.structs.replace(PLAIN.scenario.sensors, laser=True)
    scenario = msgspec.structs.replace(PLAIN.scenario, sensors=sensors)
    before = eyes(scenario, 240)[name]
    event = loss("camera" if name == "camera" else "laser", 1.0, 1.0)
    after = eyes(msgspec.structs.replace(scenario, event=(event,)), 240)[name]
    missed = [step for step in range(720) if before.due(step, 240) and not after.due(step, 240)]
    assert missed == [step for step in range(240, 480) if before.due(step, 240)]


def final_wheels(world: World, seconds: float = 2.0) -> tuple[Simulation, list[float]]:
    with Simulation(world, ROVER, np.random.default_rng(1)) as simulation:
        for _ in range(int(240 * seconds)):
            simulation.step([2.0] * 4)
        return simulation, simulation.state.wheel_speed_rad_s.tolist()


def test_a_blocked_wheel_stands_while_the_others_turn_and_turns_again_after() -> None:
    event = Event(kind="stuck_wheel", time_s=1.0, wheel=1, stuck="held")
    _, speeds = final_wheels(with_events(event))
    assert abs(speeds[1]) < 0.01
    assert [speeds[0], *speeds[2:]] == pytest.approx([2.0] * 3, abs=0.05)
    _, after = final_wheels(with_events(msgspec.structs.replace(event, duration_s=0.5)), 2.5)
    assert after == pytest.approx([2.0] * 4, abs=0.05)


def test_a_wheel_without_its_motor_rolls_along() -> None:
    event = Event(kind="stuck_wheel", time_s=1.0, wheel=3, stuck="free")
    with Simulation(with_events(event), ROVER, np.random.default_rng(1)) as simulation:
        for _ in range(480):
            simulation.step([2.0] * 4)
        state = simulation.state
        assert state.wheel_torque_Nm[3] == 0.0
        assert 1.0 < state.wheel_speed_rad_s[3] < 2.0


def test_without_power_the_rover_rolls_out_and_stands() -> None:
    with Simulation(with_events(Event(kind="power_loss", time_s=1.0)), ROVER, np.random.default_rng(1)) as simulation:
        for _ in range(720):
            simulation.step([2.0] * 4)
        state = simulation.state
        assert np.abs(state.wheel_speed_rad_s).max() < 0.01
        assert np.abs(state.wheel_torque_Nm).max() <= 0.1 * ROVER.motor.max_torque_Nm + 1e-9
        assert state.power_W == pytest.approx(ROVER.motor.idle_power_W, abs=1e-3)


def test_a_wheel_of_its_own_fault_keeps_it_when_the_power_goes() -> None:
    events = [
        Event(kind="power_loss", time_s=2.0),
        Event(kind="stuck_wheel", time_s=1.0, wheel=0, stuck="held"),
    ]
    assert wheel_states(events, 2, 0.5) == (WheelState.SOUND, WheelState.SOUND)
    assert wheel_states(events, 2, 1.5) == (WheelState.HELD, WheelState.SOUND)
    assert wheel_states(events, 2, 2.5) == (WheelState.HELD, WheelState.UNPOWERED)


def test_one_answer_is_late() -> None:
    events = [Event(kind="late_physics", time_s=2.0, stall_s=0.7)]
    stalls = [stall_s(events, step / 240 - 1 / 240, step / 240) for step in range(720)]
    assert [step for step, stall in enumerate(stalls) if stall] == [480]
    assert sum(stalls) == 0.7


def test_a_wheel_that_the_rover_does_not_have_is_one_line() -> None:
    world = with_events(Event(kind="stuck_wheel", time_s=1.0, wheel=4, stuck="held"))
    with pytest.raises(ScenarioError, match=r"^test: event\[0\].wheel = 4: husky has the wheels 0 to 3$"):
        Simulation(world, ROVER, np.random.default_rng(1))


BASE = 'name = "x"\n[[event]]\n'


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('kind = "meteor"\ntime_s = 1', 'event[0].kind = "meteor": allowed are sensor_loss, stuck_wheel, power_loss'),
        ('kind = "power_loss"\ntime_s = 600', "event[0].time_s = 600: must be before goal.time_limit_s = 600"),
        ('kind = "power_loss"\ntime_s = 0.0', "event[0].time_s = 0: allowed are 0.1 to 1e+06"),
        ('kind = "power_loss"', "event[0].time_s: this key is required"),
        ('kind = "sensor_loss"\ntime_s = 1', 'event[0].sensor: this key is required with kind = "sensor_loss"'),
        (
            'kind = "sensor_loss"\ntime_s = 1\nsensor = "nose"',
            'event[0].sensor = "nose": allowed are imu, magnetometer',
        ),
        (
            'kind = "sensor_loss"\ntime_s = 1\nsensor = "laser"',
            "event[0].sensor = laser: the scenario gives the rover none",
        ),
        (
            'kind = "stuck_wheel"\ntime_s = 1\nwheel = 0',
            'event[0].stuck: this key is required with kind = "stuck_wheel"',
        ),
        ('kind = "stuck_wheel"\ntime_s = 1\nwheel = -1\nstuck = "held"', "event[0].wheel = -1: allowed are 0 to 99"),
        ('kind = "power_loss"\ntime_s = 1\nwheel = 0', 'event[0].wheel: kind = "power_loss" takes time_s, duration_s'),
        ('kind = "late_physics"\ntime_s = 1\nstall_s = 1.0\nduration_s = 1.0', "event[0].duration_s: kind"),
        (
            'kind = "gnss_jump"\ntime_s = 1\noffset_m = [0.0, 1.0, 0.0]\n[sensors]\ngnss = false',
            "event[0].kind = gnss_jump: sensors.gnss is false",
        ),
    ],
)
def test_a_wrong_event_is_one_line_that_names_it(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "world.toml"
    path.write_text(BASE + text, encoding="utf-8")
    with pytest.raises(ScenarioError) as caught:
        load_scenario(str(path))
    assert str(caught.value).startswith(f"{path}: {expected}")
    assert "\n" not in str(caught.value)


def sensed(*events: Event, seconds: float = 3.0) -> list[Sensed]:
    suite, held = SensorSuite(with_events(*events)), (0.0, 0.0, -STANDARD_GRAVITY_M_S2)
    states = [
        NedState(step / 50, (0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3, held) for step in range(150)
    ]
    return [suite.read(state) for state in states if state.time_s < seconds]


@pytest.mark.parametrize("sensor", ["imu", "magnetometer", "barometer", "gnss"])
def test_an_autopilot_outside_loses_the_same_sensor(sensor: LosableSensor) -> None:
    whole, told = sensed(), sensed(loss(sensor, 1.0, 1.0))
    for before, now in zip(whole, told, strict=True):
        silent = 1.0 <= now.time_s < 2.0
        assert getattr(now, sensor) == (None if silent else getattr(before, sensor))


def test_an_autopilot_outside_sees_the_same_jump() -> None:
    jump = Event(kind="gnss_jump", time_s=1.0, offset_m=(10.0, 20.0, 30.0))
    for before, now in zip(sensed(), sensed(jump), strict=True):
        if before.gnss is not None and now.gnss is not None:
            off = np.subtract(now.gnss.position_m, before.gnss.position_m)
            assert off == pytest.approx((20.0, 10.0, -30.0) if now.gnss.time_s >= 1.0 else (0.0, 0.0, 0.0), abs=1e-9)
