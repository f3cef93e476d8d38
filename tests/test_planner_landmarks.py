from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from planner import localization as loc
from planner import navigator
from planner.landmark_matching import MatchModel, Pairs, compatible
from planner.landmark_views import ViewModel
from planner.landmarks import LandmarkMap, LandmarkModel, _caught_up, watch
from planner.localization_kernels import FACTOR, LEAN_X, LEAN_Y, LEVEL_X, LEVEL_Y, STATES, YAW, X
from planner.lost import search
from planner.mobility import wheel_speeds
from planner.relocation import moved
from tests.planner_factory import FOOTPRINT
from worlds.geometry import rotation_from_quaternion, wrap_angle
from worlds.types import FloatArray, ImuReading, Observation, PerceivedRock, SensorReadings

G = 3.71
CAMERA_B = (0.3, 0.0, 0.9)
SENSORS = loc.model_without_satellites(G)
# The rover of `drive` has no lean and drifts nowhere: a filter that reckons with both is too modest.
STEADY = replace(SENSORS, lean_sd_rad=0.001, side_slip_sd=0.005)
PLAIN = ViewModel(
    azimuth_sd_rad=0.005, depression_sd_rad=0.005, outline_sd=0.0, distance_bias=(0.0, 0.0), depression_bias=(0.0, 0.0)
)
MODEL = LandmarkModel(view=PLAIN)
SHARE_SD = 0.02  # of a distance


def rock(place_w: FloatArray, eye_w: FloatArray, diameter_m: float = 0.3) -> PerceivedRock:
    """A rock seen at ``place_w`` (3,), its distance known to a share."""
    away = float(np.linalg.norm(place_w - eye_w))
    x, y, z = place_w.tolist()
    flat = float(np.hypot(*(place_w - eye_w)[:2]))
    return PerceivedRock((x, y, z), diameter_m, diameter_m, 0.15, 0.0, 0.9, 0, flat, SHARE_SD * away)


def picture(rocks: list[PerceivedRock], state: loc.LocalizationState | None = None) -> Observation:
    """Rocks on ground that was seen from 1.3 to 4.8 m ahead of the believed pose, or of the origin."""
    x, y, yaw = (0.0, 0.0, 0.0) if state is None else state.mean[[0, 1, YAW]].tolist()
    away, angle = np.array([1.3, 4.8, 4.8, 1.3]), yaw + np.array([-0.6, -0.6, 0.6, 0.6])
    outline = np.column_stack([x + away * np.cos(angle), y + away * np.sin(angle)])
    return Observation(0.0, tuple(rocks), np.zeros((0, 0), dtype=np.str_), np.zeros((0, 0, 2)), outline)


def still(heading_rad: float = 0.0, time_s: float = 0.0) -> SensorReadings:
    imu = ImuReading((0.0, 0.0, G), (0.0, 0.0, 0.0), heading_rad)
    return SensorReadings(time_s, imu, (0.0,) * 4)


def known_pose(x_variance: float = 0.0) -> loc.LocalizationState:
    """At the origin, sure of all but how far along x."""
    state = loc.start(still(), (0.0, 0.0, 0.0), model=SENSORS, attitude=((0.0, 0.0, 0.0), 0.0))
    covariance = np.zeros((STATES, STATES))
    covariance[X, X] = x_variance
    return replace(state, covariance=covariance)


def level_rock(distance_m: float, aside_m: float = 0.0, diameter_m: float = 0.3) -> PerceivedRock:
    """A rock at the height of the camera of a rover at the origin, so that only its distance tells of x."""
    eye = np.array(CAMERA_B)
    return rock(eye + np.array([distance_m, aside_m, 0.0]), eye, diameter_m)


def sure_map(*rocks: PerceivedRock) -> LandmarkMap:
    """Landmarks known without error, often seen."""
    count = len(rocks)
    return LandmarkMap(
        np.array([seen.position_w for seen in rocks]).reshape(count, 3),
        np.zeros((STATES, 3 * count)),
        np.zeros((3 * count, 3 * count)),
        np.log([seen.length_m for seen in rocks]),
        np.full(count, 5.0),
        np.zeros(count),
        by_scale=np.zeros(3 * count),
    )


