"""How far a rover without GNSS is off: by rocks as landmarks, and by dead reckoning alone in the same drives.

    uv run python benchmarks/landmark_drift.py drive [--seeds 400 450] [--metres 100] [--out drift.jsonl]
    uv run python benchmarks/landmark_drift.py goals [--seeds 400 420] [--out goals.jsonl]
    uv run python benchmarks/landmark_drift.py report drift.jsonl [--plot drift.png]
    uv run python benchmarks/landmark_drift.py report goals.jsonl

Each drive is a whole closed loop on loose sand, 5 % of it under rocks: planner, map and autopilot live on the estimate.
The ground is tilted by 0 to 15 degrees in any direction and rolls the less the more it is tilted, so that the steepest
hundredth of it has 15 to 17 degrees over a metre in every drive. One line of JSON a drive is appended to the file;
seeds that are in it are left out, so that a series can be stopped and gone on with. ``report`` gives error over
distance, the ratio to dead reckoning, and the normalised estimation error squared (NEES) of the place against its 95 %
band: for N drives N times its mean is chi-square distributed with 2 N degrees of freedom where the claimed covariance
is right (Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, section 5.4).
``goals``: 20 m of the trials' rock field, 7 % rocks, 10 degrees, mars_sand, with GNSS and without, both with two
cameras. Seeds under 400 were looked at while the filter was made.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import chi2

from planner import localization
from rover_sim.autopilot.tuning import tuned_autopilot
from rover_sim.driven_rover import DrivenRover, home
from rover_sim.mavlink.stack import MavlinkStack
from rover_sim.sim.rover import load_rover
from rover_sim.traverse import RunOptions, Traverse, open_traverse
from rover_sim.trials.statistics import wilson
from rover_sim.trials.suites import trials_of
from worlds.build import build_world
from worlds.scenario import Goal, Rocks, RoverChoice, Scenario, Sensors, SoilChoice, Terrain, without_gnss

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rover_sim.autopilot.autopilot import Autopilot
    from worlds.types import FloatArray, PoseEstimate, SensorReadings

STREAM = 77  # of the seed, for the tilt
EVERY_M = 5.0
MARGIN_M = 20.0
STEEPEST_DEG = 15.0
ROUGHNESS_M = 0.02, 0.13  # on the steepest slope, and so much more on the level


def scenario(seed: int, metres: float) -> Scenario:
    """The ground of one drive."""
    rng = np.random.default_rng([seed, STREAM])
    slope_deg, azimuth_deg = rng.uniform(0.0, STEEPEST_DEG), rng.uniform(0.0, 360.0)
    return Scenario(
        name="landmark-drift",
        terrain=Terrain(
            kind="fractal",
            size_m=(metres + MARGIN_M, 40.0),
            roughness_m=float(ROUGHNESS_M[0] + (1.0 - slope_deg / STEEPEST_DEG) * ROUGHNESS_M[1]),
            slope_deg=float(slope_deg),
            slope_azimuth_deg=float(azimuth_deg),
        ),
        rocks=Rocks(cfa=0.05, clear_radius_m=2.0),
        soil=SoilChoice(preset="loose_sand"),
        rover=RoverChoice(),
        goal=Goal(position_m=(metres, 0.0), radius_m=1.5, time_limit_s=8.0 * metres),
        sensors=Sensors(gnss=False, stereo=True),
    )


class Reckoned:
    """A driver who also reckons where the rover would be by wheels, inertial unit and compass alone."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._rover: DrivenRover | None = None
        self._state: localization.LocalizationState | None = None

    def follow(self, rover: DrivenRover) -> None:
        """Begin where ``rover`` believes to be."""
        self._rover, self._state = rover, rover.located

    @property
    def motion(self) -> Any:
        """As the autopilot."""
        return self._autopilot.motion

    @property
    def wheel_speed_rad_s(self) -> tuple[float, ...]:
        """As the autopilot."""
        return self._autopilot.wheel_speed_rad_s

    @property
    def place_w(self) -> FloatArray:
        """Reckoned place (2,)."""
        assert self._state is not None
        return self._state.mean[:2].copy()

    def update(self, time_s: float, estimate: PoseEstimate, readings: SensorReadings) -> tuple[float, ...]:
        """Reckon on, and let the autopilot do its work."""
        if self._state is not None and self._rover is not None:
            self._state = localization.localize(self._state, readings, self._rover.footprint, self._rover.sensor_model)
        return self._autopilot.update(time_s, estimate, readings)


