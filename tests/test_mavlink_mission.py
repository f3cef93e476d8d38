"""The mission protocol's hard cases, one test each."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest

from rover_sim.autopilot.mission import DriveTo, Jump, SetFence, SetHome, Wait
from rover_sim.autopilot.modes import MissionState, Mode
from rover_sim.mavlink.dialect import Message, mavlink
from rover_sim.mavlink.geodesy import LocalFrame
from rover_sim.mavlink.mission_store import CAPACITY
from rover_sim.mavlink.plan_items import mission_items
from rover_sim.mavlink.wire import WireItem, typed_item
from tests.mavlink_rig import Station, Yard
from worlds.scenario import Origin

FRAME = LocalFrame(Origin())
PLACES = [(3.0, 0.0, 0.0), (3.0, 2.0, 0.0)]
ITEMS = mission_items(PLACES, FRAME, (0.0, 0.0, 0.0))
OTHER = mission_items([(9.0, 9.0, 0.0)], FRAME, (0.0, 0.0, 0.0))
ACCEPTED, DENIED, NO_SPACE, UNSUPPORTED, CANCELLED = 0, 14, 4, 3, 15


def count(number: int, kind: int = 0, system: int = 1, component: int = 1) -> Message:
    return mavlink.MAVLink_mission_count_message(system, component, number, kind)


def put(seq: int, item: WireItem | None = None, kind: int = 0) -> Message:
    return (item or ITEMS[seq]).message(1, 1, seq, kind)


def asked(messages: list[Message]) -> list[int]:
    return [message.seq for message in messages if message.get_type() == "MISSION_REQUEST_INT"]


def results(messages: list[Message]) -> list[int]:
    return [message.type for message in messages if message.get_type() == "MISSION_ACK"]


def talk(yard: Yard, station: Station, message: Message) -> tuple[list[int], list[int]]:
    """The items that the vehicle asks for and the results that it gives, to one message."""
    back = yard.ask(station, message, "MISSION_REQUEST_INT", "MISSION_ACK")
    return asked(back), results(back)


def upload(yard: Yard, station: Station, items: Sequence[WireItem], kind: int = 0) -> list[int]:
    """A whole upload; the results."""
    wanted, got = talk(yard, station, count(len(items), kind))
    while wanted and not got:
        wanted, got = talk(yard, station, put(wanted[-1], items[wanted[-1]], kind))
    return got


def download(yard: Yard, station: Station, kind: int = 0) -> list[WireItem]:
    (total,) = yard.ask(station, mavlink.MAVLink_mission_request_list_message(1, 1, kind), "MISSION_COUNT")
    assert total.mission_type == kind
    items = []
    for seq in range(total.count):
        request = mavlink.MAVLink_mission_request_int_message(1, 1, seq, kind)
        (item,) = yard.ask(station, request, "MISSION_ITEM_INT")
        assert (item.seq, item.mission_type) == (seq, kind)
        items.append(WireItem.of(item))
    return items


@pytest.fixture
def station() -> Station:
    return Station()


@pytest.fixture
def other() -> Station:
    return Station(255, 230)  # the same system number as the first, as MAVProxy beside QGroundControl


@pytest.fixture
def yard(station: Station, other: Station) -> Yard:
    return Yard(station, other)


def test_normal_upload_and_download(yard: Yard, station: Station, other: Station) -> None:
    assert upload(yard, station, ITEMS) == [ACCEPTED]
    for reader in (station, other):
        back = download(yard, reader)
        assert [(item.command, item.frame, item.x, item.y) for item in back] == [
            (item.command, item.frame, item.x, item.y) for item in ITEMS
        ]
    assert yard.autopilot.auto.state is MissionState.NOT_STARTED
    assert yard.autopilot.auto.current == 1  # home is item 0


def test_silence_after_the_count_is_asked_again_every_half_second_and_ends_after_8_s(
    yard: Yard, station: Station
) -> None:
    assert talk(yard, station, count(3)) == ([0], [])
    yard.step(3.0)
    assert asked(station.take("MISSION_REQUEST_INT")) == [0] * 5
    yard.step(6.0)
    assert results(station.take("MISSION_ACK")) == [CANCELLED]
    assert "Mission upload timeout" in [message.text for message in station.take("STATUSTEXT")]
    yard.step(2.0)
    assert asked(station.take("MISSION_REQUEST_INT"))[-1:] == [0]
    yard.step(2.0)
    assert station.take("MISSION_REQUEST_INT") == []


def test_count_again_from_the_same_station_restarts(yard: Yard, station: Station) -> None:
    talk(yard, station, count(3))
    assert talk(yard, station, put(0)) == ([1], [])
    assert talk(yard, station, count(2)) == ([0], [])


def test_count_from_a_second_station_is_denied(yard: Yard, station: Station, other: Station) -> None:
    talk(yard, station, count(3))
    assert talk(yard, other, count(2)) == ([], [DENIED])
    assert talk(yard, station, put(0)) == ([1], [])


def test_two_programs_behind_one_address_are_told_apart(yard: Yard, station: Station) -> None:
    talk(yard, station, count(3))
    station.packer = type(station.packer)(255, 230)
    assert talk(yard, station, count(2)) == ([], [DENIED])


def test_an_item_too_early_is_dropped_and_the_missing_one_asked_again(yard: Yard, station: Station) -> None:
    talk(yard, station, count(3))
    assert talk(yard, station, put(2)) == ([0], [])


def test_a_repeated_item_is_ignored(yard: Yard, station: Station) -> None:
    talk(yard, station, count(3))
    talk(yard, station, put(0))
    assert talk(yard, station, put(0)) == ([], [])
    assert talk(yard, station, put(1)) == ([2], [])


def test_the_last_item_repeated_after_the_end_gets_its_result_again(yard: Yard, station: Station) -> None:
    upload(yard, station, ITEMS)
    assert talk(yard, station, put(2)) == ([], [ACCEPTED])
    assert talk(yard, station, put(0)) == ([], [])


def test_an_item_from_a_stranger_is_denied(yard: Yard, station: Station, other: Station) -> None:
    talk(yard, station, count(3))
    assert talk(yard, other, put(0)) == ([], [DENIED])
    assert talk(yard, station, put(0)) == ([1], [])


def test_an_item_without_an_upload_is_an_error(yard: Yard, station: Station) -> None:
    assert talk(yard, station, put(0)) == ([], [1])


def test_download_during_an_upload_is_denied(yard: Yard, station: Station, other: Station) -> None:
    talk(yard, station, count(3))
    back = yard.ask(other, mavlink.MAVLink_mission_request_list_message(1, 1), "MISSION_COUNT", "MISSION_ACK")
    assert results(back) == [DENIED]


def test_a_cancelled_upload_leaves_the_old_mission(yard: Yard, station: Station) -> None:
    upload(yard, station, ITEMS)
    talk(yard, station, count(2))
    talk(yard, station, put(0, OTHER[0]))
    assert talk(yard, station, mavlink.MAVLink_mission_ack_message(1, 1, CANCELLED)) == ([], [])
    assert talk(yard, station, put(1, OTHER[1])) == ([], [CANCELLED])
    assert [item.x for item in download(yard, station)] == [item.x for item in ITEMS]


@pytest.mark.parametrize(
    ("item", "result"),
    [
        (WireItem(3, 9999, (0, 0, 0, 0), 0, 0, 0.0), UNSUPPORTED),
        (WireItem(1, 16, (0, 0, 0, 0), 384064000, -1107919000, 0.0), 2),
        (WireItem(3, 16, (0, 0, 0, 0), 2_000_000_000, 0, 0.0), 10),
        (WireItem(3, 16, (0, 0, 0, 0), 384064000, 2_000_000_000, 0.0), 11),
        (WireItem(3, 16, (0, 0, 0, 0), -384064000, 0, 0.0), 5),  # another continent
        (WireItem(3, 16, (-1.0, 0, 0, 0), 384064000, -1107919000, 0.0), 6),
        (WireItem(3, 16, (0, math.inf, 0, 0), 384064000, -1107919000, 0.0), 7),
        (WireItem(2, 178, (1.0, -1.0, 0, 0), 0, 0, 0.0), 7),
        (WireItem(2, 115, (math.inf, 0, 0, 0), 0, 0, 0.0), 6),
        (WireItem(2, 93, (-1.0, 12, 0, 0), 0, 0, 0.0), 6),  # a time of day
        (WireItem(2, 177, (0.0, 1, 0, 0), 0, 0, 0.0), 6),  # jumps: to home, beyond the end, to itself, no number
        (WireItem(2, 177, (3.0, 1, 0, 0), 0, 0, 0.0), 6),
        (WireItem(2, 177, (2.0, 1, 0, 0), 0, 0, 0.0), 6),
        (WireItem(2, 177, (1.5, 1, 0, 0), 0, 0, 0.0), 6),
        (WireItem(2, 177, (1.0, -2, 0, 0), 0, 0, 0.0), 7),
        (WireItem(2, 207, (2.0, 0, 0, 0), 0, 0, 0.0), 6),
    ],
)
def test_a_bad_item_ends_the_upload_with_its_own_code(
    yard: Yard, station: Station, item: WireItem, result: int
) -> None:
    upload(yard, station, ITEMS)
    assert upload(yard, station, [ITEMS[0], ITEMS[1], item]) == [result]
    assert len(download(yard, station)) == 3
    assert [entry.x for entry in download(yard, station)] == [entry.x for entry in ITEMS]


def test_nan_parameters_of_a_waypoint_mean_not_given(yard: Yard, station: Station) -> None:
    nothing = WireItem(6, 16, (math.nan,) * 4, 384064100, -1107919000, math.nan)
    assert upload(yard, station, [ITEMS[0], nothing]) == [ACCEPTED]
    assert math.isnan(download(yard, station)[1].params[3])


def test_too_many_items_are_refused_at_the_count(yard: Yard, station: Station) -> None:
    assert talk(yard, station, count(60000)) == ([], [NO_SPACE])
    assert talk(yard, station, count(CAPACITY)) == ([0], [])


def test_unknown_and_foreign_mission_types(yard: Yard, station: Station) -> None:
    assert talk(yard, station, count(2, kind=77)) == ([], [UNSUPPORTED])
    for kind in (1, 2):
        request = mavlink.MAVLink_mission_request_list_message(1, 1, kind)
        (answer,) = yard.ask(station, request, "MISSION_COUNT")
        assert (answer.count, answer.mission_type) == (0, kind)
    for kind in (77, 255):
        request = mavlink.MAVLink_mission_request_list_message(1, 1, kind)
        (answer,) = yard.ask(station, request, "MISSION_ACK")
        assert (answer.type, answer.mission_type) == (UNSUPPORTED, kind)


@pytest.mark.parametrize("kind", [0, 255])
def test_clear_all(yard: Yard, station: Station, kind: int) -> None:
    upload(yard, station, ITEMS)
    (answer,) = yard.ask(station, mavlink.MAVLink_mission_clear_all_message(1, 1, kind), "MISSION_ACK")
    assert (answer.type, answer.mission_type) == (ACCEPTED, kind)
    assert download(yard, station) == []
    assert yard.autopilot.auto.state is MissionState.NO_MISSION


def test_clearing_while_another_uploads_is_denied(yard: Yard, station: Station, other: Station) -> None:
    talk(yard, station, count(3))
    assert talk(yard, other, mavlink.MAVLink_mission_clear_all_message(1, 1)) == ([], [DENIED])


def test_an_upload_of_no_items_clears(yard: Yard, station: Station) -> None:
    upload(yard, station, ITEMS)
    assert upload(yard, station, []) == [ACCEPTED]
    assert download(yard, station) == []


def test_a_lone_empty_home_clears_as_mavsdk_means_it(yard: Yard, station: Station) -> None:
    upload(yard, station, ITEMS)
    assert upload(yard, station, [WireItem(3, 16, (0, 0, 0, 0), 0, 0, 0.0)]) == [ACCEPTED]
    assert download(yard, station) == []


def test_requests_beyond_the_end_and_of_an_empty_missions_home(yard: Yard, station: Station) -> None:
    beyond = mavlink.MAVLink_mission_request_int_message(1, 1, 1)
    assert talk(yard, station, beyond) == ([], [13])
    (home,) = yard.ask(station, mavlink.MAVLink_mission_request_int_message(1, 1, 0), "MISSION_ITEM_INT")
    assert (home.x, home.y, home.frame) == (384064000, -1107919000, 0)


def test_the_older_float_request_is_answered_with_an_integer_item(yard: Yard, station: Station) -> None:
    upload(yard, station, ITEMS)
    (item,) = yard.ask(station, mavlink.MAVLink_mission_request_message(1, 1, 1), "MISSION_ITEM_INT")
    assert item.x == ITEMS[1].x


def test_older_float_items_are_taken(yard: Yard, station: Station) -> None:
    talk(yard, station, count(1))
    old = mavlink.MAVLink_mission_item_message(1, 1, 0, 3, 16, 0, 1, 0, 0, 0, 0, 38.40641, -110.7919, 0.0)
    assert talk(yard, station, old) == ([], [ACCEPTED])
    bad = mavlink.MAVLink_mission_item_message(1, 1, 0, 3, 16, 0, 1, 0, 0, 0, 0, math.nan, -110.7919, 0.0)
    assert talk(yard, station, bad) == ([], [10])


def test_partial_lists_are_refused(yard: Yard, station: Station) -> None:
    assert talk(yard, station, mavlink.MAVLink_mission_write_partial_list_message(1, 1, 1, 1)) == ([], [UNSUPPORTED])
    assert talk(yard, station, mavlink.MAVLink_mission_request_partial_list_message(1, 1, 0, 1)) == ([], [UNSUPPORTED])


def test_set_current_tells_everyone_or_says_why_not(yard: Yard, station: Station, other: Station) -> None:
    upload(yard, station, ITEMS)
    yard.step()
    other.take("MISSION_CURRENT")
    yard.ask(station, mavlink.MAVLink_mission_set_current_message(1, 1, 2))
    assert other.take("MISSION_CURRENT")[0].seq == 2
    (text,) = yard.ask(station, mavlink.MAVLink_mission_set_current_message(1, 1, 500), "STATUSTEXT")
    assert text.text == "No mission item 500"


def test_messages_to_another_system_are_ignored_and_to_everyone_taken(yard: Yard, station: Station) -> None:
    assert talk(yard, station, count(3, system=77)) == ([], [])
    assert talk(yard, station, count(3, component=77)) == ([], [])
    assert talk(yard, station, count(3, system=0, component=0)) == ([0], [])


def test_a_mission_without_home_is_driven_from_its_first_item(yard: Yard, station: Station) -> None:
    """MAVSDK sends no home: item 0 is then in the relative frame."""
    assert upload(yard, station, ITEMS[1:]) == [ACCEPTED]
    assert yard.autopilot.auto.current == 0
    assert len(download(yard, station)) == 2


def test_the_item_marked_as_current_is_where_it_begins(yard: Yard, station: Station) -> None:
    marked = [ITEMS[0], ITEMS[1], WireItem(3, 16, (0, 0, 0, 0), ITEMS[2].x, ITEMS[2].y, 0.0, current=1)]
    talk(yard, station, count(3))
    for seq, item in enumerate(marked):
        message = item.message(1, 1, seq)
        message.current = item.current
        talk(yard, station, message)
    assert yard.autopilot.auto.current == 2


def test_an_item_with_current_2_is_a_guided_target_and_3_is_only_acknowledged(yard: Yard, station: Station) -> None:
    goto = put(0, ITEMS[1])
    goto.current = 2
    assert talk(yard, station, goto) == ([], [ACCEPTED])
    assert yard.autopilot.mode is Mode.GUIDED
    goto.current = 3
    assert talk(yard, station, goto) == ([], [ACCEPTED])
    assert download(yard, station) == []


def test_progress_is_told_once_and_states_are_honest(yard: Yard, station: Station) -> None:
    upload(yard, station, ITEMS)
    assert yard.autopilot.arm() is None
    station.take("MISSION_CURRENT")
    yard.autopilot.start_mission()
    yard.step(30.0)
    assert [message.seq for message in station.take("MISSION_ITEM_REACHED")] == [1, 2]
    states = [(message.seq, message.mission_state) for message in station.take("MISSION_CURRENT")]
    assert list(dict.fromkeys(states)) == [(1, 3), (2, 3), (2, 5)]
    assert 28 <= len(states) <= 34  # once a second, and at once when it changes


def test_500_items(yard: Yard, station: Station) -> None:
    many = mission_items([(0.1 * step, 1.0, 0.0) for step in range(499)], FRAME, (0.0, 0.0, 0.0))
    assert upload(yard, station, many) == [ACCEPTED]
    assert [item.x for item in download(yard, station)] == [item.x for item in many]


def test_loiter_jump_delay_home_and_fence_items_are_taken(yard: Yard, station: Station) -> None:
    here = (ITEMS[1].x, ITEMS[1].y, 0.0)
    driven = typed_item(ITEMS[1], FRAME, (0.0, 0.0, 0.0), may_be_home=False)
    assert isinstance(driven, DriveTo)
    more = [
        WireItem(3, 17, (0.0, 0, 1.0, 0), *here),
        WireItem(2, 93, (2.0, -1, -1, -1), 0, 0, 0.0),
        WireItem(2, 177, (1.0, -1, 0, 0), 0, 0, 0.0),
        WireItem(0, 179, (0.0, 0, 0, 0), *here),
        WireItem(2, 179, (1.0, 0, 0, 0), 0, 0, 0.0),
        WireItem(2, 207, (1.0, 0, 0, 0), 0, 0, 0.0),
    ]
    assert upload(yard, station, [*ITEMS, *more]) == [ACCEPTED]
    assert yard.autopilot.auto.mission.items[3:] == (
        DriveTo(driven.position_w, math.inf),
        Wait(2.0),
        Jump(1, -1),
        SetHome(driven.position_w),
        SetHome(),
        SetFence(on=True),
    )


def test_of_two_stations_at_once_one_wins_whole_and_the_other_is_told(
    yard: Yard, station: Station, other: Station
) -> None:
    """The first is cut off in the middle; the second is told, tries again, and wins whole."""
    before = mission_items([(1.0, 1.0, 0.0)], FRAME, (0.0, 0.0, 0.0))
    upload(yard, station, before)
    talk(yard, station, count(3))
    assert talk(yard, other, count(2)) == ([], [DENIED])
    assert talk(yard, station, put(0)) == ([1], [])
    assert talk(yard, other, put(0, OTHER[0])) == ([], [DENIED])
    for _ in range(8):  # the first is gone; the second keeps trying
        yard.step(0.9)
        assert [item.x for item in yard.vehicle.store.items] == [item.x for item in before]
        assert talk(yard, other, count(2)) == ([], [DENIED])
    yard.step(1.0)
    assert results(station.take("MISSION_ACK"))[-1] == CANCELLED
    assert upload(yard, other, OTHER) == [ACCEPTED]
    assert [item.x for item in yard.vehicle.store.items] == [item.x for item in OTHER]
    assert talk(yard, station, put(1)) == ([], [CANCELLED])  # back again, and told what became of it
    assert [item.x for item in yard.vehicle.store.items] == [item.x for item in OTHER]


@pytest.mark.parametrize("refusal", [NO_SPACE, DENIED])
def test_a_refused_list_takes_the_place_of_the_one_before(
    yard: Yard, station: Station, other: Station, refusal: int
) -> None:
    """An item of the refused list must not be answered with the success of the list before."""
    assert upload(yard, station, ITEMS) == [ACCEPTED]
    if refusal == NO_SPACE:
        assert talk(yard, station, count(CAPACITY + 1)) == ([], [NO_SPACE])
    else:
        talk(yard, other, count(1))
        assert talk(yard, station, count(len(ITEMS))) == ([], [DENIED])
        assert talk(yard, other, put(0, OTHER[0])) == ([], [ACCEPTED])
    assert talk(yard, station, put(len(ITEMS) - 1)) == ([], [refusal])


@pytest.mark.parametrize(
    ("x", "y", "code"),
    [(236.0, 0.0, 10), (0.0, -300.0, 11), (math.nan, 0.0, 10), (0.0, math.inf, 11), (1e30, 1e30, 10)],
)
def test_degrees_that_fit_no_item_end_the_upload(yard: Yard, station: Station, x: float, y: float, code: int) -> None:
    """The older message, in a command without a place: its numbers are stored, and must fit."""
    assert talk(yard, station, count(1)) == ([0], [])
    wrong = mavlink.MAVLink_mission_item_message(1, 1, 0, 2, 178, 0, 1, 1.0, 0.5, -1.0, 0.0, x, y, 0.0, 0)
    assert talk(yard, station, wrong) == ([], [code])
    assert upload(yard, station, ITEMS) == [ACCEPTED]
