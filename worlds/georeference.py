"""Where on Earth a GeoTIFF lies: its geo keys, pixel size and the geographic place of its middle.

Source of tags and keys: OGC GeoTIFF Standard 1.1 (2019). Geographic coordinates and UTM are understood; of other
projections the pixel size is used and the place is not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import asin, atan2, atanh, cos, cosh, degrees, hypot, isclose, radians, sin, sinh, sqrt, tanh
from typing import Any

from worlds.errors import ScenarioError

SEMI_MAJOR_M = 6378137.0  # WGS-84; that of ETRS89 and NAD83 is the same to a tenth of a millimetre
FLATTENING = 1.0 / 298.257223563

_PIXEL_SCALE, _TIEPOINT, _TRANSFORMATION, _KEYS, _KEY_NUMBERS = 33550, 33922, 34264, 34735, 34736  # tags
_MODEL, _RASTER, _GEOGRAPHIC, _ANGULAR_UNIT, _ELLIPSOID_AXIS, _PROJECTED, _LINEAR_UNIT = (  # keys
    1024,
    1025,
    2048,
    2054,
    2057,
    3072,
    3076,
)
_PROJECTED_MODEL, _GEOGRAPHIC_MODEL = 1, 2
_PIXEL_IS_POINT = 2
_DEGREE, _METRE = 9102, 9001
_UNIT_M = {_METRE: 1.0, 9002: 0.3048, 9003: 1200.0 / 3937.0}  # metre, foot, US survey foot
_USER_DEFINED = 32767

_UTM_SCALE, _UTM_EAST_M, _UTM_SOUTH_M = 0.9996, 500_000.0, 10_000_000.0
# First EPSG number of zone 1, number of zones, southern: WGS-84 north and south, ETRS89, NAD83.
_UTM_CODES = ((32600, 60, False), (32700, 60, True), (25800, 60, False), (26900, 23, False))


@dataclass(frozen=True)
class Georeference:
    """What a file says of its place."""

    pixel_m: tuple[float, float] | None = None  # eastwards and northwards; None where the file does not say
    place_deg: tuple[float, float] | None = None  # latitude and longitude of the middle of the grid
    note: str | None = None  # one line: why a file with coordinates has no place


def read_georeference(tags: Mapping[int, Any], shape: tuple[int, int]) -> Georeference:
    """The georeference in the ``tags`` of a TIFF of ``shape`` (rows, columns).

    Raises `ScenarioError` for a turned grid and for units that are not known.
    """
    keys = _geo_keys(tags)
    step, corner = _steps_and_corner(tags)
    if step is None:
        return Georeference()
    model = keys.get(_MODEL)
    # A pixel is an area unless the file says otherwise: its coordinates are then those of its upper left corner.
    inset = 1 if keys.get(_RASTER) == _PIXEL_IS_POINT else 0
    middle = None
    if corner is not None:
        middle = (corner[0] + step[0] * (shape[1] - inset) / 2.0, corner[1] - step[1] * (shape[0] - inset) / 2.0)
    if model == _GEOGRAPHIC_MODEL:
        return _geographic(keys, step, middle)
    unit = _UNIT_M.get(int(keys.get(_LINEAR_UNIT, _METRE)))
    if unit is None:
        raise ScenarioError(f"coordinates in unit {keys[_LINEAR_UNIT]} of EPSG; allowed are metres and feet")
    pixel_m = (step[0] * unit, step[1] * unit)
    if model != _PROJECTED_MODEL or middle is None:
        return Georeference(pixel_m)
    code = int(keys.get(_PROJECTED, _USER_DEFINED))
    for first, zones, southern in _UTM_CODES:
        if 1 <= code - first <= zones:
            return Georeference(pixel_m, utm_to_degrees(middle[0] * unit, middle[1] * unit, code - first, southern))
    name = "a projection of its own" if code == _USER_DEFINED else f"projection EPSG:{code}"
    return Georeference(pixel_m, note=f"its place is given in {name}, neither geographic nor UTM")


def utm_to_degrees(east_m: float, north_m: float, zone: int, southern: bool) -> tuple[float, float]:
    """Latitude and longitude of UTM coordinates, WGS-84, to a micrometre within a zone.

    Source: Krueger's series in the third flattening as given by Karney, "Transverse Mercator with an accuracy of a
    few nanometers", J. Geodesy 85 (2011), equations 11, 19 to 21 and 36, to the fourth order.
    """
    n = FLATTENING / (2.0 - FLATTENING)
    radius = SEMI_MAJOR_M / (1.0 + n) * (1.0 + n**2 / 4.0 + n**4 / 64.0) * _UTM_SCALE
    xi = (north_m - (_UTM_SOUTH_M if southern else 0.0)) / radius
    eta = (east_m - _UTM_EAST_M) / radius
    beta = (
        n / 2.0 - 2.0 * n**2 / 3.0 + 37.0 * n**3 / 96.0 - n**4 / 360.0,
        n**2 / 48.0 + n**3 / 15.0 - 437.0 * n**4 / 1440.0,
        17.0 * n**3 / 480.0 - 37.0 * n**4 / 840.0,
        4397.0 * n**4 / 161280.0,
    )
    xi_0 = xi - sum(b * sin(2 * k * xi) * cosh(2 * k * eta) for k, b in enumerate(beta, start=1))
    eta_0 = eta - sum(b * cos(2 * k * xi) * sinh(2 * k * eta) for k, b in enumerate(beta, start=1))
    longitude = radians(6.0 * zone - 183.0) + atan2(sinh(eta_0), cos(xi_0))
    return degrees(_latitude(sin(xi_0) / cosh(eta_0))), (degrees(longitude) + 180.0) % 360.0 - 180.0


def _latitude(sine_conformal: float) -> float:
    """Geographic latitude of the sine of a conformal one, radians, by iteration (Snyder, USGS PP 1395, eq. 3-5)."""
    e = sqrt(FLATTENING * (2.0 - FLATTENING))
    isometric = atanh(sine_conformal)
    sine = sine_conformal
    for _ in range(12):  # each round gains more than two digits
        sine = tanh(isometric + e * atanh(e * sine))
    return asin(sine)


def _geographic(
    keys: Mapping[int, float], step: tuple[float, float], middle: tuple[float, float] | None
) -> Georeference:
    """Pixels of degrees: their size in metres at the middle of the grid."""
    if keys.get(_ANGULAR_UNIT, _DEGREE) != _DEGREE:
        raise ScenarioError(f"coordinates in unit {keys[_ANGULAR_UNIT]} of EPSG; allowed are degrees")
    if middle is None:
        raise ScenarioError("pixels in degrees without a tie point, so that their size in metres is not known")
    if not abs(middle[1]) < 90.0:
        raise ScenarioError(f"its middle lies at latitude {middle[1]:g} degrees; allowed are -90 to 90")
    axis = float(keys.get(_ELLIPSOID_AXIS, SEMI_MAJOR_M))
    e2, sine = FLATTENING * (2.0 - FLATTENING), sin(radians(middle[1]))
    across = axis / sqrt(1.0 - e2 * sine**2)  # radius of curvature east and west; north and south below
    along = across * (1.0 - e2) / (1.0 - e2 * sine**2)
    pixel_m = (across * cos(radians(middle[1])) * radians(step[0]), along * radians(step[1]))
    if keys.get(_GEOGRAPHIC) == _USER_DEFINED and not isclose(axis, SEMI_MAJOR_M, rel_tol=1e-3):
        return Georeference(pixel_m, note=f"its place is on a body of radius {axis / 1000.0:g} km, not on the Earth")
    return Georeference(pixel_m, (middle[1], (middle[0] + 180.0) % 360.0 - 180.0))


def _steps_and_corner(tags: Mapping[int, Any]) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    """Size of a pixel to the right and downwards, and coordinates of the grid's upper left."""
    if _TRANSFORMATION in tags:
        m = [float(value) for value in tags[_TRANSFORMATION]]
        if len(m) != 16 or hypot(m[1], m[4]) > 1e-6 * hypot(m[0], m[5]):
            raise ScenarioError("its grid is turned against its coordinates; allowed are grids with north at the top")
        return _checked(m[0], -m[5]), (m[3], m[7])
    if _PIXEL_SCALE not in tags:
        return None, None
    right, down = (float(value) for value in tags[_PIXEL_SCALE][:2])
    step = _checked(right, down)
    tie: Sequence[float] = tags.get(_TIEPOINT, ())
    if len(tie) < 6:
        return step, None
    return step, (tie[3] - tie[0] * right, tie[4] + tie[1] * down)


def _checked(right: float, down: float) -> tuple[float, float]:
    if not (right > 0.0 and down > 0.0):
        raise ScenarioError(f"pixels of {right:g} x {down:g}; allowed are positive sizes, north at the top")
    return right, down


def _geo_keys(tags: Mapping[int, Any]) -> dict[int, float]:
    """The keys of one number each; those that hold text are left out."""
    directory: Sequence[int] = tags.get(_KEYS, ())
    numbers: Any = tags.get(_KEY_NUMBERS, ())
    numbers = numbers if isinstance(numbers, tuple) else (numbers,)
    keys: dict[int, float] = {}
    for start in range(4, len(directory) - 3, 4):
        key, place, _, value = directory[start : start + 4]
        if place == 0:
            keys[key] = value
        elif place == _KEY_NUMBERS and value < len(numbers):
            keys[key] = float(numbers[value])
    return keys
