"""Driving one trial, in a process of its own, and what its row says beside the summary."""

from __future__ import annotations

import shutil
import time
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np

from planner.route import CostMap, Route, way_cost, without_limits
from planner.route_following import Following
from rover_sim import __version__
from rover_sim.trials.course import score
from rover_sim.trials.trial import Row, Trial
from worlds.types import FloatArray

Keep = Literal["failures", "all", "none"]
RUNS = "runs"  # sub-folder of the kept run folders
SCRATCH = ".trial-"
DROP_M = 0.1
DRIVEN_POINTS = 500  # of the way driven, for its cost
UNTOLD = ("events", "scenario", "seed")  # of the summary: long, or said elsewhere in the row


def drive(trial: Trial, folder: Path, keep: Keep) -> Row:
    """The row of a trial; its run folder is kept in ``folder``/runs as asked."""
    from rover_sim import run_folder
    from rover_sim.sights import Sights
    from rover_sim.sim.rover import load_rover
    from rover_sim.traverse import RunOptions, open_traverse
    from rover_sim.trials.oracle import best_route, oracle_length_m, way_there
    from worlds.build import build_world

    begun = time.perf_counter()
    scenario = trial.scenario
    rover = load_rover(scenario.rover.model)
    world = build_world(scenario, trial.seed, source=trial.key)
    judge = None if scenario.route is None else best_route(world, rover.footprint())
    if judge is None:
        oracle_m = oracle_length_m(world, rover.footprint())
    else:
        oracle_m = judge[1].length_m if judge[1].refusal is None else None
    with TemporaryDirectory(dir=folder, prefix=SCRATCH) as scratch:
        tlog = None if keep == "none" else Path(scratch) / run_folder.TLOG
        options = RunOptions(any_touch_ends=trial.touch_ends)
        with (
            open_traverse(world, rover, options, tlog) as traverse,
            Sights(np.inf, None, scenario.camera.rate_hz) as sights,
        ):
            summary = traverse.run(on_sight=sights.take)
            figures = trial_figures(trial, summary, traverse.recorder.arrays(), oracle_m)
            if judge is not None and traverse.route is not None:
                figures |= route_figures(traverse.route, *judge, traverse.recorder.arrays())
                figures["way"] = way_there(world, rover.footprint(), judge[1])
            kept = keep == "all" or (keep == "failures" and not (summary["success"] and not figures["violations"]))
            if kept:
                run_folder.write(Path(scratch), traverse, sights, summary)
        if kept:
            _keep(Path(scratch), folder / RUNS / trial.folder_name)
    metrics = {name: value for name, value in summary.items() if name not in UNTOLD} | figures
    metrics["run_folder"] = f"{RUNS}/{trial.folder_name}" if kept else None
    wall_s = round(time.perf_counter() - begun, 3)
    return Row(
        trial.key,
        trial.suite,
        trial.cell,
        trial.seed,
        summary["success"],
        summary["reason"],
        metrics,
        None,
        wall_s,
        __version__,
    )


def lost(trial: Trial, error: str) -> Row:
    """The row of a trial that gave no result."""
    return Row(trial.key, trial.suite, trial.cell, trial.seed, False, "error", {}, error, 0.0, __version__)


def trial_figures(
    trial: Trial, summary: Mapping[str, Any], trace: Mapping[str, FloatArray], oracle_m: float | None
) -> dict[str, Any]:
    """What a trial tells beside the summary: the oracle's way, SPL, safety violations by kind, refusal, score."""
    success, driven = bool(summary["success"]), float(summary["distance_m"])
    spl = None if oracle_m is None else success * oracle_m / max(driven, oracle_m, 1e-9)
    optional = {}
    if trial.reference_m is not None:
        optional["reference_length_m"] = round(trial.reference_m, 4)
        optional["score"] = round(score(trial.reference_m, summary["sim_time_s"], success=success), 4)
    return {
        **trial.variant,
        "oracle_length_m": None if oracle_m is None else round(oracle_m, 4),
        "spl": None if spl is None else round(spl, 4),
        "violations": violations(summary, trace, trial.scenario.gravity_m_s2),
        "refused": summary["reason"] == "no_path" and oracle_m is None,
        **optional,
    }


def route_figures(
    following: Following, true_map: CostMap, best: Route, trace: Mapping[str, FloatArray]
) -> dict[str, Any]:
    """Over the true map: cost of the best route, of the first one planned and of the way driven, and their ratios.

    A cost is None where there is no such way, or where it is steeper somewhere than a route may be; in
    ``planned_over_best`` and ``driven_over_best`` such a place costs what its slope does.
    """
    first = following.routes[0] if following.routes else following.route
    driven = trace["position_w"][:: max(1, len(trace["position_w"]) // DRIVEN_POINTS), :2]
    costs = {
        "oracle_cost": best.cost,
        "planned_cost": way_cost(true_map, first.way_w) if len(first.way_w) else np.inf,
        "driven_cost": way_cost(true_map, driven) if len(driven) > 1 else np.inf,
    }
    told = {name: round(cost, 2) if np.isfinite(cost) else None for name, cost in costs.items()}
    free = without_limits(true_map)
    over = {
        "planned_over_best": way_cost(free, first.way_w) if len(first.way_w) else np.inf,
        "driven_over_best": way_cost(free, driven) if len(driven) > 1 else np.inf,
    }
    return {
        **told,
        **{name: _over(cost, best) for name, cost in over.items()},
        "cost_ratio": _over(costs["planned_cost"], best),
        "refused_at_once": first.refusal is not None,
        "replans": len(following.routes),
    }


def _over(cost: float, best: Route) -> float | None:
    """A cost over that of the best route; None where one of them is none."""
    return round(cost / best.cost, 4) if np.isfinite(cost) and best.refusal is None else None


def violations(summary: Mapping[str, Any], trace: Mapping[str, FloatArray], gravity_m_s2: float) -> list[str]:
    """Which limits of safety were broken: ``tip``, ``collision`` of the body, ``belly`` contact, ``drop``.

    A drop is a downward speed that a free fall of 0.1 m gives.
    """
    falling = float(-trace["velocity_w"][:, 2].min(initial=0.0))
    found = {
        "tip": summary["reason"] == "tipped",
        "collision": summary["reason"] == "collision" or summary["collisions"] > 0,
        "belly": summary["event_counts"]["high_centred"] > 0,
        "drop": falling > (2.0 * gravity_m_s2 * DROP_M) ** 0.5,
    }
    return [name for name, broken in found.items() if broken]


def _keep(scratch: Path, target: Path) -> None:
    """Move what a run left to its place, in the stead of an earlier run's."""
    target.parent.mkdir(exist_ok=True)
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(scratch, target)
