"""Rovers of a user's own: TOML with arms, and URDF with a TOML beside it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

from rover_sim.sim.rover import RoverModel, load_rover
from rover_sim.sim.rover_urdf import urdf, wheel_names
from rover_sim.sim.simulation import Simulation
from tests.sim_factory import make_world, slope
from worlds.errors import ScenarioError
from worlds.scenario import load_scenario

ROVERS = Path(__file__).parents[1] / "rover_sim" / "sim" / "rovers"
NOTES = """
[motor]
max_torque_Nm = 20.0
max_speed_rad_s = 6.0
max_acceleration_rad_s2 = 8.0
[mast]
forward_m = 0.2
height_m = 1.0
[drive]
max_yaw_rate_rad_s = 0.5
effective_track_ratio = 1.8
"""
WHEELS = """
[wheel]
left = ["lf", "lr"]
right = ["rf", "rr"]
stiffness_N_m = 20000.0
"""
# A rover as a URDF exporter would write it: base_footprint below, axles of either sign, a fixed payload, a camera mast.
HAND_MADE = """<robot name="hand">
  <link name="base_footprint"/>
  <link name="base">
    <inertial><mass value="20"/><inertia ixx="0.4" iyy="0.7" izz="0.9" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.1"/><geometry><box size="0.6 0.3 0.1"/></geometry></collision>
  </link>
  <joint name="foot" type="fixed"><origin xyz="0 0 0.12"/><parent link="base_footprint"/><child link="base"/></joint>
  <link name="payload">
    <inertial><mass value="5"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="bolts" type="fixed"><origin xyz="0.1 0 0.2"/><parent link="base"/><child link="payload"/></joint>
  <link name="head"/>
  <joint name="pan" type="revolute"><origin xyz="0 0 0.5"/><parent link="base"/><child link="head"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  {wheels}
