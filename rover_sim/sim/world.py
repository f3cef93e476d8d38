"""The PyBullet side: one client with the rover in it; the ground is not a body."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from pathlib import Path

from rover_sim.sim.bullet import pybullet
from rover_sim.sim.rover import RoverModel
from rover_sim.sim.rover_urdf import urdf, wheel_names
from worlds.types import Pose, Vector3

TIME_STEP_S = 1.0 / 240.0
CHASSIS = -1  # PyBullet's link number of the base

_WHEEL_FRICTION = 1.0
_CHASSIS_FRICTION = 0.6
_DIFFERENTIAL_STRENGTH = 1000.0  # m/s2: torque per mass of the rover and wheelbase, more than any landing asks
_DIFFERENTIAL_ERP = 0.2  # share of its error that the differential corrects in a step


@dataclass(frozen=True)
class RoverBody:
    """The rover in PyBullet; link and joint numbers agree, as every joint has one child link."""

    body: int
    wheels: tuple[int, ...]  # links, in the order of the rover file
    arms: tuple[int, ...] = ()

    @cached_property
    def joints(self) -> tuple[int, ...]:
        """Of the wheels, then of the arms."""
        return self.wheels + self.arms


def connect(gravity_m_s2: float, time_step_s: float = TIME_STEP_S) -> int:
    """A new headless client with gravity and time step set; its number."""
    client = int(pybullet.connect(pybullet.DIRECT))
    set_gravity(client, (0.0, 0.0, -gravity_m_s2))
    pybullet.setPhysicsEngineParameter(
        fixedTimeStep=time_step_s,
        numSolverIterations=20,
        deterministicOverlappingPairs=0,  # another value gives another trajectory
        enableFileCaching=0,
        physicsClientId=client,
    )
    return client


def set_gravity(client: int, gravity_w: Vector3) -> None:
    """Set the pull on every mass (m/s2, world); leaning it tilts the ground, a level part tows the rover."""
    pybullet.setGravity(*gravity_w, physicsClientId=client)


def add_rover(client: int, rover: RoverModel, pose: Pose) -> RoverBody:
    """Load a rover with its body origin at ``pose``, motors holding its wheels."""
    with tempfile.TemporaryDirectory(prefix="rover-sim-") as folder:
        path = Path(folder) / "rover.urdf"
        path.write_text(urdf(rover), encoding="utf-8")
        flags = pybullet.URDF_USE_IMPLICIT_CYLINDER | pybullet.URDF_USE_INERTIA_FROM_FILE
        body = int(
            pybullet.loadURDF(
                str(path), pose.position_w.tolist(), pose.quaternion_w.tolist(), flags=flags, physicsClientId=client
            )
        )
    joints = {
        pybullet.getJointInfo(body, number, physicsClientId=client)[12].decode(): number
        for number in range(pybullet.getNumJoints(body, physicsClientId=client))
    }
    wheels = tuple(joints[name] for name in wheel_names(rover))
    arms = tuple(joints[arm.name] for arm in rover.suspension.arm)
    loaded = RoverBody(body, wheels, arms)
    _set_dynamics(client, loaded, rover)
    _free_arms(client, loaded, rover)
    return loaded


def _free_arms(client: int, body: RoverBody, rover: RoverModel) -> None:
    """Let the arms swing, joined by the differential: the angles of both sides sum to zero."""
    for arm in body.arms:
        pybullet.setJointMotorControl2(
            body.body, arm, pybullet.VELOCITY_CONTROL, targetVelocity=0.0, force=0.0, physicsClientId=client
        )
    if rover.suspension.differential is None:
        return
    numbers = rover.suspension.arm_numbers()
    left, right = (body.arms[numbers[name]] for name in rover.suspension.differential)
    gear = pybullet.createConstraint(
        body.body,
        left,
        body.body,
        right,
        jointType=pybullet.JOINT_GEAR,
        jointAxis=[0, 1, 0],
        parentFramePosition=[0, 0, 0],
        childFramePosition=[0, 0, 0],
        physicsClientId=client,
    )
    most_Nm = rover.mass_kg * _DIFFERENTIAL_STRENGTH * rover.wheelbase_m
    pybullet.changeConstraint(gear, gearRatio=1, maxForce=most_Nm, erp=_DIFFERENTIAL_ERP, physicsClientId=client)


def _set_dynamics(client: int, body: RoverBody, rover: RoverModel) -> None:
    """No artificial damping; friction against rock only, as the ground is the soil model's."""
    for link in (CHASSIS, *body.joints):
        pybullet.changeDynamics(
            body.body,
            link,
            lateralFriction=_WHEEL_FRICTION if link in body.wheels else _CHASSIS_FRICTION,
            spinningFriction=0.0,
            rollingFriction=0.0,
            restitution=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            jointDamping=0.0,
            physicsClientId=client,
        )
    # A wheel is as soft against rock as on the ground: without it each rock is a hammer blow of one step.
    damping = sqrt(rover.wheel.stiffness_N_m * rover.mass_kg / len(body.wheels))
    for wheel in body.wheels:
        pybullet.changeDynamics(
            body.body,
            wheel,
            contactStiffness=rover.wheel.stiffness_N_m,
            contactDamping=damping,
            physicsClientId=client,
        )


def drive_wheels(client: int, rover: RoverBody, speeds_rad_s: Sequence[float], torques_Nm: Sequence[float]) -> None:
    """Set the speeds that the motors hold, each with at most its torque."""
    pybullet.setJointMotorControlArray(
        rover.body,
        rover.wheels,
        pybullet.VELOCITY_CONTROL,
        targetVelocities=speeds_rad_s,
        forces=torques_Nm,
        physicsClientId=client,
    )
