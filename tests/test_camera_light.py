"""Sun, shadow, exposure and noise."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from rover_sim.sim.renderer import add_noise, make_renderer
from tests.camera_factory import field, lens, look, world
from worlds.types import ByteArray, CameraModel

POST = (0.0, 0.0, 0.2, 1.0)
# Azimuth of the sun and a place in the shadow of the post.
SHADOWS = [(0.0, (-0.6, 0.0)), (90.0, (0.0, -0.6)), (180.0, (0.6, 0.0)), (270.0, (0.0, 0.6))]


def from_above(sun: tuple[float, float]) -> tuple[ByteArray, CameraModel]:
    """Picture straight down on a post at the origin; its top edge is east."""
    camera = lens(240, 240, pitch_deg=90.0)
    renderer = make_renderer(world(field(16.0, 0.5), cylinders=[POST], sun=sun))
    return renderer.render(camera, look(camera, 0.0, 0.0, 4.0)).image, camera


def brightness_at(image: ByteArray, camera: CameraModel, x: float, y: float) -> float:
    """Mean grey around a place on the ground seen from 4 m straight above the origin."""
    row, column = (round(120 - value / 4.0 * camera.focal_px) for value in (x, y))
    return float(image[row - 2 : row + 3, column - 2 : column + 3].mean())


@pytest.mark.parametrize(("azimuth_deg", "dark"), SHADOWS)
def test_the_shadow_falls_away_from_the_sun(azimuth_deg: float, dark: tuple[float, float]) -> None:
    image, camera = from_above((azimuth_deg, 45.0))
    in_shadow = brightness_at(image, camera, *dark)
    opposite = brightness_at(image, camera, -dark[0], -dark[1])
    assert in_shadow < 0.7 * opposite


@pytest.mark.parametrize("elevation_deg", [30.0, 45.0, 60.0])
def test_the_shadow_is_as_long_as_the_sun_is_low(elevation_deg: float) -> None:
    image, camera = from_above((0.0, elevation_deg))
    # From the middle of the post its shadow reaches 1 m / tan(elevation), plus the radius of the round end.
    reach = 1.0 / np.tan(np.radians(elevation_deg)) + 0.2
    assert brightness_at(image, camera, -(reach - 0.1), 0.0) < 0.75 * brightness_at(image, camera, -(reach + 0.1), 0.0)


def test_something_low_under_a_low_sun_has_its_whole_shadow() -> None:
    camera, low = lens(240, 240, pitch_deg=90.0), (0.0, 0.0, 0.2, 0.1)
    scene = world(field(16.0, 0.5), cylinders=[low], sun=(0.0, 15.0))
    image = make_renderer(scene).render(camera, look(camera, 0.0, 0.0, 4.0)).image
    reach = 0.1 / np.tan(np.radians(15.0)) + 0.2
    assert brightness_at(image, camera, -(reach - 0.07), 0.0) < 0.85 * brightness_at(image, camera, -(reach + 0.1), 0.0)


@pytest.mark.parametrize("azimuth_deg", [0.0, 30.0, 90.0])
def test_rolling_ground_has_no_dark_specks(azimuth_deg: float) -> None:
    camera = lens(240, 240, pitch_deg=90.0)
    ground = field(16.0, 0.1, lambda x, y: 0.03 * np.sin(4.0 * x) + 0.02 * np.sin(3.0 * y))  # slopes up to 8 degrees
    view = make_renderer(world(ground, sun=(azimuth_deg, 12.0))).render(camera, look(camera, 0.0, 0.0, 4.0))
    red = view.image[..., 0]
    assert (red / cv2.medianBlur(red, 9).astype(float)).min() > 0.7


def test_no_shadow_where_there_is_nothing_to_cast_it() -> None:
    camera = lens(240, 240, pitch_deg=90.0)
    image = make_renderer(world(field(16.0, 0.5), sun=(30.0, 12.0))).render(camera, look(camera, 0.0, 0.0, 4.0)).image
    # False shadows of the ground on itself would be dark specks.
    assert image[..., 0].min() > 0.6 * image[..., 0].mean()


def test_a_sun_below_the_horizon_leaves_the_light_of_the_sky() -> None:
    image, camera = from_above((0.0, -5.0))
    assert brightness_at(image, camera, -0.6, 0.0) == pytest.approx(brightness_at(image, camera, 0.6, 0.0), rel=0.1)
    assert image.mean() > 20


@pytest.mark.parametrize("elevation_deg", [10.0, 30.0, 60.0, 90.0])
def test_the_exposure_follows_the_sun(elevation_deg: float) -> None:
    image, _ = from_above((120.0, elevation_deg))
    assert 100 < np.median(image[..., 0]) < 200


def test_sand_is_red_and_rock_is_greyer() -> None:
    camera = lens()
    renderer = make_renderer(world(field(16.0, 0.5), rocks=[(3.0, y, 0.3, 0.3) for y in (-2.0, -1.0, 0.0, 1.0, 2.0)]))
    picture = renderer.render(camera, look(camera, 0.0, 0.0, 1.1))
    sand, rock = (picture.image[mask].mean(axis=0) for mask in (picture.ids == 0, picture.ids > 0))
    assert sand[0] > 1.1 * sand[1] > 1.3 * sand[2]
    assert rock[0] / rock[2] < sand[0] / sand[2]


def test_noise_has_the_deviation_that_was_asked_for() -> None:
    image = np.full((120, 160, 3), 128, dtype=np.uint8)
    noisy = add_noise(image, 4.0, np.random.default_rng(5)).astype(float)
    assert noisy.mean() == pytest.approx(128.0, abs=0.1)
    # Rounding to whole levels adds 1/12 to the variance.
    assert noisy.std() == pytest.approx(np.sqrt(16 + 1 / 12), rel=0.02)
    np.testing.assert_array_equal(image, 128)


def test_noise_stays_within_a_byte_and_repeats() -> None:
    image = np.repeat(np.array([0, 255], dtype=np.uint8), 3000).reshape(20, 100, 3)
    first, second = (add_noise(image, 10.0, np.random.default_rng(6)) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert first[:10].max() < 60
    assert first[10:].min() > 195


def test_no_noise_is_the_same_picture() -> None:
    image = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    np.testing.assert_array_equal(add_noise(image, 0.0, np.random.default_rng(7)), image)