def drive(seed: int, metres: float) -> dict[str, Any]:
    """One drive: its end, and truth, belief, covariance and reckoning every few metres."""
    chosen = scenario(seed, metres)
    world, rover = build_world(chosen, seed), load_rover(chosen.rover.model)
    autopilot = tuned_autopilot(rover.footprint(), home(world), chosen.gravity_m_s2)
    driver, link = Reckoned(autopilot), MavlinkStack(world.origin, autopilot, (), None)
    rows: list[list[float]] = []
    with Traverse(world, rover, driver, link, RunOptions()) as traverse:
        driver.follow(traverse.rover)
        driven, last, ended = 0.0, traverse.simulation.state.pose.position_w[:2].copy(), None
        while ended is None:
            looked, ended = traverse.step()
            if not looked and ended is None:
                continue
            true = traverse.simulation.state.pose.position_w[:2].copy()
            driven, last = driven + float(np.hypot(*(true - last))), true
            if driven >= EVERY_M * (len(rows) + 1) or ended is not None:
                located = traverse.rover.located
                covariance = located.place_covariance[:2, :2].ravel()
                rows.append([driven, *true, *located.mean[:2], *covariance, *driver.place_w])
        summary = traverse.summary(*ended, wall_time_s=0.0)
    return {
        "seed": seed,
        "slope_deg": chosen.terrain.slope_deg,
        "rows": np.round(rows, 5).tolist(),
        **{key: summary[key] for key in ("reason", "detail", "sim_time_s", "distance_m", "mean_slip", "max_tilt_deg")},
    }


def goal(seed: int) -> dict[str, Any]:
    """How a traverse of the rock field ends with GNSS, and how without."""
    cell: dict[str, list[str | float]] = {
        "cfa": [0.07],
        "slope_deg": [10.0],
        "soil": ["mars_sand"],
        "sensors": ["stereo"],
    }
    (trial,) = trials_of("nav", cell, [seed], None)
    row: dict[str, Any] = {"seed": seed}
    for name, chosen in (("gnss", trial.scenario), ("no_gnss", without_gnss(trial.scenario))):
        rover = load_rover(chosen.rover.model)
        with open_traverse(build_world(chosen, seed), rover, RunOptions()) as traverse:
            summary = traverse.run()
        row[name] = {key: summary[key] for key in ("success", "reason", "detail", "distance_m", "place_error_m")}
    return row


def figures(drives: list[dict[str, Any]]) -> dict[str, Any]:
    """The figures of a series."""
    ends = np.array([row["rows"][-1] for row in drives])
    error, reckoned = np.hypot(*(ends[:, 3:5] - ends[:, 1:3]).T), np.hypot(*(ends[:, 9:11] - ends[:, 1:3]).T)
    share, ratio = 100.0 * error / ends[:, 0], reckoned / np.maximum(error, 1e-9)
    nees = _nees(ends)
    low, high = chi2.ppf([0.025, 0.975], 2 * len(ends)) / len(ends)
    return {
        "drives": len(drives),
        "reasons": {reason: sum(d["reason"] == reason for d in drives) for reason in {d["reason"] for d in drives}},
        "metres driven, mean": ends[:, 0].mean(),
        "error, % of the way: mean, median, most": (share.mean(), np.median(share), share.max()),
        "within 1 %": int((share <= 1.0).sum()),
        "dead reckoning, %: mean, median, most": tuple(
            100.0 * f(reckoned / ends[:, 0]) for f in (np.mean, np.median, np.max)
        ),
        "dead reckoning over error: of the means, median": (reckoned.mean() / error.mean(), np.median(ratio)),
        "drives at least 5 times better": int((ratio >= 5.0).sum()),
        "NEES at the end: mean, 95 % band": (nees.mean(), low, high),
        "divergences (NEES over its 99.9 % bound)": int((nees > chi2.ppf(0.999, 2)).sum()),
    }


