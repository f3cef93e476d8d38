"""Local east-north-up coordinates and geographic ones on the WGS-84 ellipsoid.

Both ways go through Earth-centred coordinates: Hofmann-Wellenhof, Lichtenegger, Wasle, "GNSS" (2008), section 8.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from worlds.geometry import wrap_angle
from worlds.georeference import FLATTENING, SEMI_MAJOR_M
from worlds.scenario import Origin
from worlds.types import FloatArray, Vector3

_ECCENTRICITY2 = FLATTENING * (2.0 - FLATTENING)
DEGREES_E7 = 1e7  # MAVLink's integers are degrees times this


@dataclass(frozen=True)
class GeoPoint:
    """A place on Earth; the altitude is above the ellipsoid, which MAVLink's fields take for mean sea level."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float

    @property
    def latitude_e7(self) -> int:
        """Latitude as MAVLink's integer."""
        return round(self.latitude_deg * DEGREES_E7)

    @property
    def longitude_e7(self) -> int:
        """Longitude as MAVLink's integer."""
        return round(self.longitude_deg * DEGREES_E7)

    @property
    def altitude_mm(self) -> int:
        """Altitude as MAVLink's integer."""
        return round(self.altitude_m * 1e3)


class LocalFrame:
    """The world's frame, x east, y north, z up, with its zero at an `Origin`."""

    def __init__(self, origin: Origin) -> None:
        self.origin = GeoPoint(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
        self._zero = _earth_centred(self.origin)
        lat, lon = math.radians(origin.latitude_deg), math.radians(origin.longitude_deg)
        sin_lat, cos_lat, sin_lon, cos_lon = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
        self._to_local = np.array(
            [
                [-sin_lon, cos_lon, 0.0],
                [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
                [cos_lat * cos_lon, cos_lat * sin_lon, sin_lat],
            ]
        )

    def to_geo(self, position_w: FloatArray | Vector3) -> GeoPoint:
        """Geographic place of a world position (3,)."""
        return _geographic(self._zero + np.asarray(position_w, dtype=float) @ self._to_local)

    def to_world(self, point: GeoPoint) -> Vector3:
        """World position of a geographic place."""
        east, north, up = self._to_local @ (_earth_centred(point) - self._zero)
        return float(east), float(north), float(up)


def heading_deg(yaw_rad: float) -> float:
    """Compass heading in [0, 360), clockwise from north, of a world yaw (counter-clockwise from east)."""
    return float((90.0 - math.degrees(yaw_rad)) % 360.0)


def yaw_rad(heading_deg: float) -> float:
    """World yaw in [-pi, pi) of a compass heading."""
    return wrap_angle(math.radians(90.0 - heading_deg))


def _earth_centred(point: GeoPoint) -> FloatArray:
    lat, lon = math.radians(point.latitude_deg), math.radians(point.longitude_deg)
    normal = SEMI_MAJOR_M / math.sqrt(1.0 - _ECCENTRICITY2 * math.sin(lat) ** 2)
    across = (normal + point.altitude_m) * math.cos(lat)
    along = (normal * (1.0 - _ECCENTRICITY2) + point.altitude_m) * math.sin(lat)
    return np.array([across * math.cos(lon), across * math.sin(lon), along])


def _geographic(position: FloatArray) -> GeoPoint:
    """Bowring's iteration on the latitude; each round shrinks the error about 300-fold near the ground."""
    x, y, z = (float(value) for value in position)
    across = math.hypot(x, y)
    lat = math.atan2(z, across * (1.0 - _ECCENTRICITY2))
    for _ in range(6):
        normal = SEMI_MAJOR_M / math.sqrt(1.0 - _ECCENTRICITY2 * math.sin(lat) ** 2)
        lat = math.atan2(z + _ECCENTRICITY2 * normal * math.sin(lat), across)
    normal = SEMI_MAJOR_M / math.sqrt(1.0 - _ECCENTRICITY2 * math.sin(lat) ** 2)
    # This form of the height stays exact at the poles, unlike across / cos(lat) - normal.
    altitude = across * math.cos(lat) + z * math.sin(lat) - normal * (1.0 - _ECCENTRICITY2 * math.sin(lat) ** 2)
    return GeoPoint(math.degrees(lat), math.degrees(math.atan2(y, x)), altitude)
