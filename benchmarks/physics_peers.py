"""The peers of `physics_speed`: the same rover on rigid contact wheels in raw PyBullet and in MuJoCo.

Both get the ground as their own height field, the rocks as meshes of their own (PyBullet concave as ours, MuJoCo
convex hulls, the only ones that it has), friction 0.8, and velocity motors with the rover file's torque.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from rover_sim.sim import world as physics
from rover_sim.sim.bullet import pybullet
from rover_sim.sim.obstacle_bodies import ObstacleBodies
from rover_sim.sim.rover import RoverModel
from worlds.heightfield import height_at
from worlds.types import Pose, Vector3, World

FRICTION = 0.8
Commands = list[tuple[float, float]]


@dataclass(frozen=True)
class Driven:
    """What a drive cost and how far it led."""

    step_s: float  # CPU time
    way_m: float  # second by second
    on_rock: float | None = None  # share of the time, where it is known


def _start(world: World, rover: RoverModel) -> Pose:
    """Over the highest ground under the rover."""
    x, y = world.start.position_w[:2]
    around = np.linspace(-0.6, 0.6, 13)
    top = float(np.max(height_at(world.ground, x + around[:, None], y + around[None, :])))
    return Pose(np.array([x, y, top + rover.wheel.radius_m + 0.01]), np.array([0.0, 0.0, 0.0, 1.0]))


def bullet_drive(world: World, rover: RoverModel, commands: Commands) -> Driven:
    """PyBullet."""
    client = physics.connect(world.scenario.gravity_m_s2)
    heights, cell = world.ground.heights_m, world.ground.resolution_m
    rows, columns = heights.shape
    shape = pybullet.createCollisionShape(
        pybullet.GEOM_HEIGHTFIELD,
        meshScale=[cell, cell, 1.0],
        heightfieldData=heights.ravel().tolist(),
        numHeightfieldRows=columns,
        numHeightfieldColumns=rows,
        physicsClientId=client,
    )
    middle = [(low + high) / 2.0 for low, high in (world.ground.x_limits_m, world.ground.y_limits_m)]
    ground = pybullet.createMultiBody(
        0.0, shape, basePosition=[*middle, (heights.min() + heights.max()) / 2.0], physicsClientId=client
    )
    pybullet.changeDynamics(ground, -1, lateralFriction=FRICTION, physicsClientId=client)
    ObstacleBodies(client, world.shapes).follow(*world.start.position_w[:2].tolist())
    body = physics.add_rover(client, rover, _start(world, rover))
    half = len(body.wheels) // 2
    before = None
    places = []
    begin = time.process_time()
    for left, right in commands:
        if (left, right) != before:
            before = (left, right)
            physics.drive_wheels(client, body, [left] * half + [right] * half, [rover.motor.max_torque_Nm] * 2 * half)
        pybullet.stepSimulation(physicsClientId=client)
        places.append(pybullet.getBasePositionAndOrientation(body.body, physicsClientId=client)[0])
    spent = time.process_time() - begin
    pybullet.disconnect(physicsClientId=client)
    return Driven(spent / len(commands), _way_m(places))


def mujoco_drive(world: World, rover: RoverModel, commands: Commands) -> Driven | None:
    """MuJoCo; None where it is not installed."""
    try:
        import mujoco
    except ImportError:
        return None
    model = _mujoco_model(mujoco, world, rover)
    data = mujoco.MjData(model)
    half = len(rover.wheel.positions_m) // 2
    places = []
    begin = time.process_time()
    for left, right in commands:
        data.ctrl[:half] = left
        data.ctrl[half:] = right
        mujoco.mj_step(model, data)
        places.append(data.qpos[:3].tolist())
    return Driven((time.process_time() - begin) / len(commands), _way_m(places))


def _way_m(places: list[Vector3]) -> float:
    """Length of a path, second by second."""
    return float(np.linalg.norm(np.diff(np.array(places[:: round(1 / physics.TIME_STEP_S)]), axis=0), axis=1).sum())


def _mujoco_model(mujoco: object, world: World, rover: RoverModel) -> object:
    """The scene: a height field, a mesh for each rock, and the rover."""
    spec = mujoco.MjSpec()  # type: ignore[attr-defined]
    kinds = mujoco.mjtGeom  # type: ignore[attr-defined]
    spec.option.timestep = physics.TIME_STEP_S
    spec.option.gravity = [0.0, 0.0, -world.scenario.gravity_m_s2]
    heights = world.ground.heights_m
    low, high = float(heights.min()), float(heights.max())
    (west, east), (south, north) = world.ground.x_limits_m, world.ground.y_limits_m
    spec.add_hfield(
        name="ground",
        nrow=heights.shape[0],
        ncol=heights.shape[1],
        size=[(east - west) / 2, (north - south) / 2, high - low, 0.5],
        userdata=((heights - low) / (high - low)).ravel(),
    )
    here = [(west + east) / 2, (south + north) / 2, low]
    friction = [FRICTION, 0.005, 0.0001]
    base = spec.worldbody
    base.add_geom(type=kinds.mjGEOM_HFIELD, hfieldname="ground", pos=here, friction=friction)
    for place in range(len(world.shapes.ids)):
        mesh = world.shapes.collision(np.array([place], dtype=np.int32))
        name = f"rock{place}"
        spec.add_mesh(name=name, uservert=mesh.vertices_m.ravel(), userface=mesh.faces.ravel())
        base.add_geom(type=kinds.mjGEOM_MESH, meshname=name, friction=friction)
    chassis = rover.chassis
    body = base.add_body(name="chassis", pos=_start(world, rover).position_w, mass=chassis.mass_kg)
    body.ipos, body.inertia, body.explicitinertial = chassis.centre_of_mass_m, chassis.inertia_kg_m2, True
    body.add_freejoint()
    for box in chassis.box:
        body.add_geom(type=kinds.mjGEOM_BOX, size=np.array(box.size_m) / 2, pos=box.centre_m, friction=friction)
    wheel = rover.wheel
    for number, place_m in enumerate(wheel.positions_m):
        part = body.add_body(name=f"wheel{number}", pos=place_m)
        part.add_joint(name=f"axle{number}", axis=[0, 1, 0], armature=rover.motor.rotor_inertia_kg_m2)
        part.add_geom(
            type=kinds.mjGEOM_CYLINDER,
            size=[wheel.radius_m, wheel.width_m / 2, 0.0],
            quat=[np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0],
            mass=wheel.mass_kg,
            friction=friction,
        )
        motor = spec.add_actuator(name=f"motor{number}", target=f"axle{number}")
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT  # type: ignore[attr-defined]
        motor.set_to_velocity(kv=20.0)
        motor.forcerange = [-rover.motor.max_torque_Nm, rover.motor.max_torque_Nm]
    return spec.compile()