def goal_figures(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """How many goals were reached with GNSS and without, over the same seeds."""
    came = np.array([[row[name]["success"] for name in ("gnss", "no_gnss")] for row in rows])
    told: dict[str, Any] = {"seeds": len(rows)}
    for column, name in enumerate(("with GNSS", "without")):
        count = int(came[:, column].sum())
        told[f"{name}: reached, Wilson 95 %"] = (count, *wilson(count, len(rows)))
    told["reached only with GNSS, only without"] = (int((came @ [1, -1] > 0).sum()), int((came @ [1, -1] < 0).sum()))
    told["error of the place without, m: mean, most"] = tuple(
        f([row["no_gnss"]["place_error_m"] for row in rows]) for f in (np.mean, np.max)
    )
    return told


def _nees(rows: FloatArray) -> FloatArray:
    off = rows[:, 3:5] - rows[:, 1:3]
    return np.asarray(np.einsum("ni,nij,nj->n", off, np.linalg.inv(rows[:, 5:9].reshape(-1, 2, 2)), off))


def plot(drives: list[dict[str, Any]], path: Path) -> None:
    """Errors over the way, error and claim of the median drive, mean NEES over the way, and shares at the end."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.6), layout="constrained")
    FigureCanvasAgg(figure)
    (over_way, one), (checked, shares) = figure.subplots(2, 2)
    _plot_errors(over_way, drives)
    ends = np.array([row["rows"][-1] for row in drives])
    share, reckoned = (100.0 * np.hypot(*(ends[:, k : k + 2] - ends[:, 1:3]).T) / ends[:, 0] for k in (3, 9))
    _plot_claim(one, drives[int(np.argsort(share)[len(share) // 2])])
    _plot_nees(checked, drives)
    bins = np.geomspace(0.02, 30.0, 30)
    shares.hist(reckoned, bins, color="tab:gray", alpha=0.7, label="dead reckoning")
    shares.hist(share, bins, color="tab:blue", alpha=0.7, label="by rocks")
    shares.axvline(1.0, color="black", linestyle="--")
    shares.set(xscale="log", xlabel="error at the end, % of the way", ylabel=f"drives, of {len(drives)}")
    shares.legend(fontsize=7)
    figure.savefig(path, dpi=110)


def _plot_errors(axes: Axes, drives: list[dict[str, Any]]) -> None:
    for number, row in enumerate(drives):
        table = np.array(row["rows"])
        for column, colour, label in ((9, "tab:gray", "dead reckoning"), (3, "tab:blue", "by rocks")):
            off = np.hypot(*(table[:, column : column + 2] - table[:, 1:3]).T)
            axes.plot(table[:, 0], off, color=colour, linewidth=0.8, label=label if number == 0 else None)
    way = np.linspace(1.0, max(row["rows"][-1][0] for row in drives))
    axes.plot(way, 0.01 * way, color="black", linestyle="--", label="1 % of the way")
    axes.set(xlabel="way driven, m", ylabel="error of the place, m", yscale="log", ylim=(0.01, 20.0))
    axes.legend(fontsize=7)


def _plot_claim(axes: Axes, row: dict[str, Any]) -> None:
    table = np.array(row["rows"])
    off, claimed = table[:, 3:5] - table[:, 1:3], np.sqrt(table[:, [5, 8]])
    for axis, colour, label in ((0, "tab:blue", "east"), (1, "tab:orange", "north")):
        axes.plot(table[:, 0], off[:, axis], color=colour, label=f"error to the {label}")
        for sign in (-1.0, 1.0):
            axes.plot(table[:, 0], sign * 2.0 * claimed[:, axis], color=colour, linestyle=":", linewidth=0.8)
    axes.set(xlabel="way driven, m", ylabel="error, two claimed sigmas, m", title=f"seed {row['seed']}")
    axes.legend(fontsize=7)


def _plot_nees(axes: Axes, drives: list[dict[str, Any]]) -> None:
    steps = range(max(len(row["rows"]) for row in drives) - 1)
    going = [np.array([row["rows"][k] for row in drives if len(row["rows"]) > k + 1]) for k in steps]
    # A drive that ended early counts as far as it went; where most have ended there is no mean of the series.
    going = [table for table in going if 2 * len(table) > len(drives)]
    low, high = chi2.ppf([0.025, 0.975], 2 * len(drives)) / len(drives)
    axes.axhspan(low, high, color="tab:green", alpha=0.2, label="95 % band")
    way, nees = ([float(f(table).mean()) for table in going] for f in (lambda table: table[:, 0], _nees))
    axes.plot(way, nees, color="tab:blue", label=f"mean NEES of {len(drives)} drives")
    axes.set(xlabel="way driven, m", ylabel="NEES of the place, mean", ylim=(0.0, None))
    axes.legend(fontsize=7)


def main() -> None:
    """Drive, or report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="what", required=True)
    driving = commands.add_parser("drive")
    driving.add_argument("--seeds", type=int, nargs=2, default=(400, 450), metavar=("FIRST", "END"))
    driving.add_argument("--metres", type=float, default=100.0)
    driving.add_argument("--out", type=Path, default=Path("drift.jsonl"))
    goals = commands.add_parser("goals")
    goals.add_argument("--seeds", type=int, nargs=2, default=(400, 420), metavar=("FIRST", "END"))
    goals.add_argument("--out", type=Path, default=Path("goals.jsonl"))
    reporting = commands.add_parser("report")
    reporting.add_argument("file", type=Path)
    reporting.add_argument("--plot", type=Path)
    args = parser.parse_args()
    file = args.file if args.what == "report" else args.out
    drives = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    if args.what == "report":
        goals_driven = "gnss" in drives[0]
        for name, value in (goal_figures if goals_driven else figures)(drives).items():
            print(f"{name}: {np.round(value, 2) if not isinstance(value, dict) else value}")
        if args.plot is not None and not goals_driven:
            plot(drives, args.plot)
        return
    for seed in range(*args.seeds):
        if all(row["seed"] != seed for row in drives):
            row = drive(seed, args.metres) if args.what == "drive" else goal(seed)
            with file.open("a") as out:
                out.write(json.dumps(row) + "\n")
            print({key: value for key, value in row.items() if key != "rows"}, flush=True)


if __name__ == "__main__":
    main()
