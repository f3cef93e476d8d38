"""The rover in its world, one fixed step at a time: motors, soil, rocks, sensors."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from rover_sim.sim import placement, truth
from rover_sim.sim import world as physics
from rover_sim.sim.battery import Battery
from rover_sim.sim.bullet import pybullet
from rover_sim.sim.contacts import ContactReader
from rover_sim.sim.faults import check_wheels
from rover_sim.sim.motors import Motors
from rover_sim.sim.obstacle_bodies import ObstacleBodies
from rover_sim.sim.rover import RoverModel
from rover_sim.sim.rover_ground import RoverGround
from rover_sim.sim.ruts import RutField
from rover_sim.sim.sensors import Sensors
from rover_sim.sim.soil_kernels import FORCE, POINT
from rover_sim.sim.surroundings import Surroundings
from rover_sim.sim.vehicle_state import BodyContact, VehicleState
from worlds.types import FloatArray, SensorReadings, Vector3, World

_SETTLE_S = 4.0  # at most
_STILL_SPEED = 2e-4  # m/s and rad/s
_ACCELERATION_STEPS = 12  # over which the acceleration of the stability measure is taken
_NO_PUSH = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Work:
    """Where the work of the motors went since the start, J; what is left is height, motion and what rocks took."""

    motors: float  # negative where they brake
    shear: float  # slip of the wheels, along and across
    drag: float  # compaction and bulldozing
    normal: float  # springs and dampers of the contact


class Simulation:
    """A rover on the ground of a world; starts at rest, settled, at time zero."""

    def __init__(
        self,
        world: World,
        rover: RoverModel,
        rng: np.random.Generator,
        *,
        time_step_s: float = physics.TIME_STEP_S,
    ) -> None:
        self.world, self.rover, self.dt = world, rover, time_step_s
        gravity = world.scenario.gravity_m_s2
        check_wheels(world.scenario.event, rover.name, len(rover.wheel.positions_m), world.scenario.name)
        self._ground = RoverGround(world, rover)
        self._client = physics.connect(gravity, time_step_s)
        pose = placement.resting_pose(world.ground, world.start, rover, self._ground.soil, gravity)
        self._body = physics.add_rover(self._client, rover, pose)
        self._obstacles = ObstacleBodies(self._client, world.shapes)
        self._contacts = ContactReader(self._client, self._body, self._obstacles)
        self._balance = truth.balance_of(rover, gravity)
        self._around = Surroundings(self._contacts.obstacles, rover)
        self._sensors = Sensors(world, rover, rng)
        self._held = (0.0,) * len(self._body.wheels)
        self._chassis_and_wheels = self._ground.raw[: 13 + len(self._body.wheels)]  # a view
        self._recent_motion: deque[truth.Motion] = deque(maxlen=_ACCELERATION_STEPS)
        self._pushed: Vector3 = _NO_PUSH
        self._seen: VehicleState | None = None
        self._battery = Battery(rover, world.scenario.rover.charge)
        self._start_clock()
        self._motors = Motors(self._client, self._body, rover, world.scenario)
        self._read()
        self._settle()

    @property
    def client(self) -> int:
        """The PyBullet client."""
        return self._client

    def step(self, wheel_speed_rad_s: Sequence[float]) -> None:
        """Advance one time step; the speeds are of the left side front to rear, then of the right side."""
        self._seen = None
        held = self._battery.empty
        self._motors.command(self._held if held else wheel_speed_rad_s, self.time_s, self.dt)
        self._belly = self._ground.step(self.dt) > 0
        self._push()
        self._obstacles.follow(float(self._ground.raw[0]), float(self._ground.raw[1]))
        self._contacts.before_step(self._ground.raw)
        pybullet.stepSimulation(physicsClientId=self._client)
        self._steps += 1
        self._read()
        self._contacts.after_step(self.time_s)
        self._account()

    @property
    def time_s(self) -> float:
        """Simulated time since the rover came to rest."""
        return self._steps * self.dt

    @property
    def state(self) -> VehicleState:
        """The truth now; computed when asked for, once a step."""
        if self._seen is None:
            self._seen = truth.observe(self._snapshot())
        return self._seen

    @property
    def chassis_motion(self) -> FloatArray:
        """Place, quaternion (x, y, z, w), velocity and rate of the chassis' centre of mass (13,), in the world."""
        return self._ground.raw[:13].copy()

    def push(self, force_w: Vector3) -> None:
        """A force (N) from outside on the chassis' centre of mass during the next step: a gust, a pull, a blow."""
        client, body, centre = self._client, self._body.body, self._ground.raw[:3].tolist()
        pybullet.applyExternalForce(
            body, physics.CHASSIS, force_w, centre, pybullet.WORLD_FRAME, physicsClientId=client
        )
        self._pushed = force_w

    @property
    def ruts(self) -> RutField | None:
        """The ruts driven so far; None where the scenario's ground does not deform."""
        return self._ground.soil.ruts

    @property
    def work_J(self) -> Work:
        """The energy balance of motors and soil."""
        return Work(self._motor_work_J, *self._ground.soil.work_J)

    def read_sensors(self) -> SensorReadings:
        """What the rover's own sensors say now, averaged over the time since the last reading where they do so."""
        battery = self._battery.read(self.time_s, self._energy_J)
        return self._sensors.read(self.time_s, self._ground.raw, self._wheel_angles, battery)

    def take_contacts(self) -> tuple[BodyContact, ...]:
        """Contacts of the hull with obstacles since the last call, the hardest of each obstacle."""
        return self._contacts.take()

    def take_wheel_touch(self) -> bool:
        """Whether a wheel has touched an obstacle since the last call."""
        return self._contacts.take_wheel_touch()

    def close(self) -> None:
        """Free the physics client; harmless when repeated."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _start_clock(self) -> None:
        self._steps = 0
        self._energy_J = self._motor_work_J = 0.0
        self._ground.soil.forget_work()
        self._power_W = self.rover.motor.idle_power_W
        self._belly = False

    def _settle(self) -> None:
        """Let the rover come to rest with its wheels held, then start the clock."""
        still = 0
        for _ in range(int(_SETTLE_S / self.dt)):
            self.step(self._held)
            speeds = self._ground.raw[7:13]
            still = still + 1 if np.abs(speeds).max() < _STILL_SPEED else 0
            if still > 0.1 / self.dt:
                break
        self._start_clock()
        self._motors.start()
        self._contacts.take()
        self._contacts.take_wheel_touch()
        self._sensors.start(self._ground.raw, self._wheel_angles)

    def _push(self) -> None:
        """Hand the forces of the ground to PyBullet."""
        client, body = self._client, self._body.body
        for link, row in zip(self._body.wheels, self._ground.soil.result[:, :6].tolist(), strict=True):
            pybullet.applyExternalForce(
                body, link, row[FORCE : FORCE + 3], row[POINT : POINT + 3], pybullet.WORLD_FRAME, physicsClientId=client
            )
        if self._belly:
            wrench = self._ground.wrench.tolist()
            centre = self._ground.raw[:3].tolist()
            pybullet.applyExternalForce(
                body, physics.CHASSIS, wrench[:3], centre, pybullet.WORLD_FRAME, physicsClientId=client
            )
            pybullet.applyExternalTorque(
                body, physics.CHASSIS, wrench[3:], pybullet.WORLD_FRAME, physicsClientId=client
            )

    def _read(self) -> None:
        """Fetch what the next step and the sensors need; nothing else, as each call costs microseconds."""
        client, body, raw = self._client, self._body.body, self._ground.raw
        position, quaternion = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
        velocity, rate = pybullet.getBaseVelocity(body, physicsClientId=client)
        joints = pybullet.getJointStates(body, self._body.joints, physicsClientId=client)
        if self._body.arms:
            arms = joints[self._ground.soil.count :]
            joints = joints[: self._ground.soil.count]
            raw[13 + len(joints) :] = [joint[0] for joint in arms] + [joint[1] for joint in arms]
        self._wheel_angles = [joint[0] for joint in joints]
        self._wheel_speeds = [joint[1] for joint in joints]
        self._torques = self._motors.torques_Nm([joint[3] for joint in joints])
        self._chassis_and_wheels[:] = (*position, *quaternion, *velocity, *rate, *self._wheel_speeds)
        self._recent_motion.append((velocity, rate, self._pushed))
        self._pushed = _NO_PUSH

    def _account(self) -> None:
        driving = braking = 0.0
        for torque, speed in zip(self._torques, self._wheel_speeds, strict=True):
            power = torque * speed
            if power > 0.0:
                driving += power
            else:
                braking += power
        self._power_W = driving + self.rover.motor.idle_power_W
        self._energy_J += self._power_W * self.dt
        self._motor_work_J += (driving + braking) * self.dt

    def _snapshot(self) -> truth.Snapshot:
        hubs_w, centre_w = self._ground.locate()
        return truth.Snapshot(
            hubs_w=hubs_w,
            centre_w=centre_w,
            time_s=self.time_s,
            dt=self.dt,
            gravity_m_s2=self.world.scenario.gravity_m_s2,
            balance=self._balance,
            field=self.world.ground,
            surface=(self._ground.soil.ground, self._ground.soil.grid, self._ground.soil.rut_view),
            around=self._around,
            raw=self._ground.raw.copy(),
            wheels=self._ground.soil.result.copy(),
            rock_loads_N=self._contacts.wheel_loads(),
            torques_Nm=np.array(self._torques),
            power_W=self._power_W,
            energy_J=self._energy_J,
            belly_contact=self._belly,
            body_contacts=self._contacts.body,
            wheel_contacts=self._contacts.wheel_ids(),
            wedged=self._contacts.wedged(),
            motion=tuple(self._recent_motion),
        )
