"""Missions to foreign autopilots over links that lose a fifth of all frames: whole or not at all, never torn."""

from __future__ import annotations

import pytest

from rover_sim.mavlink.faults import Faults
from rover_sim.mavlink.foreign_rules import ARDUPILOT_RULES, PX4_RULES
from rover_sim.mavlink.mission_compare import first_difference
from rover_sim.mavlink.uploader import UploadState
from tests.ardupilot_mavlink_double import AUTO, ArduRoverDouble
from tests.foreign_rig import ForeignPair
from tests.px4_mavlink_double import MISSION, Px4RoverDouble

READY_S = 50.0
LIMIT_S = 240.0
LOSS = Faults(loss=0.2)
BAD = Faults(loss=0.2, delay_s=0.2, jitter_s=0.1, duplicate=0.05)


def driven(seed: int, faults: Faults) -> tuple[int, int]:
    """Two missions one after the other, the second while the first is driven; how many were begun and how many not."""
    pair = ForeignPair(faults=faults, seed=seed, start_s=READY_S)
    double = pair.double
    assert isinstance(double, ArduRoverDouble)
    begun = failed = 0
    for leg in range(2):
        items = pair.items(*((float(step), 20.0 + leg + seed % 7) for step in range(2 + seed % 8)), speed_m_s=0.6)
        count = len(double.driven)
        upload = pair.companion.drive(items, pair.time_s)
        end_s = pair.time_s + LIMIT_S
        while not (len(double.driven) > count and upload.state is UploadState.DONE):
            if pair.companion.trouble is not None:
                break
            assert pair.time_s < end_s, "neither begun nor given up"
            pair.step()
        assert not double.started_torn
        if pair.companion.trouble is not None:
            failed += 1
            assert pair.companion.trouble.text
            break
        pair.run(1.0)
        begun += 1
        assert first_difference(items, double.missions.items, ARDUPILOT_RULES) == ""
        assert double.driven[-1].x == items[2].x  # from its first place
    return begun, failed


@pytest.mark.parametrize("block", range(4))
def test_200_pairs_of_missions_to_an_ardupilot(block: int) -> None:
    counts = [driven(seed, LOSS) for seed in range(50 * block, 50 * block + 50)]
    assert sum(begun for begun, _ in counts) >= 95  # what is given up is given up in words


def test_a_start_that_was_never_answered_counts_as_a_start() -> None:
    driven(2227, LOSS)  # five acknowledgements lost, and the heartbeats that would have told of Auto


@pytest.mark.parametrize("seed", range(500, 530))
def test_with_delay_and_duplicates_too(seed: int) -> None:
    driven(seed, BAD)


@pytest.mark.parametrize("seed", range(600, 630))
def test_a_px4_takes_a_mission_whole(seed: int) -> None:
    pair = ForeignPair(Px4RoverDouble, BAD, seed, start_s=READY_S)
    double = pair.double
    assert isinstance(double, Px4RoverDouble)
    items = pair.items(*((float(step), 20.0) for step in range(2 + seed % 8)), speed_m_s=0.6)
    upload = pair.companion.drive(items, pair.time_s)
    pair.until(lambda: pair.companion.trouble is not None or (double.armed and double.custom_mode == MISSION), LIMIT_S)
    if pair.companion.trouble is None:
        assert upload.state is UploadState.DONE
        assert first_difference(items[1:], double.items, PX4_RULES) == ""


def test_the_same_seed_gives_the_same_drive() -> None:
    assert AUTO == 10
    first, second = (driven(7, BAD) for _ in range(2))
    assert first == second
