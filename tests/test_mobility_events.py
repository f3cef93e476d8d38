from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_sim.outcome import Judge, Reason
from rover_sim.sim import mobility_events as mobility
from rover_sim.sim.mobility_events import Kind, MobilityLimits, MobilityLog, Standards
from rover_sim.sim.rover import load_rover
from rover_sim.sim.vehicle_state import VehicleState
from worlds.geometry import quaternion_from_euler
from worlds.types import Pose

ROVER = load_rover("husky")
RADIUS = ROVER.wheel_shape().shear_radius_m
SHARE_N = ROVER.mass_kg * 9.81 / 4
STEP_S = 1.0 / 24.0
LIMITS = MobilityLimits()


def rolling(speed: float = 0.5, slip: float = 0.0) -> VehicleState:
    """Straight ahead on level ground; all wheels alike."""
    four = np.zeros(4)
    return VehicleState(
        time_s=0.0,
        pose=Pose(np.array([1.0, 2.0, 0.165]), quaternion_from_euler(0.0, 0.0, 0.0)),
        linear_velocity_w=np.array([speed * (1.0 - slip), 0.0, 0.0]),
        angular_velocity_w=np.zeros(3),
        hubs_w=np.array([1.0, 2.0, 0.165]) + np.array(ROVER.wheel.positions_m),
        wheel_speed_rad_s=np.full(4, speed / RADIUS),
        slip=np.full(4, slip),
        slip_angle_rad=four,
        sinkage_m=np.full(4, 0.01),
        normal_force_N=np.full(4, SHARE_N),
        drawbar_N=four,
        wheel_torque_Nm=four,
        wheel_power_W=four,
        pit_depth_m=np.full(4, -0.01),
        wedged=np.zeros(4, dtype=np.bool_),
        power_W=25.0,
        energy_J=0.0,
        tilt_rad=0.0,
        stability_margin=1.0,
        tip_angle_rad=np.array([0.9, 1.0, 0.9, 1.0]),
        tip_rate_rad_s=four,
        belly_contact=False,
        belly_clearance_m=0.13,
        body_contacts=(),
        wheel_contacts=(),
        off_map=False,
    )


def with_wheel(state: VehicleState, name: str, wheel: int, value: float) -> VehicleState:
    values = getattr(state, name).copy()
    values[wheel] = value
    return replace(state, **{name: values})


def watched(*phases: tuple[VehicleState, float]) -> MobilityLog:
    """What is noted when each state lasts for its time, s."""
    log, looks = MobilityLog(ROVER, 9.81), 0
    for state, seconds in phases:
        for _ in range(round(seconds / STEP_S)):
            looks += 1
            log.look(replace(state, time_s=looks * STEP_S), STEP_S)
    return log


def found(log: MobilityLog) -> list[tuple[Kind, int | None]]:
    return [(event.kind, event.wheel) for event in log.events]


def test_an_easy_drive_has_no_events() -> None:
    assert found(watched((rolling(slip=0.2), 20.0))) == []


@pytest.mark.parametrize("slip", [0.40, 0.7, 1.0])
def test_slip_at_the_stop_limit_is_told_within_a_revolution(slip: float) -> None:
    log = watched((rolling(slip=0.1), 3.0), (rolling(slip=slip), 5.0))
    assert found(log) == [(Kind.TRACTION_LOSS, wheel) for wheel in range(4)]
    travel = 0.5 * (log.events[0].time_s - 3.0)  # at 0.5 m/s of the rim
    assert 0.5 * 2 * pi * RADIUS <= travel < 2 * pi * RADIUS


def test_slip_just_under_the_limit_or_too_short_is_no_event() -> None:
    assert found(watched((rolling(slip=0.39), 20.0))) == []
    assert found(watched(*[(rolling(slip=0.9), 0.8), (rolling(), 0.2)] * 8)) == []


def test_a_locked_rover_that_slides_has_lost_traction() -> None:
    sliding = replace(rolling(speed=0.0), linear_velocity_w=np.array([0.5, 0.0, 0.0]))
    assert len(found(watched((sliding, 5.0)))) == 4


