"""Pictures of the shipped rovers, each driven onto a block on its left, by PyBullet's TinyRenderer.

Run: OMP_NUM_THREADS=1 uv run python benchmarks/rover_pictures.py [PATH]      (default: docs/images/rovers.png)
"""

from __future__ import annotations

import sys
import tempfile
from copy import deepcopy
from pathlib import Path
from xml.etree import ElementTree as ET

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rover_sim.files import atomic_path
from rover_sim.sim import world as physics
from rover_sim.sim.bullet import pybullet
from rover_sim.sim.rover import RoverModel, load_rover, rover_names
from rover_sim.sim.rover_urdf import urdf
from rover_sim.sim.simulation import Simulation
from tests.sim_factory import box_mesh, make_world, slope
from worlds.types import ByteArray, Pose, Vector3

Block = tuple[Vector3, Vector3]  # lowest and highest corner

SIZE = (520, 400)
SPOKES = 24  # grousers and gaps of a wheel
FINER = 2  # rendered so many times larger, then averaged
COLOURS = {"chassis": (0.86, 0.84, 0.80, 1.0), "wheel": (0.30, 0.30, 0.33, 1.0), "arm": (0.85, 0.55, 0.20, 1.0)}
GROUND, BLOCK = (0.72, 0.52, 0.38, 1.0), (0.50, 0.38, 0.30, 1.0)


def visible_urdf(rover: RoverModel, folder: Path) -> str:
    """The rover's URDF with its collision shapes to be seen as well, its wheels with grousers."""
    write_wheel(rover, folder / "wheel.obj")
    robot = ET.fromstring(urdf(rover))  # noqa: S314 - our own text
    for link in robot.findall("link"):
        for collision in link.findall("collision"):
            visual = deepcopy(collision)
            visual.tag = "visual"
            for shape in visual.iter("cylinder"):
                shape.tag, shape.attrib = "mesh", {"filename": str(folder / "wheel.obj")}
            link.append(visual)
    return ET.tostring(robot, encoding="unicode")


