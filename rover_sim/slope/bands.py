"""Published slip-slope curves and the reference bands drawn from them, as data with their sources.

Confidence: "confirmed" was read in the named source, "derived" was computed by us from published data, "unconfirmed" is
second-hand. The bands are our reading of the curves; every point was measured under Earth gravity.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, sqrt

import numpy as np

EARTH_M_S2 = 9.81
_SAME_GRAVITY_M_S2 = 0.05
STALL_SLIP = 0.98  # no slip up to here carries the rover


@dataclass(frozen=True)
class Curve:
    """A published curve over the slope (deg, positive uphill); ``low`` and ``high`` where a spread is known."""

    label: str
    source: str
    confidence: str
    soil: str  # the preset that it may be compared with
    slope_deg: tuple[float, ...]
    value: tuple[float, ...]
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()


@dataclass(frozen=True)
class Band:
    """Slip that agrees with the published curves; a stall agrees as well where ``stall`` says so."""

    low: float
    high: float
    stall: bool = False


def _sutoh(factor: float, rate: float, slopes: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(factor * exp(rate * slope) for slope in slopes)


def _ex1(speed_m_s: float, slope_deg: float) -> float:
    return (0.00522 * speed_m_s + 0.00105) * slope_deg**2 + 0.0265 * speed_m_s + 0.0256


_SUTOH = (
    "Sutoh et al., IEEE Robotics and Automation Magazine 22(1), 2015: form as coded in CAMIS, attribution unconfirmed"
)
_STEEP = tuple(range(26))
_EX1_RANGE = tuple(range(19))
_BINS = (-12.0, -8.0, -4.0, 0.0, 4.0, 8.0, 12.0, 20.0)

SLIP_CURVES: tuple[Curve, ...] = (
    Curve("Sutoh form, wheels", _SUTOH, "code confirmed", "loose_sand", _STEEP, _sutoh(0.07, 0.10, _STEEP)),
    Curve(
        "EX1 at 0.1 m/s",
        "Kern et al. 2026 (arXiv 2601.04547), Tohoku silica sand No. 5, slopes up to 18 deg; from a summary",
        "unconfirmed",
        "loose_sand",
        _EX1_RANGE,
        tuple(_ex1(0.1, slope) for slope in _EX1_RANGE),
    ),
    Curve(
        "Cuadriga, median and quartiles",
        "field drives of a skid-steer vehicle on natural ground, 467 windows of 3 s, binned by us",
        "derived",
        "firm",
        _BINS,
        (0.040, 0.010, -0.017, 0.000, 0.001, 0.001, 0.040, 0.196),
        (-0.010, -0.039, -0.060, -0.037, -0.046, -0.041, -0.009, 0.178),
        (0.055, 0.047, 0.016, 0.041, 0.038, 0.029, 0.081, 0.204),
    ),
)
SLIP_ANGLE_CURVES: tuple[Curve, ...] = (
    Curve("Sutoh form, wheels", _SUTOH, "code confirmed", "loose_sand", _STEEP, _sutoh(1.32, 0.16, _STEEP)),
)
# Heverly et al., J. Field Robotics 30(6), 2013, known second-hand: what a full-size test rover did on loose sand.
EVENTS: tuple[tuple[float, str], ...] = (
    (10.0, "moderate slip"),
    (17.0, "embeds"),
)
EVENTS_SOURCE = "MSL test rover on cohesionless sand (Heverly 2013, unconfirmed)"

_STALLED = Band(STALL_SLIP, 1.0, stall=True)
_BANDS: Mapping[str, Mapping[float, Band]] = {
    "loose_sand": {
        0.0: Band(0.02, 0.10),
        5.0: Band(0.05, 0.15),
        10.0: Band(0.14, 0.24),
        15.0: Band(0.28, 0.45),
        17.5: Band(0.37, 0.60),
        20.0: Band(0.50, 1.0, stall=True),
        25.0: _STALLED,
    },
    "firm": {
        0.0: Band(-0.03, 0.03),
        5.0: Band(-0.03, 0.03),
        10.0: Band(-0.04, 0.04),
        15.0: Band(0.02, 0.12),
        20.0: Band(0.12, 0.28),
    },
}
_STALLS_ABOVE_DEG = {"loose_sand": 25.0}


def slip_band(soil: str, gravity_m_s2: float, direction: str, slope_deg: float) -> Band | None:
    """The reference band for a drive; None where nothing was published for it.

    Between the slopes of the reference both ends are interpolated.
    """
    bands = _BANDS.get(soil)
    if bands is None or direction != "up" or abs(gravity_m_s2 - EARTH_M_S2) > _SAME_GRAVITY_M_S2:
        return None
    if slope_deg >= _STALLS_ABOVE_DEG.get(soil, 90.0):
        return _STALLED
    slopes = sorted(bands)
    if not slopes[0] <= slope_deg <= slopes[-1]:
        return None
    low = float(np.interp(slope_deg, slopes, [bands[slope].low for slope in slopes]))
    high = float(np.interp(slope_deg, slopes, [bands[slope].high for slope in slopes]))
    below = max(slope for slope in slopes if slope <= slope_deg)
    return Band(low, high, bands[below].stall)


def band_slopes(soil: str) -> tuple[float, ...]:
    """The slopes at which a soil has a reference band of its own; none for most soils."""
    return tuple(sorted(_BANDS.get(soil, {})))


def is_inside(band: Band | None, slip: float, *, stuck: bool) -> bool | None:
    """Whether a measured slip lies in its band; None without a band."""
    if band is None:
        return None
    return (band.stall and stuck) or band.low <= slip <= band.high


def pioneer_track_ratio(path_curvature: float) -> float:
    """Effective track ratio of a Pioneer-class robot over lambda = (V_r + V_l) / (V_r - V_l), 0 on the spot.

    Form of Wang et al., Sensors 15(5), 9681-9702, 2015; its coefficients as coded in a public skid-steer odometry
    (unconfirmed).
    """
    return 1.0 + 0.4728 / (1.0 + 0.0538 * sqrt(abs(path_curvature)))
