"""Obstacle-course worlds of the BARN benchmark (Perille et al., SSRR 2020) as scenarios, and its score.

Cylinders of 0.075 m radius on a 0.15 m lattice, start (-2.25, 3) facing +y, goal (-2.25, 13), success within 1 m, any
contact a collision, 100 s. Reference paths are lattice cells; their length includes the straight pieces from the
start and to the goal, as in the benchmark.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rover_sim.errors import InputError
from worlds.scenario import Camera, Goal, Obstacle, Rocks, RoverChoice, Scenario, Sensors, SoilChoice, Terrain
from worlds.types import FloatArray

RADIUS_M, HEIGHT_M = 0.075, 1.0
START_M, GOAL_M, GOAL_RADIUS_M = (-2.25, 3.0), (-2.25, 13.0), 1.0
TIME_LIMIT_S = 100.0
FULL_SPEED_M_S = 2.0
_LATTICE_M = 2.0 * RADIUS_M
_FIRST_CELL_M = (-RADIUS_M - 30 * _LATTICE_M, RADIUS_M + 5.0)  # place of the reference path's cell (0, 0)
_PATTERN = "barn_*.npz"


@dataclass(frozen=True, eq=False)
class Course:
    """One world."""

    number: int
    cylinders_m: FloatArray  # (N, 2)
    path_m: FloatArray  # (M, 2) reference path with start and goal

    @property
    def reference_m(self) -> float:
        """Length of the reference path."""
        return float(np.linalg.norm(np.diff(self.path_m, axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class CourseMaps:
    """The worlds of a folder, by number."""

    folder: Path
    _cylinders: Mapping[int, FloatArray]
    _paths: Mapping[int, FloatArray]

    @classmethod
    def read(cls, folder: Path) -> CourseMaps:
        """All worlds in the files ``barn_*.npz`` of a folder: arrays ``cyl_N`` (places, metres) and ``path_N`` (cells).

        Raises InputError where there is no such folder, file or world.
        """
        files = sorted(folder.glob(_PATTERN)) if folder.is_dir() else []
        if not files:
            what = f"no {_PATTERN} in it" if folder.is_dir() else "no such folder"
            raise InputError(f"--worlds {folder}: {what}; give the folder of the BARN worlds")
        cylinders: dict[int, FloatArray] = {}
        paths: dict[int, FloatArray] = {}
        for file in files:
            try:
                with np.load(file) as arrays:
                    cylinders |= {int(name[4:]): arrays[name] for name in arrays.files if name.startswith("cyl_")}
                    paths |= {int(name[5:]): arrays[name] for name in arrays.files if name.startswith("path_")}
            except (ValueError, OSError) as error:
                raise InputError(
                    f"--worlds {file}: cannot be read ({error}); arrays cyl_N and path_N are wanted"
                ) from error
        if not cylinders or cylinders.keys() != paths.keys():
            raise InputError(f"--worlds {folder}: a world is an array cyl_N and one path_N; some are missing")
        return cls(folder, cylinders, paths)

    @property
    def numbers(self) -> list[int]:
        """Numbers of the worlds, ascending."""
        return sorted(self._cylinders)

    def course(self, number: int) -> Course:
        """One world; raises InputError for a number that the folder has not."""
        if number not in self._cylinders:
            known = self.numbers
            raise InputError(f"--cells world={number}: {self.folder} holds worlds {known[0]} to {known[-1]}")
        cells = np.asarray(self._paths[number], dtype=np.float64)
        path = np.vstack([START_M, np.asarray(_FIRST_CELL_M) + _LATTICE_M * cells, GOAL_M])
        return Course(number, np.asarray(self._cylinders[number], dtype=np.float64), path)


def course_scenario(course: Course, *, laser: bool) -> Scenario:
    """The world as a scenario: the Jackal on level firm ground on Earth, with laser or with the camera alone."""
    return Scenario(
        name=f"course-{course.number}",
        gravity_m_s2=9.81,
        terrain=Terrain(kind="flat", size_m=(24.0, 24.0), resolution_m=0.1),
        rocks=Rocks(cfa=0.0),
        obstacle=tuple(
            Obstacle(kind="cylinder", position_m=(float(x), float(y)), radius_m=RADIUS_M, height_m=HEIGHT_M)
            for x, y in course.cylinders_m
        ),
        soil=SoilChoice(preset="firm", ruts=False),
        rover=RoverChoice(model="jackal", start_m=START_M, heading_deg=90.0),
        goal=Goal(position_m=GOAL_M, radius_m=GOAL_RADIUS_M, time_limit_s=TIME_LIMIT_S),
        sensors=Sensors(laser=laser),
        camera=Camera(rate_hz=0.0 if laser else 2.0),
    )


def score(reference_m: float, time_s: float, *, success: bool) -> float:
    """The benchmark's metric: optimal time over time taken, the latter held to 2..8 optimal times; 0 for a failure."""
    optimal = reference_m / FULL_SPEED_M_S
    return optimal / float(np.clip(time_s, 2.0 * optimal, 8.0 * optimal)) if success else 0.0
