from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rover_sim.outcome import Limits, Reason, Strain, advance_strain, verdict
from rover_sim.sim.mobility_events import Kind, MobilityEvent
from rover_sim.sim.recorder import TraceRecorder
from rover_sim.summary import EVENTS_LISTED, Counts, Identity, event_figures, summarize

CONTRACT_KEYS = [
    "scenario",
    "seed",
    "success",
    "reason",
    "sim_time_s",
    "wall_time_s",
    "real_time_factor",
    "distance_m",
    "straight_line_m",
    "path_inefficiency",
    "goal_distance_m",
    "collisions",
    "max_tilt_deg",
    "min_stability_margin",
    "mean_slip",
    "max_slip",
    "max_sinkage_m",
    "energy_J",
    "frames",
    "plans",
    "missions_sent",
    "waypoints_sent",
    "ttam",
    "version",
]


def _trace() -> TraceRecorder:
    """An L-shaped drive of 3 m east and 4 m north, four wheels, tilted 30 degrees at the end."""
    recorder = TraceRecorder()
    half = np.radians(15)
    for time_s, (x, y), roll in ((0.0, (0, 0), 0.0), (1.0, (3, 0), 0.0), (2.0, (3, 4), half)):
        recorder.add(
            time_s=time_s,
            position_w=(x, y, 0.0),
            estimate_position_w=(x + 0.3 * time_s, y - 0.4 * time_s, 0.1),
            estimate_covariance_m2=(0.04, 0.0, 0.0, 0.05),
            quaternion_w=(np.sin(roll), 0.0, 0.0, np.cos(roll)),
            wheel_speed=(0.0, 10.0, 10.0, 10.0),
            slip=(0.9, 0.1, 0.2, 0.3),
            sinkage=(0.01, 0.02, 0.0, 0.0),
            stability_margin=1.0 - time_s / 4,
            energy_J=time_s * 10,
        )
    return recorder


def _summary(reason: Reason = Reason.GOAL) -> dict[str, object]:
    identity = Identity("demo", 7, (0.0, 0.0), (3.0, 4.5), 0.1)
    return summarize(
        _trace().arrays(),
        identity,
        Counts(collisions=1),
        reason,
        wall_time_s=0.5,
        ttam=None,
        detail="",
        events=[],
        faults={"events": [], "responses": []},
    )


def test_the_summary_has_every_contract_key() -> None:
    assert set(CONTRACT_KEYS) <= _summary().keys()


def test_figures_of_a_drive_worked_by_hand() -> None:
    summary = _summary()
    assert summary["distance_m"] == 7.0
    assert summary["goal_distance_m"] == 0.5
    assert summary["path_inefficiency"] == pytest.approx(7 / np.hypot(3, 4.5) - 1, abs=1e-4)
    assert summary["max_tilt_deg"] == 30.0
    assert summary["mean_slip"] == 0.2  # the wheel at rest does not count
    assert summary["max_slip"] == 0.3
    assert summary["min_stability_margin"] == 0.5
    assert summary["real_time_factor"] == 4.0


def test_success_is_the_goal_and_nothing_else() -> None:
    assert _summary(Reason.GOAL)["success"] is True
    assert not any(_summary(reason)["success"] for reason in Reason if reason is not Reason.GOAL)


def test_a_trace_keeps_its_columns_and_its_bytes(tmp_path: Path) -> None:
    recorder = _trace()
    with pytest.raises(ValueError, match="energy_J"):
        recorder.add(time_s=3.0)
    recorder.save(tmp_path / "a.npz")
    recorder.save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    assert np.load(tmp_path / "a.npz")["slip"].shape == (3, 4)


def test_leaning_on_a_rock_is_a_collision_after_a_second_without_a_break() -> None:
    limits = Limits()
    strain = Strain()
    for touching in [True] * 8 + [False] + [True] * 9:
        strain = advance_strain(strain, touching=touching, digging=False, step_s=0.125)
        assert verdict(strain, limits, tilt_rad=0.0, impact_m_s=0.0) is (
            Reason.COLLISION if strain.pressing_s > 1.0 else None
        )
    assert strain.pressing_s == 1.125


def test_the_gravest_reason_comes_first() -> None:
    strain = Strain(pressing_s=5.0, digging_s=50.0)
    assert verdict(strain, Limits(), tilt_rad=1.2, impact_m_s=1.0) is Reason.TIPPED
    assert verdict(strain, Limits(), tilt_rad=0.2, impact_m_s=1.0) is Reason.COLLISION
    assert verdict(Strain(0.0, 50.0), Limits(), tilt_rad=0.2, impact_m_s=0.0) is Reason.EMBEDDED
    assert verdict(Strain(), Limits(), tilt_rad=0.2, impact_m_s=0.1) is None


def test_events_are_counted_all_and_listed_up_to_a_limit() -> None:
    slip = MobilityEvent(Kind.TRACTION_LOSS, 1.23456, (1.0, 2.0, 0.12345), 3)
    belly = MobilityEvent(Kind.HIGH_CENTRED, 2.0, (0.0, 0.0, 0.0), None)
    figures = event_figures([slip] * (EVENTS_LISTED + 5) + [belly])
    assert figures["event_counts"] == {
        **dict.fromkeys((kind.value for kind in Kind), 0),
        "traction_loss": EVENTS_LISTED + 5,
        "high_centred": 1,
    }
    assert len(figures["events"]) == EVENTS_LISTED
    place = {"time_s": 1.2346, "position_m": [1.0, 2.0, 0.123], "wheel": 3}
    assert figures["events"][0] == {"kind": "traction_loss", **place}


def test_the_summary_tells_how_far_the_believed_place_was_off() -> None:
    # 0.3 m and 0.4 m a second off, 2 s long; one sigma is the root of 0.04 + 0.05.
    summary = _summary()
    assert summary["place_error_m"] == pytest.approx(1.0)
    assert summary["max_place_error_m"] == pytest.approx(1.0)
    assert summary["place_sd_m"] == pytest.approx(0.3)