def test_a_known_landmark_pulls_the_place_by_the_kalman_gain() -> None:
    # One number: 0.04 m2 of x, seen 0.1 m nearer than the 4 m expected, one sigma 2 %.
    state = known_pose(0.04)
    watched = watch(state, sure_map(level_rock(4.0)), picture([level_rock(3.9)]), loc.estimate(state), CAMERA_B, MODEL)
    slope = -1.0 / 4.0
    gain = 0.04 * slope / (slope * 0.04 * slope + SHARE_SD**2)
    assert watched.matched == 1
    assert watched.state.mean[X] == pytest.approx(gain * np.log(3.9 / 4.0), rel=1e-6)
    assert watched.state.covariance[X, X] == pytest.approx(0.04 * (1.0 - gain * slope), rel=1e-6)


def test_a_landmark_seen_twice_tells_how_far_the_rover_went() -> None:
    state = known_pose()
    first = watch(state, LandmarkMap(), picture([level_rock(4.0)]), loc.estimate(state), CAMERA_B, MODEL)
    assert len(first.landmarks) == 1
    # Believed to have gone 0.5 m, give or take 0.1 m; the rock then stands 3.4 m ahead instead of 3.5.
    went = first.state.mean.copy()
    went[X] += 0.5
    covariance = first.state.covariance.copy()
    covariance[X, X] += 0.01
    state = replace(first.state, mean=went, covariance=covariance)
    on = np.array([0.5, 0.0, 0.0])
    seen = picture([rock(np.array(level_rock(3.4).position_w) + on, np.array(CAMERA_B) + on)])
    second = watch(state, first.landmarks, seen, loc.estimate(state), CAMERA_B, MODEL)
    of_landmark, of_view = (4.0 * SHARE_SD) ** 2, (3.5 * SHARE_SD) ** 2
    gain = 0.01 / (0.01 + of_landmark + of_view)
    assert second.state.mean[X] - 0.5 == pytest.approx(-gain * 3.5 * np.log(3.4 / 3.5), rel=1e-3)
    assert second.state.covariance[X, X] == pytest.approx(0.01 * (1.0 - gain), rel=1e-3)


def test_seeing_a_landmark_again_from_one_place_tells_nothing_of_the_place() -> None:
    state = known_pose(0.04)
    first = watch(state, LandmarkMap(), picture([level_rock(4.0)]), loc.estimate(state), CAMERA_B, MODEL)
    second = watch(first.state, first.landmarks, picture([level_rock(4.05)]), loc.estimate(state), CAMERA_B, MODEL)
    assert second.matched == 1
    assert second.state.mean[X] == pytest.approx(0.0, abs=1e-9)
    assert second.state.covariance[X, X] == pytest.approx(0.04, rel=1e-9)
    assert second.landmarks.covariance[0, 0] - 0.04 == pytest.approx((4.0 * SHARE_SD) ** 2 / 2.0, rel=1e-2)


