from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh

from rover_sim.cli import main
from rover_sim.errors import InputError
from rover_sim.export import part as parts
from rover_sim.export.part import part_of
from worlds.build import build_world
from worlds.heightfield import height_at
from worlds.scenario import Goal, Rocks, Scenario, Terrain
from worlds.types import World

BARE = (
    'name = "bare"\nrocks.cfa = 0.0\nterrain = { size_m = [8.0, 8.0], resolution_m = 0.1 }\ngoal.position_m = [4, 0]\n'
)


@pytest.fixture(scope="module")
def world() -> World:
    terrain = Terrain(size_m=(16.0, 12.0), resolution_m=0.1)
    return build_world(
        Scenario(name="part", terrain=terrain, rocks=Rocks(cfa=0.1), goal=Goal(position_m=(8.0, 0.0))), 1
    )


def fault(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    try:
        code = main(["world", "export", *words])
    except SystemExit as stopped:
        code = int(stopped.code or 0)
    error = capsys.readouterr().err
    assert (code, error.count("\n")) == (2, 1)
    return error


@pytest.fixture
def bare(tmp_path: Path) -> str:
    (tmp_path / "bare.toml").write_text(BARE.replace("[4, 0]", "[4.0, 0.0]"))
    return str(tmp_path / "bare.toml")


def test_a_fault_is_one_line(bare: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "invalid choice: 'step'" in fault(capsys, bare, "--format", "step")
    assert "required: --format" in fault(capsys, bare)
    assert "no such scenario file" in fault(capsys, "nowhere.toml", "--format", "sdf")
    (tmp_path / "file").write_text("")
    out = ("--out", str(tmp_path / "file" / "folder"))
    assert "cannot be made" in fault(capsys, bare, "--format", "gltf", *out)
    for crop in ("0 0 99 1", "1 0 0 1", "0 0 1 nan"):
        assert "must be X0 Y0 X1 Y1" in fault(capsys, bare, "--format", "sdf", "--crop", *crop.split())
    assert "fewer than 5 x 5" in fault(capsys, bare, "--format", "sdf", "--crop", "0", "0", "0.2", "1")


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is forbidden to root")
def test_a_folder_that_may_not_be_written(bare: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "locked").mkdir(mode=0o500)
    assert "not writable" in fault(capsys, bare, "--format", "sdf", "--out", str(tmp_path / "locked"))


def test_a_world_without_rocks_leaves_none_of_an_earlier_export(
    bare: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "rocks.obj").write_text("of another world")
    assert main(["world", "export", bare, "--format", "urdf", "--out", str(out)]) == 0
    assert {path.name for path in out.iterdir()} == {"world.urdf", "ground.obj"}
    assert "world.urdf, ground.obj: in" in capsys.readouterr().out


def test_a_crop_keeps_the_coordinates_and_the_rocks_in_it(world: World) -> None:
    part = part_of(world, (1.0, -2.0, 5.0, 3.0))
    assert part.ground.x_limits_m == pytest.approx((1.0, 5.0))
    assert part.ground.y_limits_m == pytest.approx((-2.0, 3.0))
    assert height_at(part.ground, 2.34, 1.23) == pytest.approx(height_at(world.ground, 2.34, 1.23))
    inside = [r.id for r in world.rocks if 1.0 <= r.position_w[0] <= 5.0 and -2.0 <= r.position_w[1] <= 3.0]
    assert set(part.rocks.owner.tolist()) == set(inside)
    assert 0 < len(inside) < len(world.rocks)
    assert part.notes == ()


def test_too_fine_a_ground_is_thinned_and_said(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parts, "MOST_GROUND_CELLS", 5000)
    part = part_of(world, None)
    assert part.thinned.resolution_m == pytest.approx(0.2)
    assert np.array_equal(part.thinned.heights_m, world.ground.heights_m[::2, ::2])
    assert part.notes[0].startswith("ground mesh: one height in 2 along each side, 0.2 m apart")
    assert len(part.ground_mesh.faces) == 2 * 80 * 60


def test_too_many_rocks_ask_for_a_part(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parts, "MOST_THINGS", 10)
    with pytest.raises(InputError, match=r"^--crop: there are \d+ rocks and cylinders, allowed are 10; choose a part"):
        assert part_of(world, None).rocks


def test_the_same_world_gives_the_same_bytes(bare: str, tmp_path: Path) -> None:
    for kind in ("sdf", "urdf", "gltf", "heightmap"):
        for out in ("one", "two"):
            assert main(["world", "export", bare, "--format", kind, "--out", str(tmp_path / out)]) == 0
    for path in (tmp_path / "one").iterdir():
        assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes(), path.name
    assert trimesh.load(tmp_path / "one" / "world.glb") is not None
