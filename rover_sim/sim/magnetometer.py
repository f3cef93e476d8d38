"""Magnetometer: the Earth's field at the origin, turned into the body, bent by iron, with noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rover_sim.sim.ned_state import NedState
from rover_sim.sim.sensed import FieldSample
from worlds.geometry import rotation_from_quaternion
from worlds.scenario import Origin
from worlds.sensor_tables import Magnetometer
from worlds.types import FloatArray


@dataclass(frozen=True, eq=False)
class MagnetometerModel:
    """One magnetometer at its place."""

    field_uT: FloatArray  # (3,) north, east, down
    soft_iron: FloatArray  # (3, 3)
    offset_uT: FloatArray  # (3,) body: the rover's iron, and what calibration left
    noise_uT: float
    range_uT: float


def world_field_uT(place: Origin, year: float) -> FloatArray:
    """The main field (3,), north, east and down, by the World Magnetic Model of 2025 (NOAA NCEI and BGS, 2024).

    Its own error is 0.14 uT in strength, 0.2 deg in inclination and 0.26 + 5.4 uT/H deg in declination, one sigma; the
    crust's part is in them.
    """
    from pygeomag import GeoMag

    result = GeoMag(coefficients_file="wmm/WMM_2025.COF").calculate(
        glat=place.latitude_deg, glon=place.longitude_deg, alt=1e-3 * place.altitude_m, time=year
    )
    return 1e-3 * np.array([result.x, result.y, result.z])


def magnetometer_model(table: Magnetometer, place: Origin, rng: np.random.Generator) -> MagnetometerModel:
    """The magnetometer of a scenario's table at a place."""
    field = world_field_uT(place, table.year) if table.field_uT is None else np.array(table.field_uT)
    offset = np.array(table.hard_iron_uT) + table.bias_uT * rng.standard_normal(3)
    return MagnetometerModel(field, np.array(table.soft_iron).reshape(3, 3), offset, table.noise_uT, table.range_uT)


def read(model: MagnetometerModel, truth: NedState, rng: np.random.Generator) -> FieldSample:
    """One sample."""
    w, x, y, z = truth.quaternion
    field_b = model.field_uT @ rotation_from_quaternion(np.array([x, y, z, w]))
    noise = model.noise_uT * rng.standard_normal(3)
    measured = model.soft_iron @ field_b + model.offset_uT + noise
    x, y, z = np.clip(measured, -model.range_uT, model.range_uT).tolist()
    return FieldSample((x, y, z))