def test_rocks_tell_what_a_biased_accelerometer_makes_of_the_attitude() -> None:
    # It feels 0.05 of 3.71 m/s2 too much ahead: the nose is believed 13.5 mrad too high, and rocks seem to sink.
    reading = still()
    assert reading.imu is not None
    biased = replace(reading, imu=replace(reading.imu, acceleration_b=(0.05, 0.0, G)))
    state = loc.start(biased, (0.0, 0.0, 0.0), model=SENSORS, attitude=((0.0, 0.0, 0.0), 0.002))
    places = [level_rock(2.0).position_w, level_rock(3.0, 0.8).position_w, level_rock(4.0, -0.9).position_w]
    known = LandmarkMap()
    for tick in range(1, 48 * 30):
        state = loc.localize(state, replace(biased, time_s=tick / 48.0), FOOTPRINT, SENSORS)
        if tick % 24 == 1:
            believed = loc.estimate(state)
            turned = rotation_from_quaternion(believed.pose.quaternion_w)
            eye = believed.pose.position_w + turned @ CAMERA_B
            seen = [rock(eye + turned @ (np.array(place) - CAMERA_B), eye) for place in places]
            watched = watch(state, known, picture(seen, state), believed, CAMERA_B, MODEL)
            state, known = watched.state, watched.landmarks
    assert state.pitch_rad == pytest.approx(-0.05 / G, rel=0.02)
    # Of this a part might as well be the rover sinking.
    assert state.mean[LEAN_Y] == pytest.approx(0.05 / G, rel=0.25)
    assert state.mean[LEVEL_Y] == pytest.approx(0.05 / G, rel=0.35)
    assert state.mean[[LEAN_X, LEVEL_X]] == pytest.approx([0.0, 0.0], abs=0.003)


def test_a_rover_whose_nose_is_lower_than_believed_drives_down() -> None:
    state = known_pose()
    mean = state.mean.copy()
    mean[[LEAN_Y, LEVEL_Y]], mean[FACTOR] = 0.02, SENSORS.usual_factor
    state = replace(state, mean=mean)
    for tick in range(1, 97):
        state = loc.localize(
            state,
            replace(still(time_s=tick / 48.0), wheel_speed_rad_s=wheel_speeds(0.5, 0.0, FOOTPRINT)),
            FOOTPRINT,
            SENSORS,
        )
    way = 2.0 * 0.5 * SENSORS.usual_factor
    assert state.mean[:3] == pytest.approx([way, 0.0, -0.02 * way], abs=1e-6)


def test_what_cannot_be_the_landmark_is_not_taken_for_it() -> None:
    state = known_pose(0.0004)
    small, aside = level_rock(4.0, diameter_m=0.09), level_rock(4.0, aside_m=0.6)
    for wrong in (small, aside):
        watched = watch(state, sure_map(level_rock(4.0)), picture([wrong]), loc.estimate(state), CAMERA_B, MODEL)
        assert watched.matched == 0
        assert watched.state.mean[X] == 0.0


def test_of_two_landmarks_that_a_rock_could_be_neither_is_taken() -> None:
    state = known_pose(0.0004)
    twins = sure_map(level_rock(4.0, aside_m=0.02), level_rock(4.0, aside_m=-0.02))
    watched = watch(state, twins, picture([level_rock(4.0)]), loc.estimate(state), CAMERA_B, MODEL)
    assert watched.matched == 0
    assert len(watched.landmarks) == 2


def test_pairs_must_be_compatible_all_together() -> None:
    # One unknown shift of all, one sigma 1; each alone could be off by it, but the fourth goes against the others.
    innovation = np.array([[1.0], [1.1], [0.9], [-1.0]])
    spread = np.ones((4, 4)) + 0.01 * np.eye(4)
    pairs = Pairs(np.arange(4), np.arange(4), innovation, spread, np.zeros(4))
    assert sorted(compatible(pairs, MatchModel()).tolist()) == [0, 1, 2]


def test_the_map_may_be_caught_up_at_every_reading_or_once() -> None:
    state = known_pose(0.04)
    state = replace(state, covariance=state.covariance + 1e-4 * np.eye(STATES))
    seen = picture([level_rock(4.0), level_rock(3.0, aside_m=1.0)])
    watched = watch(state, LandmarkMap(), seen, loc.estimate(state), CAMERA_B, MODEL)
    once, often = watched.state, watched.state
    stepwise = watched.landmarks
    for tick in range(1, 30):
        imu = ImuReading((0.0, 0.0, G), (0.0, 0.0, 0.1), 0.002 * tick + 0.01)
        reading = SensorReadings(tick / 48.0, imu, wheel_speeds(0.5, 0.1, FOOTPRINT))
        once = loc.localize(once, reading, FOOTPRINT, SENSORS)
        often = loc.localize(often, reading, FOOTPRINT, SENSORS)
        stepwise = _caught_up(stepwise, often)
        often = replace(often, carried=loc.nothing_carried(), by_scale=often.carried.passed @ often.by_scale)
    whole = _caught_up(watched.landmarks, once)
    for name in ("place_w", "cross", "covariance", "by_scale"):
        np.testing.assert_allclose(getattr(whole, name), getattr(stepwise, name), atol=1e-12)
    assert np.linalg.norm(whole.place_w - watched.landmarks.place_w) > 1e-6  # the compass moved the map
    joint = np.block([[once.covariance, whole.cross], [whole.cross.T, whole.covariance]])
    assert np.linalg.eigvalsh(joint).min() > -1e-9