def test_skidding_in_a_turn_is_no_loss_of_traction() -> None:
    turning = rolling(speed=0.0)
    rim = np.array([-0.5, -0.5, 0.5, 0.5])
    yaw_rate = 2 * 0.5 / (ROVER.drive.effective_track_ratio * ROVER.track_m)
    turning = replace(turning, wheel_speed_rad_s=rim / RADIUS, angular_velocity_w=np.array([0.0, 0.0, yaw_rate]))
    assert found(watched((turning, 10.0))) == []
    stuck = replace(turning, angular_velocity_w=np.zeros(3))
    assert len(found(watched((stuck, 10.0)))) == 4


def test_one_event_is_told_once_and_again_only_after_it_was_over() -> None:
    slipping, halting, gripping = rolling(slip=0.6), rolling(speed=0.0), rolling(slip=0.05)
    between = rolling(slip=0.35)  # under the limit, not yet over
    once = [(slipping, 3.0), (between, 3.0), (slipping, 3.0), (halting, 5.0), (slipping, 3.0)]
    assert len(found(watched(*once))) == 4
    assert len(found(watched(*once, (gripping, 1.0), (slipping, 3.0)))) == 8


def test_a_wheel_off_the_ground_loses_support_and_not_traction() -> None:
    lifted = with_wheel(rolling(), "normal_force_N", 2, 0.04 * SHARE_N)
    spinning = replace(lifted, linear_velocity_w=np.array([0.45, 0.0, 0.0]))
    log = watched((spinning, 5.0))
    assert found(log) == [(Kind.SUPPORT_LOSS, 2)]
    assert log.events[0].time_s == pytest.approx(0.2, abs=STEP_S)
    assert log.events[0].position_m == pytest.approx([1.256, 2.0 - 0.2854, 0.165])
    assert found(watched(*[(lifted, 0.15), (rolling(), 0.05)] * 20)) == []  # hops


def test_a_wheel_is_trapped_when_it_turns_in_vain_in_a_pit() -> None:
    pit = with_wheel(rolling(slip=0.2), "pit_depth_m", 1, 0.31 * ROVER.wheel.radius_m)
    width_s = 2 * 2 * ROVER.wheel.radius_m / (0.8 * 0.5)  # to cross the widest pit
    assert found(watched((pit, width_s))) == []  # it rolls through
    stuck = replace(pit, linear_velocity_w=np.array([0.18, 0.0, 0.0]))
    assert (Kind.WHEEL_TRAP, 1) in found(watched((stuck, 2.0)))
    shallow = with_wheel(stuck, "pit_depth_m", 1, 0.29 * ROVER.wheel.radius_m)
    assert (Kind.WHEEL_TRAP, 1) not in found(watched((shallow, 2.0)))
    wedged = replace(stuck, pit_depth_m=np.zeros(4), wedged=np.array([False, False, False, True]))
    assert (Kind.WHEEL_TRAP, 3) in found(watched((wedged, 2.0)))


def test_the_belly_rests_at_zero_clearance_and_a_brush_is_none() -> None:
    resting = replace(rolling(), belly_clearance_m=-0.002)
    assert found(watched((resting, 1.0))) == [(Kind.HIGH_CENTRED, None)]
    assert found(watched(*[(resting, 2 * STEP_S), (rolling(), 2 * STEP_S)] * 10)) == []
    hovering = replace(rolling(), belly_clearance_m=0.005)
    assert len(found(watched(*[(resting, 1.0), (hovering, 1.0)] * 3))) == 1


