"""Draws docs/images/sensors.png: what the sensors with the figures of their tables do, beside what those figures say.

uv run python scripts/draw_sensors.py [OUT.png]
"""

from __future__ import annotations

import sys
from math import radians
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from rover_sim.sim import gnss, imu
from rover_sim.sim.ned_state import STANDARD_GRAVITY_M_S2, NedState
from worlds.sensor_tables import Gnss, Imu
from worlds.types import FloatArray

mpl.use("Agg")
from matplotlib import pyplot as plt

OUT = Path(__file__).resolve().parents[1] / "docs" / "images" / "sensors.png"
FLICKER = 0.664  # Allan deviation of flicker over its bias instability


def standing(time_s: float, speed_m_s: float = 0.0) -> NedState:
    """A level rover that stands at the start, or shakes as at a speed."""
    held = (0.0, 0.0, -STANDARD_GRAVITY_M_S2)
    return NedState(time_s, (0.0,) * 3, (speed_m_s, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0,) * 3, held)


def record(table: Imu, count: int, step_s: float, speed_m_s: float = 0.0) -> FloatArray:
    """Errors (count, 6): rates, then forces."""
    rng = np.random.default_rng(1)
    model = imu.imu_model(table, "sand")
    state, rows = imu.begin(model, rng), np.empty((count, 6))
    for row in range(count):
        state, sample = imu.read(model, state, standing(row * step_s, speed_m_s), rng)
        rows[row] = *sample.rate_rad_s, *sample.specific_force_m_s2
    return np.asarray(rows - rows.mean(axis=0))


def allan(rows: FloatArray, step_s: float) -> tuple[FloatArray, FloatArray]:
    """Times (k,) and overlapping Allan deviations (k, channels)."""
    counts = np.unique(np.geomspace(1, len(rows) // 8, 40).astype(int))
    sums = np.vstack([np.zeros(rows.shape[1]), np.cumsum(rows, axis=0)])
    means = [(sums[n:] - sums[:-n]) / n for n in counts]
    found = [np.sqrt(0.5 * np.mean((m[n:] - m[:-n]) ** 2, axis=0)) for m, n in zip(means, counts, strict=True)]
    return counts * step_s, np.array(found)


def draw_allan(axes: Any, table: Imu) -> None:
    """The gyroscope's deviation with the lines of its figures."""
    times, found = allan(record(table, 200_000, 0.1), 0.1)
    axes.loglog(times, np.degrees(found[:, :3]) * 3600.0, color="tab:blue", lw=0.8)
    axes.loglog(
        times, table.gyro_noise_deg_s_rthz * 3600.0 / np.sqrt(2.0 * times), "k--", lw=0.8, label="noise density"
    )
    axes.axhline(FLICKER * table.gyro_instability_deg_h, color="k", ls=":", lw=0.8, label="bias instability")
    axes.loglog(times, table.gyro_walk_deg_h_rth * np.sqrt(times / 3600.0 / 3.0), "k-.", lw=0.8, label="random walk")
    axes.set(title="gyroscope at rest, three axes", xlabel="averaged over, s", ylabel="Allan deviation, deg/h")
    axes.legend(fontsize=7)


def draw_shaking(axes: Any, table: Imu) -> None:
    """Spectrum of the vertical force at two speeds."""
    for speed in (0.5, 1.0):
        rows = record(table, 24_000, 1 / 240, speed)[:, 5].reshape(-1, 1200) * np.hanning(1200)
        power = np.mean(np.abs(np.fft.rfft(rows, axis=1)) ** 2, axis=0) * 2.0 / 240.0 / np.sum(np.hanning(1200) ** 2)
        axes.loglog(np.fft.rfftfreq(1200, 1 / 240)[1:], np.sqrt(power[1:]), lw=0.8, label=f"{speed:g} m/s")
    density = 1e-6 * STANDARD_GRAVITY_M_S2 * table.accel_noise_ug_rthz
    axes.axhline(density, color="k", ls="--", lw=0.8, label="noise density")
    axes.set(title="vertical force on sand", xlabel="Hz", ylabel="m/s2/sqrt(Hz)")
    axes.legend(fontsize=7)


def draw_fixes(axes: Any) -> None:
    """Error to the north of two receivers."""
    alone = Gnss(fix="3d", horizontal_m=0.3, vertical_m=0.5, wander_m=1.2, wander_time_s=120.0)
    for table, name, scale in ((Gnss(), "as by default, mm", 1e3), (alone, "without corrections, cm", 1e2)):
        rng = np.random.default_rng(2)
        state, errors = gnss.begin(table, 0.0, rng), []
        for fix in range(1500):
            state = gnss.measure(table, state, standing(fix / 5), rng)
            state, sample = gnss.report(table, state, fix / 5 + table.delay_s)
            errors.append(0.0 if sample is None else scale * sample.position_m[0])
        axes.plot(np.arange(1500) / 5, errors, lw=0.6, label=name)
    axes.set(title="fixes of a rover that stands", xlabel="s", ylabel="error to the north")
    axes.legend(fontsize=7)


def main() -> None:
    """Draw and save."""
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(12, 3.6), layout="constrained")
    draw_allan(left, Imu())
    draw_shaking(middle, Imu())
    draw_fixes(right)
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else OUT
    figure.savefig(out, dpi=90)
    print(f"{out}: gyroscope {radians(Imu().gyro_noise_deg_s_rthz):.3g} rad/s/sqrt(Hz)")


if __name__ == "__main__":
    main()
