from __future__ import annotations

from math import atan, pi, radians, tan
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from rover_sim.sim.rover import load_rover, rover_names
from rover_sim.sim.rover_urdf import urdf, wheel_names
from worlds.errors import ScenarioError
from worlds.scenario import Camera

FOLDER = Path(__file__).parents[1] / "rover_sim" / "sim" / "rovers"


def _changed(tmp_path: Path, old: str, new: str) -> Path:
    text = (FOLDER / "husky.toml").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "own.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


def test_husky_has_the_published_geometry() -> None:
    rover = load_rover("husky")
    assert rover.track_m == pytest.approx(0.5708)
    assert rover.wheelbase_m == pytest.approx(0.512)
    assert rover.mass_kg == pytest.approx(46.034 + 4 * 2.637)
    # Centre of mass by hand: only the chassis has height.
    assert rover.centre_of_mass_b == pytest.approx((0.0, 0.0, 46.034 * 0.029 / 56.582))


def test_footprint_holds_what_the_planner_needs() -> None:
    footprint = load_rover("husky").footprint()
    assert footprint.width_m == pytest.approx(0.5708 + 0.1143)
    assert footprint.length_m == pytest.approx(0.98)
    assert footprint.wheel_radius_m == pytest.approx(0.1651 + 0.5 * 0.010)
    assert footprint.max_speed_m_s == pytest.approx(6.0 * 0.1701)


def test_camera_stands_at_its_height_and_sees_its_angle() -> None:
    rover = load_rover("husky")
    model = rover.camera(Camera(height_m=1.2, fov_deg=90.0, pitch_deg=30.0, width=400))
    assert model.position_b[2] + rover.wheel.radius_m == pytest.approx(1.2)
    assert 2 * atan(200 / model.focal_px) == pytest.approx(pi / 2)
    assert model.pitch_rad == pytest.approx(radians(30.0))
    assert tan(pi / 4) * model.focal_px == pytest.approx(200.0)


def test_urdf_has_four_wheels_in_order_on_axles_along_y() -> None:
    rover = load_rover("jackal")
    root = ET.fromstring(urdf(rover))  # noqa: S314 - our own text
    joints = root.findall("joint")
    children = [joint.find("child") for joint in joints]
    assert [child.attrib["link"] for child in children if child is not None] == list(wheel_names(rover))
    assert wheel_names(rover) == ("wheel_left_front", "wheel_left_rear", "wheel_right_front", "wheel_right_rear")
    assert all(axis.attrib["xyz"] == "0 1 0" for joint in joints if (axis := joint.find("axis")) is not None)
    masses = [float(mass.attrib["value"]) for mass in root.iter("mass")]
    assert sum(masses) == pytest.approx(rover.mass_kg)


def test_all_shipped_rovers_load() -> None:
    assert rover_names() == ["husky", "jackal", "rocker_bogie"]
    for name in rover_names():
        assert load_rover(name).name == name


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("mass_kg = 46.034", "mass_kg = -1.0", r"chassis\.mass_kg = -1: allowed are"),
        ("mass_kg = 46.034", "mass_kg = 0.0", r"chassis\.mass_kg = 0: allowed are"),
        ("mass_kg = 46.034", "mass_kg = nan", r"chassis\.mass_kg = nan: must be a finite"),
        ("radius_m = 0.1651", "radius_m = 0.6", r"wheel\.radius_m = 0\.6.*larger than the rover"),
        ("radius_m = 0.1651", "radius_m = 0.3", r"wheel\.radius_m = 0\.3.*wheels overlap"),
        ("grouser_m = 0.010", "grouser_m = 0.1", r"wheel\.grouser_m = 0\.1: at most half"),
        ("max_torque_Nm = 30.0", "max_torqe_Nm = 30.0", r"max_torqe_Nm.*unknown key.*max_torque_Nm"),
        ("max_torque_Nm = 30.0", "", r"motor\.max_torque_Nm: this key is required"),
        ("[[0.256, 0.2854", "[[0.256, -0.2854", r"wheel\.positions_m\[0\].*left front"),
        ("[0.6022, 1.7386, 2.0296]", "[0.1, 0.1, 2.0]", r"chassis\.inertia_kg_m2"),
    ],
)
def test_a_rover_that_cannot_be_is_named_on_one_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message) as caught:
        load_rover(str(_changed(tmp_path, old, new)))
    assert "\n" not in str(caught.value)
    assert "own.toml" in str(caught.value)


def test_unknown_rover_lists_the_known() -> None:
    with pytest.raises(ScenarioError, match=r"rover\.model = 'rocket'.*husky, jackal, rocker_bogie"):
        load_rover("rocket")
