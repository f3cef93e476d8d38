from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.rock_placement import View
from perception.shadow_height import shadow_heights, with_shadows
from rover_sim.cli import main
from rover_sim.sim.renderer import make_renderer
from tests.camera_factory import lens, look, world
from tests.test_perception_command import CAMERA_TOML
from worlds.geometry import to_sun
from worlds.types import ByteArray, GroundPlane, IntArray, PerceivedRock

DOMES = ((2.2, 0.55, 0.25, 0.16), (2.6, -0.6, 0.25, 0.24), (3.4, 0.3, 0.3, 0.2))  # x, y, radius, height
CAMERA = lens()
LEVEL = GroundPlane(np.zeros(3), np.array([0.0, 0.0, 1.0]))
SCALE = (1.0, 1.0)


def shaded(azimuth: float, elevation: float) -> tuple[ByteArray, IntArray, View, list[PerceivedRock]]:
    """Grey picture, labels, view and the true rocks of domes under a sun."""
    pose = look(CAMERA, 0.0, 0.0, 1.1)
    picture = make_renderer(world(rocks=DOMES, sun=(azimuth, elevation))).render(CAMERA, pose)
    rocks = [
        PerceivedRock((x, y, 0.0), 2 * r, 2 * r, 0.76 * r, 0.0, 0.9, 0, float(np.hypot(x, y)), 0.1, False, 0.1 * r)
        for x, y, r, _ in DOMES
    ]
    grey = np.asarray(cv2.cvtColor(picture.image, cv2.COLOR_RGB2GRAY), np.uint8)
    return grey, np.maximum(picture.ids, 0), View(CAMERA, pose, LEVEL, to_sun(azimuth, elevation)), rocks


@pytest.mark.parametrize("azimuth", [100.0, -90.0, 60.0])
@pytest.mark.parametrize("elevation", [15.0, 25.0])
def test_shadows_of_domes_tell_their_heights(azimuth: float, elevation: float) -> None:
    grey, labels, view, rocks = shaded(azimuth, elevation)
    height, sd = shadow_heights(rocks, np.arange(1, 4, dtype=np.int32), labels, grey, view, SCALE)
    true = np.array([dome[3] for dome in DOMES])
    assert np.isfinite(sd).sum() >= 2
    assert (np.abs(height - true) <= np.minimum(2.0 * sd, 1.0)).all()
    seen = np.isfinite(sd)
    assert np.abs(height[seen] / true[seen] - 1.0).max() < 0.3


def test_a_lower_sun_knows_better_and_a_sun_behind_the_camera_knows_nothing() -> None:
    which = np.arange(1, 4, dtype=np.int32)
    low, high = (shadow_heights(rocks, which, labels, grey, view, SCALE)[1]
                 for grey, labels, view, rocks in (shaded(90.0, 15.0), shaded(90.0, 40.0)))  # fmt: skip
    assert low[1] < high[1]
    grey, labels, view, rocks = shaded(180.0, 35.0)
    assert np.isinf(shadow_heights(rocks, which, labels, grey, view, SCALE)[1]).all()
    grey, labels, view, rocks = shaded(90.0, 2.0)
    assert np.isinf(shadow_heights(rocks, which, labels, grey, view, SCALE)[1]).all()


def test_heights_are_averaged_by_variance_and_only_with_a_sun() -> None:
    grey, labels, view, rocks = shaded(90.0, 15.0)
    area = np.bincount(labels.ravel())[1:].astype(np.int32)
    placed: list[PerceivedRock | None] = [rocks[0], None, rocks[2]]
    blind = View(view.camera, view.pose, view.plane)
    assert with_shadows(placed, area, labels, grey, blind, SCALE) == placed
    first, gone, _ = with_shadows(placed, area, labels, grey, view, SCALE)
    measured, sd = shadow_heights([rocks[0]], np.array([1], np.int32), labels, grey, view, SCALE)
    weights = np.array([1.0 / sd[0] ** 2, 1.0 / rocks[0].height_sd_m ** 2])
    assert gone is None
    assert first is not None
    assert first.height_m == pytest.approx(weights @ [measured[0], rocks[0].height_m] / weights.sum())
    assert first.position_w == rocks[0].position_w


def test_without_shadow_or_in_the_dark_heights_stay() -> None:
    grey, labels, view, rocks = shaded(90.0, 15.0)
    which = np.arange(1, 4, dtype=np.int32)
    for level in (0, 120, 255):
        flat = np.full_like(grey, level)
        assert np.isinf(shadow_heights(rocks, which, labels, flat, view, SCALE)[1]).all()


def test_the_command_takes_the_sun(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pose = look(CAMERA, 0.0, 0.0, 1.1)
    image = make_renderer(world(rocks=DOMES, sun=(90.0, 15.0))).render(CAMERA, pose).image
    picture, camera = tmp_path / "a.png", tmp_path / "camera.toml"
    cv2.imwrite(str(picture), image[..., ::-1])
    camera.write_text(CAMERA_TOML, encoding="utf-8")
    words = ["perceive", str(picture), "--camera", str(camera), "--knowledge", "rendered", "--out"]
    assert main([*words, str(tmp_path / "plain")]) == 0
    assert main([*words, str(tmp_path / "sun"), "--sun", "15,90"]) == 0
    plain, sun = (json.loads((tmp_path / name / "a.json").read_text(encoding="utf-8")) for name in ("plain", "sun"))
    assert plain["sun_deg"] is None
    assert sun["sun_deg"] == [15.0, 90.0]
    assert "elevation_deg = 15.0" in (tmp_path / "sun" / "a_scenario.toml").read_text(encoding="utf-8")
    heights = [[rock.get("height_m") for rock in table["rocks"]] for table in (plain, sun)]
    assert len(heights[0]) == len(heights[1])
    assert heights[0] != heights[1]
    for wrong in ("15", "high,low", "1,0", "95,0", "20,400", "nan,nan"):
        with pytest.raises(SystemExit) as end:
            main([*words, str(tmp_path / "no"), "--sun", wrong])
        assert end.value.code == 2
        assert "2 to 90, -360 to 360" in capsys.readouterr().err
