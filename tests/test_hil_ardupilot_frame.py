from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_sim.hil.ardupilot_frame import ArduPilotFrame
from rover_sim.mavlink.geodesy import LocalFrame
from worlds.scenario import Origin

NORTH = Origin(latitude_deg=60.0, longitude_deg=10.0, altitude_m=100.0)
HOME = (3.0, -2.0, 0.5)


def test_home_is_where_the_ellipsoid_has_it() -> None:
    frame, true = ArduPilotFrame(NORTH, HOME), LocalFrame(NORTH)
    assert frame.to_geo(HOME) == true.to_geo(HOME)


def test_metres_become_degrees_by_one_factor() -> None:
    """By hand: 100 m are 100 x 89.83204953 x 1e-7 degrees of latitude, and at 60 degrees twice as many of longitude."""
    frame = ArduPilotFrame(NORTH, (0.0, 0.0, 0.0))
    place = frame.to_geo((100.0, 100.0, 2.0))
    assert place.latitude_deg - 60.0 == pytest.approx(8.983204953e-4, rel=1e-8)
    assert place.longitude_deg - 10.0 == pytest.approx(2.0 * 8.983204953e-4, rel=1e-8)
    assert place.altitude_m == pytest.approx(102.0)


def test_the_ellipsoid_would_miss_by_decimetres_in_100_m() -> None:
    """Why it is there: at 38 degrees a degree of latitude is 111.0 km long, and 111.3 to SITL."""
    origin = Origin(latitude_deg=38.4, longitude_deg=-110.8, altitude_m=1380.0)
    sitl, true = ArduPilotFrame(origin, (0.0, 0.0, 0.0)), LocalFrame(origin)
    _, north, _ = sitl.to_world(true.to_geo((0.0, 100.0, 0.0)))
    assert north - 100.0 == pytest.approx(0.29, abs=0.03)


@given(st.tuples(*[st.floats(-1e3, 1e3)] * 3))
def test_there_and_back(place: tuple[float, float, float]) -> None:
    frame = ArduPilotFrame(NORTH, HOME)
    assert frame.to_world(frame.to_geo(place)) == pytest.approx(place, abs=1e-5)