def test_embedding_needs_slip_and_growing_sinkage() -> None:
    slipping = rolling(slip=0.8)
    grown = replace(slipping, sinkage_m=np.full(4, 0.0131))
    assert Kind.EMBEDDING not in {kind for kind, _ in found(watched((slipping, 20.0)))}
    log = watched((slipping, 1.0), (grown, 2.0))
    assert [wheel for kind, wheel in found(log) if kind is Kind.EMBEDDING] == [0, 1, 2, 3]
    assert log.digging(grown)
    assert not log.digging(rolling(speed=0.0))
    # Sinkage that grew before slip reached the limit is ordinary.
    assert found(watched((replace(slipping, linear_velocity_w=np.array([0.4, 0.0, 0.0])), 1.0), (grown, 0.0))) == []


def verdicts(places: list[tuple[float, float, bool]]) -> list[Reason | None]:
    """What a judge says that looks twice a second; each place is x, heading and whether wheels dig."""
    judge = Judge()
    said = []
    for x, heading, digging in places:
        pose = Pose(np.array([x, 0.0, 0.165]), quaternion_from_euler(0.0, 0.0, heading))
        said.append(judge.look(replace(rolling(), pose=pose), (), 0.5, digging=digging))
    return said


def test_embedded_is_digging_for_fifteen_seconds_on_the_spot() -> None:
    on_the_spot = [(0.0, 0.0, True)] * 31
    assert verdicts(on_the_spot) == [None] * 31  # the first look is where it got to
    assert verdicts([*on_the_spot, (0.0, 0.0, True)]) == [None] * 31 + [Reason.EMBEDDED]
    assert verdicts([*on_the_spot, (0.0, 0.0, False), *on_the_spot[1:]]) == [None] * 62
    moved_on = [(0.11, 0.0, True)] * 32
    assert verdicts([*on_the_spot, *moved_on]) == [None] * 62 + [Reason.EMBEDDED]


def test_a_rover_that_turns_or_crawls_on_while_its_wheels_dig_is_not_embedded() -> None:
    assert verdicts([(0.0, 0.03 * look, True) for look in range(200)]) == [None] * 200
    assert verdicts([(0.01 * look, 0.0, True) for look in range(200)]) == [None] * 200
    assert Reason.EMBEDDED in verdicts([(0.001 * look, 0.0, True) for look in range(200)])
    rocking = [(0.0, 0.05 * (look % 2), True) for look in range(40)]
    assert Reason.EMBEDDED in verdicts(rocking)


def test_the_alarm_carries_the_tip_angle_ahead() -> None:
    light = replace(rolling(), stability_margin=0.05)  # behind a bump: no danger
    rolling_over = with_wheel(rolling(), "tip_rate_rad_s", 1, 1.6)
    slowly = with_wheel(rolling(), "tip_rate_rad_s", 1, 1.4)
    on_the_edge = with_wheel(rolling(), "tip_angle_rad", 3, 0.09)
    dropping_back = with_wheel(on_the_edge, "tip_rate_rad_s", 3, -0.1)
    assert found(watched((light, 2.0), (slowly, 2.0), (dropping_back, 2.0))) == []
    assert found(watched((rolling_over, STEP_S))) == [(Kind.TIP_OVER, None)]
    assert found(watched((on_the_edge, 1.0))) == [(Kind.TIP_OVER, None)]


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(-0.2, 1.2), st.floats(-0.05, 0.2)), min_size=1, max_size=60),
)
def test_events_alternate_with_their_ends(looks: list[tuple[float, float, float]]) -> None:
    """Whatever happens, an event begins only where it did not last before, and the columns say the same."""
    memory, standards = mobility.begin(4), Standards.of(ROVER, 9.81, LIMITS)
    for slip, angle, clearance in looks:
        state = replace(rolling(slip=slip), tip_angle_rad=np.full(4, angle), belly_clearance_m=clearance)
        before = memory.active
        memory, events = mobility.watch(memory, state, standards, 0.3)
        for event in events:
            column = 4 if event.wheel is None else event.wheel
            row = mobility.KINDS.index(event.kind)
            assert memory.active[row, column]
            assert not before[row, column]
        assert np.count_nonzero(memory.active & ~before) == len(events)
        assert mobility.active_kinds(memory)[Kind.TIP_OVER] == bool(memory.active[mobility.TIP_OVER].any())