</robot>"""
WHEEL = """<link name="{name}_link">
    <inertial><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><cylinder radius="0.12" length="0.08"/></geometry></collision>
  </link>
  <joint name="{name}" type="continuous"><origin xyz="{x} {y} 0" rpy="{turn} 0 0"/>
    <parent link="base"/><child link="{name}_link"/><axis xyz="0 0 1"/></joint>"""


def hand_made() -> str:
    # Left wheels are turned by -90 degrees about x (their z lies along +y), right ones by +90 (along -y).
    places = {"lf": (0.2, 0.25, -np.pi / 2), "lr": (-0.2, 0.25, -np.pi / 2)}
    places |= {"rf": (0.2, -0.25, np.pi / 2), "rr": (-0.2, -0.25, np.pi / 2)}
    return HAND_MADE.format(
        wheels="".join(WHEEL.format(name=name, x=x, y=y, turn=turn) for name, (x, y, turn) in places.items())
    )


def write(folder: Path, robot: str, notes: str) -> str:
    (folder / "own.urdf").write_text(robot, encoding="utf-8")
    (folder / "own.toml").write_text(notes, encoding="utf-8")
    return str(folder / "own.urdf")


def hand_notes(*, locked: str = '["pan"]') -> str:
    return WHEELS + f"[suspension]\nlocked = {locked}\n" + NOTES


def notes_of(model: RoverModel) -> str:
    joints = [f"{name}_joint" for name in wheel_names(model)]
    half = len(joints) // 2
    arms = [f"{arm.name}_joint" for arm in model.suspension.arm]
    lines = ["[wheel]", f"left = {joints[:half]}", f"right = {joints[half:]}", f"grouser_m = {model.wheel.grouser_m}"]
    lines += [f"stiffness_N_m = {model.wheel.stiffness_N_m}", "[suspension]", f"passive = {arms}"]
    if model.suspension.differential:
        lines.append(f"differential = {[f'{name}_joint' for name in model.suspension.differential]}")
    return "\n".join(lines) + NOTES


@pytest.mark.parametrize("name", ["husky", "jackal", "rocker_bogie"])
def test_a_rover_written_as_urdf_comes_back(name: str, tmp_path: Path) -> None:
    model = load_rover(name)
    found = load_rover(write(tmp_path, urdf(model), notes_of(model)))
    assert found.mass_kg == pytest.approx(model.mass_kg)
    assert found.centre_of_mass_b == pytest.approx(model.centre_of_mass_b, abs=1e-9)
    assert np.array(found.wheel.positions_m) == pytest.approx(np.array(model.wheel.positions_m), abs=1e-9)
    assert (found.wheel.radius_m, found.wheel.width_m) == (model.wheel.radius_m, model.wheel.width_m)
    assert found.chassis.inertia_kg_m2 == pytest.approx(model.chassis.inertia_kg_m2)
    assert found.chassis.box == model.chassis.box
    assert found.chassis.clearance_m == pytest.approx(model.chassis.clearance_m, abs=2e-3)
    assert found.suspension.wheel_arms == model.suspension.wheel_arms
    assert found.suspension.differential == model.suspension.differential
    for own, arm in zip(found.suspension.arm, model.suspension.arm, strict=True):
        assert own.limits_deg == pytest.approx(arm.limits_deg)
        assert own.pivot_m == pytest.approx(arm.pivot_m, abs=1e-9)
        assert own.inertia_kg_m2 == pytest.approx(arm.inertia_kg_m2)
        assert [box.pitch_deg for box in own.box] == pytest.approx([box.pitch_deg for box in arm.box])


def test_a_urdf_from_elsewhere_stands_and_drives(tmp_path: Path) -> None:
    model = load_rover(write(tmp_path, hand_made(), hand_notes()))
    assert model.mass_kg == pytest.approx(33.0)
    # By hand: 20 kg at the axles' height, 5 kg at (0.1, 0, 0.2).
    assert model.chassis.centre_of_mass_m == pytest.approx((0.02, 0.0, 0.04))
    # Steiner: 20 * 5 / 25 kg times the squared distance of the two, 0.1 along x and 0.2 along z.
    assert model.chassis.inertia_kg_m2 == pytest.approx((0.5 + 4 * 0.04, 0.8 + 4 * 0.05, 1.0 + 4 * 0.01))
    assert model.chassis.clearance_m == pytest.approx(0.12 + 0.05)
    with Simulation(make_world(slope(0.0)), model, np.random.default_rng(0)) as simulation:
        for _ in range(480):
            simulation.step([2.0] * 4)
        state = simulation.state
    assert state.pose.position_w[0] > 0.3
    assert state.normal_force_N.sum() == pytest.approx(33.0 * 9.81, rel=0.01)


def test_a_mesh_counts_by_its_bounds(tmp_path: Path) -> None:
    folder = tmp_path / "own_description"
    (folder / "meshes").mkdir(parents=True)
    trimesh.creation.box((600.0, 300.0, 100.0)).export(folder / "meshes" / "hull.stl")
    hull = '<box size="0.6 0.3 0.1"/>'
    mesh = '<mesh filename="package://own_description/meshes/hull.stl" scale="0.001 0.001 0.001"/>'
    model = load_rover(write(folder, hand_made().replace(hull, mesh), hand_notes()))
    assert model.chassis.box[0].size_m == pytest.approx((0.6, 0.3, 0.1))
    with pytest.raises(ScenarioError, match=r"collision mesh .*absent\.stl.*cannot be read"):
        load_rover(write(folder, hand_made().replace(hull, mesh.replace("hull", "absent")), hand_notes()))


ROBOT_FAULTS = [
    ('radius="0.12"', 'radius="0.5"', r"wheel\.radius_m = 0\.5: wheels larger than the rover"),
    ('<mass value="20"/>', '<mass value="-5"/>', r"link 'base': mass -5"),
    ('lower="-1" upper="1"', 'lower="1" upper="-1"', r"joint 'pan': limits 1 to -1: lower must be below upper"),
    ('<axis xyz="0 0 1"/></joint>', '<axis xyz="1 0 0"/></joint>', r"joint 'lf' is continuous about \(1, 0, 0\)"),
    ('<child link="head"/>', '<child link="hat"/>', r"joint 'pan': its child link 'hat' does not exist"),
    ('<parent link="base_footprint"/>', '<parent link="head"/>', r"links base, .* hang on each other"),
    ('value="20"', 'value="heavy"', r"<mass value='heavy'>: expected 1 finite"),
    ("</robot>", "", r"not valid XML"),
    ('<link name="head"/>', '<link name="head"/><link name="base"/>', r"two links or two joints of one name"),
    (
        '<robot name="hand">',
        '<robot name="hand" xmlns:xacro="http://ros.org/wiki/xacro"><xacro:arg name="x"/>',
        r"xacro",
    ),
    (
        '<cylinder radius="0.12" length="0.08"/>',
        '<sphere radius="0.12"/>',
        r"wheel\.radius_m and wheel\.width_m: need",
    ),
]


@pytest.mark.parametrize(("old", "new", "message"), ROBOT_FAULTS)
def test_a_urdf_that_cannot_be_is_refused_on_one_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in hand_made()
    with pytest.raises(ScenarioError, match=message) as caught:
        load_rover(write(tmp_path, hand_made().replace(old, new), hand_notes()))
    assert "\n" not in str(caught.value)
    assert "own." in str(caught.value)


def test_a_wheel_without_mass_or_of_another_size_is_refused(tmp_path: Path) -> None:
    whole = hand_made()
    light = whole.replace('<mass value="2"/>', '<mass value="0"/>')
    with pytest.raises(ScenarioError, match=r"link 'lf_link': mass 0: must be more than zero"):
        load_rover(write(tmp_path, light, hand_notes()))
    odd = whole[::-1].replace('"21.0"=suidar', '"41.0"=suidar', 1)[::-1]
    with pytest.raises(ScenarioError, match=r"'rr' differs from 'lf' in radius"):
        load_rover(write(tmp_path, odd, hand_notes()))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"lf"', '"left_front"', r"wheel: no joint 'left_front' in own\.urdf; it has foot, bolts, pan"),
        ('["rf", "rr"]', '["rf"]', r"must name as many joints each"),
        ('["lf", "lr"]', '["lr", "lf"]', r"wheel\.positions_m\[1\].*the order is left front"),
        ('locked = ["pan"]', "", r"joint 'pan' of own\.urdf is revolute and named nowhere"),
        ('locked = ["pan"]', 'passive = ["pan"]', r"joint 'pan' is revolute about \(0, 0, 1\)"),
        ('locked = ["pan"]', 'locked = ["pan", "lf"]', r"a joint is named twice"),
        ('locked = ["pan"]', 'locked = ["pan"]\ndifferential = ["a", "b"]', r"differential: 'a' is not among"),
        ("stiffness_N_m", "stifness_N_m", r"wheel\.stifness_N_m.*unknown key"),
        ("[mast]", "[mest]", r"mest.*unknown key"),
    ],
)
def test_notes_that_do_not_fit_the_urdf_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in hand_notes()
    with pytest.raises(ScenarioError, match=message) as caught:
        load_rover(write(tmp_path, hand_made(), hand_notes().replace(old, new)))
    assert "\n" not in str(caught.value)


def test_a_urdf_needs_its_notes(tmp_path: Path) -> None:
    path = tmp_path / "alone.urdf"
    path.write_text(hand_made(), encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"alone\.urdf: needs alone\.toml beside it"):
        load_rover(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "limits_deg = [-35.0, 35.0]",
            "limits_deg = [35.0, -35.0]",
            r"suspension\.arm\[0\]\.limits_deg = \[35\.0, -35\.0\]",
        ),
        ('parent = "left_rocker"', 'parent = "left_rokcer"', r"suspension\.arm\[1\]\.parent = 'left_rokcer': allowed"),
        ('["left_rocker", "right_rocker"]', '["left_rocker", "left_bogie"]', r"suspension\.differential"),
        ('wheel_arms = ["left_rocker", ', "wheel_arms = [", r"suspension\.wheel_arms: 5 names for 6 wheels"),
        ('name = "right_bogie"', 'name = "left_bogie"', r"two arms of one name"),
        ("mass_kg = 1.6", "mass_kg = 0.0", r"suspension\.arm\[1\]\.mass_kg = 0"),
        ("    [0.425, 0.365, 0.0],", "    ", r"5 wheels; allowed is an even number"),
        ("[0.002, 0.025, 0.025]", "[0.002, 0.025, 0.1]", r"suspension\.arm\[1\]\.inertia_kg_m2"),
    ],
)
def test_arms_that_do_not_fit_together_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = (ROVERS / "rocker_bogie.toml").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "own.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ScenarioError, match=message) as caught:
        load_rover(path)
    assert "\n" not in str(caught.value)


def test_a_scenario_finds_its_rover_beside_itself(tmp_path: Path) -> None:
    write(tmp_path, hand_made(), hand_notes())
    (tmp_path / "world.toml").write_text('name = "w"\n[rover]\nmodel = "own.urdf"\n', encoding="utf-8")
    model = load_scenario(str(tmp_path / "world.toml")).rover.model
    assert Path(model) == (tmp_path / "own.urdf").resolve()
    assert re.fullmatch("hand", load_rover(model).name)
