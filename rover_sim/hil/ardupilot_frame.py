"""The geography of ArduPilot's simulator: a sphere, unrolled around the place where the rover starts.

The physics tells metres north and east of home, and SITL makes degrees of them with one factor for all latitudes
(``libraries/AP_Common/Location.cpp``: LOCATION_SCALING_FACTOR, ``longitude_scale``). Waypoints given on the
ellipsoid would lie up to 0.7 % of their distance from home beside the places that are meant.
"""

from __future__ import annotations

from math import cos, radians

from rover_sim.mavlink.geodesy import GeoPoint, LocalFrame
from worlds.scenario import Origin
from worlds.types import FloatArray, Vector3

_M_PER_DEG = 111318.84502145034  # 1e7 times LOCATION_SCALING_FACTOR


class ArduPilotFrame(LocalFrame):
    """The world's frame as SITL lays it on the Earth."""

    def __init__(self, origin: Origin, home_w: Vector3) -> None:
        """``home_w``: where the rover starts (m), whose geographic place is SITL's ``--home``."""
        super().__init__(origin)
        self._home_w, self._home = home_w, super().to_geo(home_w)
        self._east_m_per_deg = _M_PER_DEG * cos(radians(self._home.latitude_deg))

    def to_geo(self, position_w: FloatArray | Vector3) -> GeoPoint:
        """Geographic place of a world position (3,)."""
        east, north, up = (float(now - start) for now, start in zip(position_w, self._home_w, strict=True))
        home = self._home
        return GeoPoint(
            home.latitude_deg + north / _M_PER_DEG,
            home.longitude_deg + east / self._east_m_per_deg,
            home.altitude_m + up,
        )

    def to_world(self, point: GeoPoint) -> Vector3:
        """World position of a geographic place."""
        home, (x, y, z) = self._home, self._home_w
        return (
            x + (point.longitude_deg - home.longitude_deg) * self._east_m_per_deg,
            y + (point.latitude_deg - home.latitude_deg) * _M_PER_DEG,
            z + point.altitude_m - home.altitude_m,
        )