def drive(
    seed: int, seconds: float = 25.0, turning: float | None = None
) -> tuple[loc.LocalizationState, FloatArray, LandmarkMap]:
    """Along rocks strewn on level ground, 20 % slower than the wheels turn: belief, true place (2,) and map.

    ``turning``: a steady yaw rate in the stead of a slow S.
    """
    rng = np.random.default_rng(seed)
    rocks = np.column_stack([rng.uniform(-8, 20, 360), rng.uniform(-8, 8, 360), np.full(360, -0.16)])
    size = np.exp(rng.normal(np.log(0.25), 0.4, 360))
    heading = float(rng.normal(0.0, 0.002))
    state = loc.start(still(), (*rng.normal(0.0, 0.02, 2), 0.0), 0.02, STEADY, ((0.0, 0.0, heading), 0.002))
    compass, known, true = rng.normal(0.0, 0.009), LandmarkMap(), np.zeros(3)
    for tick in range(1, int(48 * seconds)):
        motion = 0.4, 0.15 * np.sin(tick / 150.0) if turning is None else turning
        true = true + np.array([motion[0] * np.cos(true[2]), motion[0] * np.sin(true[2]), motion[1]]) / 48.0
        rate, force = rng.normal(0, 0.002, 3), rng.normal(0, 0.03, 3)
        imu = ImuReading(
            (force[0], force[1] + motion[0] * motion[1], G + force[2]),
            (rate[0], rate[1], rate[2] + motion[1]),
            wrap_angle(true[2] + compass + rng.normal(0, 0.012)),
        )
        reading = SensorReadings(tick / 48.0, imu, wheel_speeds(motion[0] / 0.8, motion[1], FOOTPRINT))
        state = loc.localize(state, reading, FOOTPRINT, STEADY)
        if tick % 24 == 0:
            believed = loc.estimate(state)
            seen = picture(seen_rocks(rocks, size, true, state, rng), state)
            watched = watch(state, known, seen, believed, CAMERA_B, MODEL)
            state, known = watched.state, watched.landmarks
    return state, true[:2], known


def seen_rocks(
    rocks: FloatArray, size: FloatArray, true: FloatArray, state: loc.LocalizationState, rng: np.random.Generator
) -> list[PerceivedRock]:
    """Rocks ahead of the true pose (3,), with the errors that the model states, where the believed pose puts them."""
    cos, sin = np.cos(true[2]), np.sin(true[2])
    off = rocks - np.array([true[0], true[1], 0.0])
    level = np.column_stack([cos * off[:, 0] + sin * off[:, 1], cos * off[:, 1] - sin * off[:, 0], off[:, 2]])
    level -= CAMERA_B
    flat = np.hypot(level[:, 0], level[:, 1])
    azimuth = np.arctan2(level[:, 1], level[:, 0])
    shown = np.flatnonzero((flat < 4.5) & (flat > 1.0) & (np.abs(azimuth) < 0.6) & (rng.uniform(size=len(flat)) < 0.9))
    yaw, found = float(state.mean[YAW]), []
    eye = state.mean[:3] + np.array([0.3 * np.cos(yaw), 0.3 * np.sin(yaw), 0.9])
    for k in shown:
        away = float(np.linalg.norm(level[k])) * float(np.exp(rng.normal(0, SHARE_SD)))
        turned = azimuth[k] + rng.normal(0, 0.005) + yaw
        down = np.arctan2(-level[k, 2], flat[k]) + rng.normal(0, 0.005)
        toward = np.array([np.cos(down) * np.cos(turned), np.cos(down) * np.sin(turned), -np.sin(down)])
        found.append(rock(eye + away * toward, eye, float(size[k] * np.exp(rng.normal(0, 0.1)))))
    return found


