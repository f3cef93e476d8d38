from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_sim.mavlink.geodesy import DEGREES_E7, GeoPoint, LocalFrame, heading_deg, yaw_rad
from rover_sim.mavlink.plan_items import mission_items
from rover_sim.mavlink.wire import place_of
from worlds.scenario import Origin

NEAR = st.floats(-1000.0, 1000.0)
LATITUDE = st.floats(-89.9, 89.9)
LONGITUDE = st.floats(-179.9, 179.9)


@given(NEAR, NEAR, st.floats(-200.0, 200.0), LATITUDE, LONGITUDE)
def test_there_and_back_is_the_same_place(x: float, y: float, z: float, latitude: float, longitude: float) -> None:
    frame = LocalFrame(Origin(latitude_deg=latitude, longitude_deg=longitude))
    back = frame.to_world(frame.to_geo((x, y, z)))
    assert math.dist(back, (x, y, z)) < 1e-6


@given(NEAR, NEAR, st.floats(-50.0, 50.0))
def test_a_mission_position_survives_the_wire_to_2_cm(x: float, y: float, z: float) -> None:
    frame = LocalFrame(Origin())
    home = (0.0, 0.0, 0.0)
    item = mission_items([(x, y, z)], frame, home)[1]
    altitude = frame.to_geo(home).altitude_m + item.z
    back = place_of(item.x, item.y, altitude, frame)
    assert back is not None
    assert math.dist(back, (x, y, z)) < 0.02


def test_known_answers_on_the_ellipsoid() -> None:
    # At the equator one degree of longitude is a * pi / 180 = 111 319.4908 m of arc; the local tangent sees its sine.
    frame = LocalFrame(Origin(latitude_deg=0.0, longitude_deg=0.0, altitude_m=0.0))
    east, north, up = frame.to_world(GeoPoint(0.0, 1.0, 0.0))
    assert east == pytest.approx(6378137.0 * math.sin(math.radians(1.0)), abs=1e-6)
    assert north == pytest.approx(0.0, abs=1e-6)
    assert up == pytest.approx(6378137.0 * (math.cos(math.radians(1.0)) - 1.0), abs=1e-6)
    # The pole lies b = 6 356 752.3142 m from the centre.
    _, north, up = frame.to_world(GeoPoint(90.0, 0.0, 0.0))
    assert north == pytest.approx(6356752.3142, abs=1e-3)
    assert up == pytest.approx(-6378137.0, abs=1e-6)


def test_integers_are_1e7_degrees_and_millimetres() -> None:
    point = GeoPoint(38.4064, -110.7919, 1380.0)
    assert (point.latitude_e7, point.longitude_e7, point.altitude_mm) == (384064000, -1107919000, 1380000)
    assert point.latitude_e7 / DEGREES_E7 == 38.4064


@pytest.mark.parametrize(("yaw", "heading"), [(0.0, 90.0), (math.pi / 2, 0.0), (-math.pi / 2, 180.0), (-3.0, 261.887)])
def test_headings_are_clockwise_from_north(yaw: float, heading: float) -> None:
    assert heading_deg(yaw) == pytest.approx(heading, abs=1e-3)
    assert yaw_rad(heading_deg(yaw)) == pytest.approx(yaw)
