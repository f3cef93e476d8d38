"""Read back equal within what each autopilot changes, and nothing beyond that."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_sim.mavlink.foreign_rules import ARDUPILOT_RULES, GENERIC_RULES, PX4_RULES, AutopilotRules
from rover_sim.mavlink.mission_compare import first_difference
from rover_sim.mavlink.wire import WAYPOINT, WireItem
from tests.ardupilot_mission_double import _as_stored

HOME = WireItem(0, WAYPOINT, (0.0,) * 4, 10, 20, 5.0)
PLACE = WireItem(3, WAYPOINT, (2.0, 0.5, 0.0, math.nan), 473_977_000, 85_456_000, 1.25)
SPEED = WireItem(2, 178, (1.0, 0.57, -1.0, 0.0), 0, 0, 0.0)

numbers = st.floats(-1e3, 1e3, width=32)
places = st.builds(
    WireItem,
    st.sampled_from([0, 3, 5, 6]),
    st.just(WAYPOINT),
    st.tuples(st.floats(0.0, 1e3, width=32), numbers, numbers, numbers),
    st.integers(-900_000_000, 900_000_000),
    st.integers(-1_800_000_000, 1_800_000_000),
    numbers,
)


@given(st.lists(places, min_size=1, max_size=8), st.data())
def test_what_an_ardupilot_makes_of_a_mission_is_the_same_mission_and_a_moved_place_is_not(
    sent: list[WireItem], data: st.DataObject
) -> None:
    mission = [HOME, *(replace(item, params=(item.params[0], *item.params[1:2], 0.0, item.params[3])) for item in sent)]
    stored = [replace(HOME, x=99), *map(_as_stored, mission[1:])]
    assert first_difference(mission, stored, ARDUPILOT_RULES) == ""
    seq = data.draw(st.integers(1, len(stored) - 1))
    stored[seq] = replace(stored[seq], y=stored[seq].y + 1)
    assert first_difference(mission, stored, ARDUPILOT_RULES).startswith(f"item {seq}: place")


@pytest.mark.parametrize(
    ("rules", "read", "says"),
    [
        (PX4_RULES, PLACE, ""),
        (PX4_RULES, replace(PLACE, frame=6, params=(2.0, 0.5, 0.0, 0.0)), ""),  # NaN is "not given"
        (PX4_RULES, replace(PLACE, params=(2.0, 0.0, 0.0, 0.0)), "item 0: parameter 2 is 0 instead of 0.5"),
        (PX4_RULES, replace(PLACE, frame=0), "item 0: frame 0 instead of 3"),
        (PX4_RULES, replace(PLACE, z=1.3), "item 0: altitude 1.3 instead of 1.25"),
        (PX4_RULES, replace(PLACE, command=21), "item 0: command 21 instead of 16"),
        (GENERIC_RULES, replace(PLACE, x=PLACE.x + 1), "item 0: place (473977001, 85456000)"),
    ],
)
def test_each_difference_is_named(rules: AutopilotRules, read: WireItem, says: str) -> None:
    assert first_difference([PLACE], [read], rules).startswith(says)
    assert bool(first_difference([PLACE], [read], rules)) is bool(says)


def test_items_without_a_place_are_compared_by_their_numbers() -> None:
    assert first_difference([HOME, SPEED], [HOME, replace(SPEED, frame=0)], ARDUPILOT_RULES) == ""
    changed = replace(SPEED, params=(1.0, 0.6, -1.0, 0.0))
    assert first_difference([HOME, SPEED], [HOME, changed], ARDUPILOT_RULES) == (
        "item 1: parameter 2 is 0.6 instead of 0.57"
    )
    assert first_difference([HOME, SPEED], [HOME], ARDUPILOT_RULES) == "1 items instead of 2"


def test_jumps_count_one_less_where_home_is_no_item() -> None:
    jump = WireItem(2, 177, (1.0, 3.0, 0.0, 0.0), 0, 0, 0.0)
    assert ARDUPILOT_RULES.wire_items([HOME, PLACE, jump])[2].params[0] == 1.0
    assert PX4_RULES.wire_items([HOME, PLACE, jump])[1].params == (0.0, 3.0, 0.0, 0.0)
