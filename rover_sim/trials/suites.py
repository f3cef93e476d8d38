"""What the suites consist of: dimensions with their usual values, and the trial of each combination and seed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import msgspec

from rover_sim.errors import InputError
from rover_sim.trials.course import CourseMaps, course_scenario
from rover_sim.trials.routes import DISTANCES_M, GROUNDS, YARD, YARD_REACH_M, route_scenario
from rover_sim.trials.trial import Trial, Value
from worlds.scenario import Scenario, SoilChoice, check_scenario, load_scenario, shipped_scenarios

Choices = Mapping[str, Sequence[Value]]

NAV: Choices = {
    "cfa": (0.02, 0.05, 0.07, 0.10, 0.15, 0.20),
    "slope_deg": (0.0, 5.0, 10.0),
    "soil": ("firm", "mars_sand", "loose_sand"),
    "sensors": ("camera",),
}
EYES = ("camera", "stereo")  # of the suites nav and route; the first is the usual one
SENSORS = ("laser", "camera")
SUITES = ("nav", "obstacle-course", "route")
_GOLDEN_DEG = 180.0 * (3.0 - math.sqrt(5.0))  # successive seeds climb in directions spread evenly


def trials_of(suite: str, chosen: Choices, seeds: Sequence[int], worlds: Path | None) -> list[Trial]:
    """The trials of a suite, or of a scenario; ``chosen`` replaces the usual values of some dimensions.

    Raises InputError for an unknown suite, dimension or value, and for a folder without worlds.
    """
    if suite not in {"obstacle-course", "route"} and worlds is not None:
        raise InputError(f"--worlds {worlds}: only the suites obstacle-course and route take a folder of worlds")
    if suite == "nav":
        return _nav(_choices(suite, NAV, chosen), seeds)
    if suite == "route":
        return _route(chosen, seeds, worlds)
    if suite == "obstacle-course":
        if worlds is None:
            raise InputError("--worlds: the suite obstacle-course needs the folder that holds the files barn_*.npz")
        maps = CourseMaps.read(worlds)
        usual: Choices = {"sensors": SENSORS[:1], "world": tuple(float(number) for number in maps.numbers)}
        return _course(_choices(suite, usual, chosen), maps, seeds)
    return _scenario(suite, chosen, seeds)


def _choices(suite: str, usual: Choices, chosen: Choices) -> dict[str, Sequence[Value]]:
    for name, values in chosen.items():
        if name not in usual:
            raise InputError(f"--cells {name}: the suite {suite} has no such dimension; allowed: {', '.join(usual)}")
        wants_text = isinstance(usual[name][0], str)
        wrong = [value for value in values if isinstance(value, str) is not wants_text]
        if wrong:
            raise InputError(f"--cells {name}={wrong[0]}: must be {'text' if wants_text else 'a number'}")
    return {**usual, **chosen}


def _nav(choices: Choices, seeds: Sequence[int]) -> list[Trial]:
    base = load_scenario("rock-field")
    grid = [dict(zip(choices, values, strict=True)) for values in product(*choices.values())]
    return [Trial("nav", _told(cell), seed, _nav_scenario(base, cell, seed)) for cell in grid for seed in seeds]


def _told(cell: Mapping[str, Value]) -> dict[str, Value]:
    """The cell without the usual sensors, so that keys of tables from before there was a choice still hold."""
    return {name: value for name, value in cell.items() if (name, value) != ("sensors", EYES[0])}


def _nav_scenario(base: Scenario, cell: Mapping[str, Value], seed: int) -> Scenario:
    """The rock field of one cell; with the seed the slope turns, so that a cell has all of up, down and across."""
    azimuth = (seed * _GOLDEN_DEG) % 360.0
    terrain = msgspec.structs.replace(
        base.terrain, slope_deg=float(cell["slope_deg"]), slope_azimuth_deg=round(azimuth, 3)
    )
    scenario = msgspec.structs.replace(
        base,
        name="nav",
        terrain=terrain,
        rocks=msgspec.structs.replace(base.rocks, cfa=float(cell["cfa"])),
        soil=SoilChoice(preset=str(cell["soil"])),
    )
    return _with_eyes(scenario, cell)


def _with_eyes(scenario: Scenario, cell: Mapping[str, Value]) -> Scenario:
    """The scenario with the cell's eyes, one or two."""
    if cell["sensors"] not in EYES:
        raise InputError(f"--cells sensors={cell['sensors']}: allowed are {' and '.join(EYES)}")
    sensors = msgspec.structs.replace(scenario.sensors, stereo=cell["sensors"] == "stereo")
    scenario = msgspec.structs.replace(scenario, sensors=sensors)
    check_scenario(scenario, "--cells")
    return scenario


def _route(chosen: Choices, seeds: Sequence[int], worlds: Path | None) -> list[Trial]:
    """Synthetic ground by default; with a folder of worlds the real map, unless ``ground`` is chosen."""
    real: Choices = {"ground": (YARD,), "distance_m": (2.0 * YARD_REACH_M,), "sensors": EYES[:1]}
    synthetic: Choices = {"ground": GROUNDS, "distance_m": DISTANCES_M, "sensors": EYES[:1]}
    choices = _choices("route", synthetic if worlds is None else real, chosen)
    grid = [dict(zip(choices, values, strict=True)) for values in product(*choices.values())]
    # Dunes run along y, so that what is there to cross is asked for in every direction.
    turns = {seed: math.radians((seed * _GOLDEN_DEG) % 360.0) for seed in seeds}
    return [
        Trial("route", _told(cell), seed, _with_eyes(route_scenario(cell, turns[seed], worlds), cell))
        for cell in grid
        for seed in seeds
    ]


def _course(choices: Choices, maps: CourseMaps, seeds: Sequence[int]) -> list[Trial]:
    for sensors in choices["sensors"]:
        if sensors not in SENSORS:
            raise InputError(f"--cells sensors={sensors}: allowed are {' and '.join(SENSORS)}")
    trials = []
    for sensors, number in product(choices["sensors"], choices["world"]):
        course = maps.course(int(number))
        trial = Trial(
            "obstacle-course",
            {"sensors": sensors},
            seeds[0],
            course_scenario(course, laser=sensors == "laser"),
            variant={"world": number},
            touch_ends=True,
            reference_m=course.reference_m,
        )
        trials += [replace(trial, seed=seed) for seed in seeds]
    return trials


def _scenario(name_or_path: str, chosen: Choices, seeds: Sequence[int]) -> list[Trial]:
    if name_or_path not in shipped_scenarios() and not Path(name_or_path).is_file():
        raise InputError(
            f"{name_or_path}: no such suite; allowed: {', '.join(SUITES)}, or a scenario "
            f"({', '.join(shipped_scenarios())}, or a TOML file)"
        )
    if chosen:
        raise InputError(f"--cells {next(iter(chosen))}: a scenario is one cell")
    scenario = load_scenario(name_or_path)
    return [Trial(scenario.name, {"scenario": scenario.name}, seed, scenario) for seed in seeds]
