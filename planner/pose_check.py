"""Whether the rover can stand at a pose: bounds of its lean, clearance and margin from bounds of the ground.

After the idea of ACE (Otsu et al., "Fast approximate clearance evaluation for rovers with articulated suspension
systems", 2020, arXiv 1808.00031): nothing is settled; the lowest and highest ground under each wheel's possible
footprint bound the height of its hub, those bound the lean and the height of the belly. False alarms are allowed,
missed hazards are not. Here the body is rigid: two wheels across a diagonal stand, and the others stand or hang. As the
lean shifts the footprints, the leans are searched by halves: most ranges cannot hold a rest, and over a small one the
heights are nearly certain. The bounds hold for every rest of the rover there, whichever it tips into.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.pose_kernels import Layer, bound_poses
from worlds.errors import InputError
from worlds.types import BoolArray, FloatArray, Footprint, RigidBody


@dataclass(frozen=True)
class PoseLimits:
    """What a safe pose keeps."""

    tilt_rad: float = float(np.deg2rad(30.0))  # as the monitor of the drive
    clearance_m: float = 0.0  # between hull and ground
    margin_rad: float = 0.0  # until the weight acts over a side of the wheels' polygon


@dataclass(frozen=True, eq=False)
class GroundBounds:
    """Where the ground lies in cells ``[iy, ix]``, the first one's corner at ``origin_w``: close to a plane in each."""

    origin_w: FloatArray  # (2,)
    cell_m: float
    layers: Layer  # (4, ny, nx): height in the middle, rise along x and y, and how far (m) the ground may be from that


@dataclass(frozen=True, eq=False)
class PoseBounds:
    """What is certain of each of N poses; arrays (N,), angles in radians."""

    roll: FloatArray  # (N, 2) from and to
    pitch: FloatArray  # (N, 2) nose down positive
    tilt: FloatArray  # at most
    clearance_m: FloatArray  # at least; -inf where the ground is not known
    margin: FloatArray  # at least

    def safe(self, limits: PoseLimits) -> BoolArray:
        """Which poses keep the limits whatever the ground is within its bounds."""
        kept = (self.tilt < limits.tilt_rad) & (self.clearance_m >= limits.clearance_m)
        return np.asarray(kept & (self.margin >= limits.margin_rad))


def rigid_body(footprint: Footprint) -> RigidBody:
    """The body of a rover whose poses can be bounded; InputError for one with arms or other wheels."""
    if footprint.body is None:
        raise InputError(
            f"footprint.body is None ({footprint.wheels} wheels): poses are bounded for a rigid hull on four wheels "
            "at the corners of a rectangle only, not for a rover with arms"
        )
    return footprint.body


def pose_bounds(ground: GroundBounds, poses: FloatArray, body: RigidBody, limits: PoseLimits) -> PoseBounds:
    """Bounds of ``poses`` (N, 3): x, y and heading in the world."""
    hull = (0.5 * body.wheelbase_m, 0.5 * body.track_m, body.wheel_radius_m, 0.5 * body.wheel_width_m)
    grid = np.array([*ground.origin_w, ground.cell_m])
    found = np.empty((len(poses), 8))
    bound_poses(
        ground.layers,
        grid,
        np.ascontiguousarray(poses, dtype=np.float64),
        np.array([*hull, *body.centre_of_mass_m]),
        np.array(body.undersides_m),
        (limits.tilt_rad, limits.clearance_m, limits.margin_rad),
        found,
    )
    return PoseBounds(found[:, 0:2], found[:, 2:4], found[:, 4], found[:, 5], found[:, 6])