def write_wheel(rover: RoverModel, path: Path) -> None:
    """A wheel about z, every other of its faces raised by a grouser."""
    wheel = rover.wheel
    angles = np.repeat(np.arange(SPOKES) * 2 * np.pi / SPOKES, 2) + np.tile([0.0, 0.35], SPOKES) * 2 * np.pi / SPOKES
    radii = np.repeat(np.tile([wheel.radius_m + wheel.grouser_m, wheel.radius_m], SPOKES // 2), 2)
    ring = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    near, far = (np.column_stack([ring, np.full(len(ring), z)]) for z in (-wheel.width_m / 2, wheel.width_m / 2))
    after_near, after_far = np.roll(near, -1, axis=0), np.roll(far, -1, axis=0)
    hub_near, hub_far = (np.tile([0.0, 0.0, z], (len(ring), 1)) for z in (near[0, 2], far[0, 2]))
    sides = [
        (near, after_near, after_far),
        (near, after_far, far),
        (hub_near, after_near, near),
        (hub_far, far, after_far),
    ]
    corners = np.concatenate([np.stack(side, axis=1) for side in sides])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lines = [f"v {x} {y} {z}" for x, y, z in corners.reshape(-1, 3)] + [f"vn {x} {y} {z}" for x, y, z in normals]
    lines += [f"f {3 * n + 1}//{n + 1} {3 * n + 2}//{n + 1} {3 * n + 3}//{n + 1}" for n in range(len(corners))]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def picture(rover: RoverModel) -> ByteArray:
    """Picture (H, W, 3) of a rover with its left front wheel on a block about as high as it climbs."""
    block = block_under(rover)
    pose, angles = on_block(rover, block)
    client = int(pybullet.connect(pybullet.DIRECT))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rover.urdf"
        path.write_text(visible_urdf(rover, Path(folder)), encoding="utf-8")
        place, turn = pose.position_w.tolist(), pose.quaternion_w.tolist()
        body = pybullet.loadURDF(str(path), place, turn, physicsClientId=client)
    for link, (kind, angle) in angles.items():
        if link != physics.CHASSIS:
            pybullet.resetJointState(body, link, angle, physicsClientId=client)
        pybullet.changeVisualShape(body, link, rgbaColor=COLOURS[kind], physicsClientId=client)
    add_box(client, ((-3.0, -3.0, -0.1), (4.0, 4.0, 0.0)), GROUND)
    add_box(client, block, BLOCK)
    image = render(client, rover, place)
    pybullet.disconnect(physicsClientId=client)
    return image


def block_under(rover: RoverModel) -> Block:
    """A block ahead of the left wheels."""
    wheel, reach = rover.wheel, rover.track_m / 2
    front, side = wheel.positions_m[0][0], 1.5 * wheel.width_m
    low = (front + 1.5 * wheel.radius_m, reach - side, -0.05)
    height = min(rover.climb_height_m, 0.85 * wheel.radius_m)  # a step is harder to climb than a rock
    return low, (front + 1.0, reach + side, height)


def on_block(rover: RoverModel, block: Block) -> tuple[Pose, dict[int, tuple[str, float]]]:
    """Pose with the left front wheel on the block, and kind and angle of every link."""
    world = make_world(slope(0.0), mesh=box_mesh(*block))
    wheels = len(rover.wheel.positions_m)
    with Simulation(world, rover, np.random.default_rng(0)) as simulation:
        goal = block[0][0] - 0.35 * rover.wheelbase_m
        while simulation.state.pose.position_w[0] < goal and simulation.time_s < 8.0:
            simulation.step([1.5] * wheels)
        body = simulation._body  # noqa: SLF001 - to be copied
        states = pybullet.getJointStates(body.body, body.joints, simulation.client)
        kinds = ["wheel"] * wheels + ["arm"] * len(body.arms)
        links = {link: (kind, state[0]) for link, kind, state in zip(body.joints, kinds, states, strict=True)}
        return simulation.state.pose, {physics.CHASSIS: ("chassis", 0.0), **links}


def add_box(client: int, box: Block, colour: tuple[float, float, float, float]) -> None:
    """A box that is only seen."""
    low, high = box
    half = (np.subtract(high, low) / 2).tolist()
    shape = pybullet.createVisualShape(pybullet.GEOM_BOX, halfExtents=half, rgbaColor=colour, physicsClientId=client)
    pybullet.createMultiBody(0.0, -1, shape, (np.add(high, low) / 2).tolist(), physicsClientId=client)


def render(client: int, rover: RoverModel, place: list[float]) -> ByteArray:
    """Picture from ahead and to the left, as large as the rover needs."""
    width, height = SIZE[0] * FINER, SIZE[1] * FINER
    distance = 2.1 * max(rover.footprint().length_m, 0.6)
    view = pybullet.computeViewMatrixFromYawPitchRoll(
        [place[0], place[1], place[2] + 0.05], distance, 152.0, -16.0, 0.0, 2, physicsClientId=client
    )
    projection = pybullet.computeProjectionMatrixFOV(38.0, width / height, 0.05, 20.0)
    _, _, colour, _, _ = pybullet.getCameraImage(
        width,
        height,
        viewMatrix=view,
        projectionMatrix=projection,
        renderer=pybullet.ER_TINY_RENDERER,
        lightDirection=[1.5, 1.2, 3.0],
        shadow=1,
        physicsClientId=client,
    )
    image = np.asarray(colour, dtype=np.uint8).reshape(height, width, 4)[:, :, :3]
    return np.asarray(cv2.resize(image, SIZE, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def main() -> int:
    """Write one picture with all shipped rovers side by side."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images/rovers.png")
    panels = []
    for name in rover_names():
        rover = load_rover(name)
        panel = picture(rover)
        label = f"{name}: {rover.mass_kg:.0f} kg, wheels {200 * rover.wheel.radius_m:.0f} cm"
        cv2.putText(panel, label, (14, 26), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (40, 40, 40), 1, cv2.LINE_AA)
        panels.append(panel)
    with atomic_path(path) as temporary:
        temporary.write_bytes(cv2.imencode(".png", cv2.cvtColor(np.hstack(panels), cv2.COLOR_RGB2BGR))[1].tobytes())
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
