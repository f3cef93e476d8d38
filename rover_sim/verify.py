"""A plan made from a picture, verified by driving it in simulation (2004 paper, section 3, third phase).

Each path is uploaded as a mission to the built-in autopilot, which drives it through the virtual terrain with the whole
physics and closed eyes: what is judged is the path, not what another look would have changed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_sim.given_way import Way
from rover_sim.outcome import Reason
from rover_sim.sim.rover import RoverModel
from rover_sim.traverse import RunOptions, open_traverse
from rover_sim.trials.drive import violations
from rover_sim.verdict import Verdict
from worlds.geometry import rotation_from_quaternion
from worlds.rock_shape import outlines
from worlds.types import FloatArray, Footprint, World

FIGURES = (
    "reason",
    "detail",
    "sim_time_s",
    "distance_m",
    "collisions",
    "max_tilt_deg",
    "min_stability_margin",
    "mean_slip",
    "max_slip",
    "max_sinkage_m",
    "energy_J",
)
MOST_TILT_DEG = 30.0  # a rover that leans further was not driven safely, even if it came through
MOST_UNSEEN_M = 0.25  # of the way
FAR_M = 10.0  # clearances beyond it are not told apart


@dataclass(frozen=True, eq=False)
class Drive:
    """One path as it was driven."""

    safe: bool
    figures: Mapping[str, Any]  # FIGURES, ``largest_cross_track_m``, ``clearance_m`` and ``violations``
    track_w: FloatArray  # (N, 2) true places of the rover


@dataclass(frozen=True, eq=False)
class Check:
    """A drive, and how much of it led over ground that the picture does not show."""

    drive: Drive
    unseen_m: float

    @property
    def fault(self) -> str:
        """Why the path failed, in a word or two; empty if it did not."""
        figures = self.drive.figures
        if not self.drive.safe:
            return str(figures["reason"]) if figures["reason"] != Reason.GOAL else _unsafe(figures)
        # The physics may carry the rover over it, but a height read off a picture is not to be relied on.
        over = figures["clearance_m"] is not None and figures["clearance_m"] <= 0.0
        return "over a rock too high to climb" if over else ""

    @property
    def verdict(self) -> Verdict:
        """What the plan is worth."""
        if self.fault:
            return Verdict.FAILED
        return Verdict.VERIFIED if self.unseen_m <= MOST_UNSEEN_M else Verdict.UNSEEN


def drive_way(world: World, rover: RoverModel, way: Way) -> Drive:
    """Drive ``way`` in ``world``, whose start is the way's first point and whose goal is its last.

    Safe: the end reached, none of the violations that trials count (tip, collision, belly, drop), the tilt within 30
    degrees.
    """
    with open_traverse(world, rover, RunOptions(way=way)) as traverse:
        summary = traverse.run()
        trace = traverse.recorder.arrays()
    track = trace["position_w"][:, :2]
    figures = {name: summary[name] for name in FIGURES}
    figures["largest_cross_track_m"] = round(float(cross_track_m(track, np.array(way.points_w)).max()), 4)
    clearance = clearance_m(world, rover.footprint(), trace)
    figures["clearance_m"] = None if clearance is None else round(clearance, 4)
    figures["violations"] = violations(summary, trace, world.scenario.gravity_m_s2)
    safe = summary["success"] and not figures["violations"] and summary["max_tilt_deg"] <= MOST_TILT_DEG
    return Drive(bool(safe), figures, track)


def _unsafe(figures: Mapping[str, Any]) -> str:
    """Why a drive that reached its end was not safe."""
    return ", ".join(figures["violations"]) or "leaned too far"


def cross_track_m(track_w: FloatArray, way_w: FloatArray) -> FloatArray:
    """Distance (N,) of places (N, 2) from a polyline (M, 2), M >= 2."""
    start, along = way_w[:-1], np.diff(way_w, axis=0)
    offset = track_w[:, None] - start
    share = (offset * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-12)
    nearest = start + np.clip(share, 0.0, 1.0)[..., None] * along
    return np.asarray(np.linalg.norm(track_w[:, None] - nearest, axis=2).min(axis=1))


def clearance_m(world: World, footprint: Footprint, trace: Mapping[str, NDArray[np.float64]]) -> float | None:
    """Least distance seen from above between the rover's outline and a rock that it cannot drive over.

    Measured at the points of the rocks' outlines; None where no such rock comes within 10 m.
    """
    rocks = world.rocks.chosen(world.rocks.extents_m[:, 2] > footprint.climb_height_m)
    if not len(rocks):
        return None
    edges = outlines(rocks.section_ratio, rocks.extents_m[:, 0], rocks.extents_m[:, 1], rocks.yaw_rad)
    points = (edges + rocks.position_w[:, None, :2]).reshape(-1, 2)
    half = np.array([footprint.length_m, footprint.width_m]) / 2.0
    least = FAR_M
    for place, quaternion in zip(trace["position_w"], trace["quaternion_w"], strict=True):
        axes = rotation_from_quaternion(quaternion)[:2, :2]
        beyond = np.abs((points - place[:2]) @ axes) - half
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        least = min(least, float((outside + np.minimum(beyond.max(axis=1), 0.0)).min()))
    return least if least < FAR_M else None