def test_the_claimed_error_is_the_true_one_over_many_drives() -> None:
    nees, errors = [], []
    for seed in range(10):
        state, true, _ = drive(seed)
        off = state.mean[:2] - true
        nees.append(float(off @ np.linalg.solve(state.covariance[:2, :2], off)))
        errors.append(float(np.hypot(*off)))
    low, high = chi2.ppf([0.005, 0.995], 2 * len(nees)) / len(nees)
    assert low < np.mean(nees) < high
    assert max(errors) < 0.15  # of 10 m; dead reckoning is off by more than a metre


def test_a_closed_loop_undoes_the_drift_of_its_way() -> None:
    # A circle of 2.2 m radius, 14 m round: before its end the first landmarks come into view again.
    before, after = (drive(3, seconds, turning=0.18)[0] for seconds in (33.0, 40.0))
    sd_before, sd_after = (float(np.sqrt(np.trace(state.covariance[:2, :2]))) for state in (before, after))
    assert sd_after < 0.9 * sd_before


def test_a_rover_that_meets_another_world_says_that_it_is_lost() -> None:
    state, _, known = drive(1, seconds=14.0)
    rng = np.random.default_rng(99)
    strange = np.column_stack([rng.uniform(-2, 20, 220), rng.uniform(-5, 5, 220), np.full(220, -0.16)])
    size, pose = np.full(220, 0.6), np.array([*state.mean[:2], state.mean[YAW]])
    told = []
    for _ in range(6):
        seen = picture(seen_rocks(strange, size, pose, state, rng), state)
        watched = watch(state, known, seen, loc.estimate(state), CAMERA_B, MODEL)
        state, known = watched.state, watched.landmarks
        told.append(watched.lost)
    assert told[0] == ""
    assert "landmarks met" in told[-1]


def test_places_move_with_the_pose_they_were_seen_from() -> None:
    before = loc.estimate(known_pose())
    turned = loc.start(still(), (1.0, 2.0, 0.5), model=SENSORS, attitude=((0.0, 0.0, np.pi / 2), 0.0))
    seen = replace(picture([level_rock(3.7)]), class_centre_w=np.array([[[4.0, 1.0]]]))
    after = moved(seen, before, loc.estimate(turned))
    # 4 m ahead of the origin becomes 4 m north of (1, 2); 1 m to the left becomes 1 m to the west.
    assert after.rocks[0].position_w == pytest.approx((1.0, 6.0, 1.4))
    np.testing.assert_allclose(after.class_centre_w[0, 0], [0.0, 6.0], atol=1e-12)


def test_a_lost_rover_looks_all_around_and_then_gives_up() -> None:
    plan = navigator.begin((20.0, 0.0), 0.5, FOOTPRINT, (0.0, 0.0))
    looking, headings, heading = None, [], 0.0
    for look in range(200):
        at = loc.start(still(), (0.0, 0.0, 0.0), model=SENSORS, attitude=((0.0, 0.0, heading), 0.0))
        looking = search(looking, "1 of 6 landmarks met", plan, loc.estimate(at), 0.5 * look)
        if looking.decision.kind == "lost":
            break
        heading = looking.heading_rad  # it turns there at once
        headings.append(heading)
    assert looking is not None
    assert looking.decision.kind == "lost"
    assert "1 of 6 landmarks met" in looking.decision.reason
    assert len({round(np.degrees(each)) % 360 for each in headings}) == 6  # every 60 degrees
