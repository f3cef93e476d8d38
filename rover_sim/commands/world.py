"""``rover-sim world``: build a world to files, show its picture, or export it for other programs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from rich.table import Table

    from rover_sim.sim.ruts import SavedRuts
    from worlds.types import World

SIZE_CLASSES_M = (0.0, 0.08, 0.2, 0.35, 0.5, 1.0)
CLOSE_UP_M = 6.0
MOST_FACES = 3_000_000  # of rocks.glb: about 100 MB
FORMATS = ("sdf", "urdf", "gltf", "heightmap")


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the sub-commands and their arguments."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    build = actions.add_parser("build", help="write world.npz, scenario.toml and rocks.glb, and print what is in it")
    show = actions.add_parser("show", help="draw the top view and a close look at the rocks")
    export = actions.add_parser("export", help="write the world for Gazebo, PyBullet, MuJoCo or Blender")
    for action in (build, show, export):
        more = "; or the folder of a run: its world with its ruts" if action is export else ""
        action.add_argument("scenario", metavar="SCENARIO", help=f"a shipped name or a TOML file{more}")
        action.add_argument("--seed", type=int, help="of terrain and rocks (default 0)")
    build.add_argument("--out", type=Path, metavar="DIR", help="folder to write to (default world-NAME-SEED)")
    export.add_argument("--format", required=True, choices=FORMATS, help="kind of files")
    export.add_argument(
        "--crop", type=float, nargs=4, metavar=("X0", "Y0", "X1", "Y1"), help="only this rectangle, m (default all)"
    )
    export.add_argument("--out", type=Path, metavar="DIR", help="folder to write to (default world-NAME-SEED-FORMAT)")
    show.add_argument("--out", type=Path, metavar="FILE.png", help="picture to write (default world-NAME-SEED.png)")


def execute(args: argparse.Namespace) -> int:
    """Run the chosen sub-command; the return value is the exit code."""
    from worlds.build import build_world
    from worlds.scenario import load_scenario

    if args.action == "export":
        _export(args)
        return 0
    world = build_world(load_scenario(args.scenario), args.seed or 0, source=args.scenario)
    if args.action == "build":
        _build(world, args.out)
    else:
        _show(world, args.out)
    return 0


def _default_name(world: World) -> str:
    letters = (letter if letter.isalnum() or letter in "-_" else "-" for letter in world.scenario.name)
    return f"world-{''.join(letters)}-{world.seed}"


def _build(world: World, out: Path | None) -> None:
    import numpy as np
    from rich.console import Console

    from rover_sim.files import atomic_path, output_folder, write_text
    from worlds.scenario import dump_scenario

    folder = output_folder(out or Path(_default_name(world)))
    with atomic_path(folder / "world.npz") as path:
        np.savez_compressed(
            path,
            heights_m=world.ground.heights_m,
            resolution_m=world.ground.resolution_m,
            origin_m=np.array(world.ground.origin_m),
            allow_pickle=False,
            **_rock_columns(world),
        )
    write_text(folder / "scenario.toml", dump_scenario(world.scenario))
    written = ["world.npz", "scenario.toml"]
    faces = world.shapes.face_counts()[0]
    if 0 < faces <= MOST_FACES:
        with atomic_path(folder / "rocks.glb") as path:
            path.write_bytes(_rocks_glb(world))
        written.append("rocks.glb")
    else:
        # A mesh file cannot be empty, and that of an earlier world would be wrong.
        (folder / "rocks.glb").unlink(missing_ok=True)
    console = Console()
    console.print(summary_table(world))
    if faces > MOST_FACES:
        console.print(f"rocks.glb: not written, {faces} faces are too many; export a part with --crop", soft_wrap=True)
    console.print(f"{', '.join(written)}: in {folder}", soft_wrap=True)


def _to_export(args: argparse.Namespace) -> tuple[World, SavedRuts | None]:
    """The world of a scenario, or that of a run with its ruts."""
    from rover_sim.errors import InputError
    from rover_sim.export.run_world import is_run, read_run
    from rover_sim.export.rut_surface import check_ruts
    from worlds.build import build_world
    from worlds.scenario import load_scenario

    if not is_run(args.scenario):
        return build_world(load_scenario(args.scenario), args.seed or 0, source=args.scenario), None
    run = read_run(Path(args.scenario))
    if args.seed not in {None, run.seed}:
        raise InputError(f"--seed {args.seed}: the run in {args.scenario} was on seed {run.seed}; leave the option out")
    world = build_world(load_scenario(str(run.scenario)), run.seed, source=str(run.scenario))
    if run.ruts is not None:
        check_ruts(run.ruts, world.ground, str(Path(args.scenario) / "ruts.npz"))
    return world, run.ruts


def _export(args: argparse.Namespace) -> None:
    from rich.console import Console

    from rover_sim.export.formats import WRITERS
    from rover_sim.export.part import part_of
    from rover_sim.files import output_folder

    world, ruts = _to_export(args)
    part = part_of(world, tuple(args.crop) if args.crop else None, ruts)
    folder = output_folder(args.out or Path(f"{_default_name(world)}-{args.format}"))
    names = WRITERS[args.format](part, folder)
    console = Console()
    for note in part.notes if args.format != "heightmap" else ():
        console.print(note, soft_wrap=True)
    console.print(f"{', '.join(names)}: in {folder}", soft_wrap=True)


def _show(world: World, out: Path | None) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from rich.console import Console

    from rover_sim.errors import InputError
    from rover_sim.files import atomic_path, output_folder
    from rover_sim.report.ground_map import draw_close_up, draw_ground, draw_scale

    path = out or Path(f"{_default_name(world)}.png")
    if path.suffix.lower() != ".png":
        raise InputError(f"--out {path}: must end in .png")
    output_folder(path.parent)
    figure = Figure(figsize=(15, 8), layout="constrained")
    FigureCanvasAgg(figure)
    top = figure.add_subplot(1, 2, 1)
    draw_ground(top, world)
    draw_scale(top, world)
    top.legend(loc="upper left", fontsize=8)
    top.set_title(f"{world.scenario.name}, seed {world.seed}")
    close = figure.add_subplot(1, 2, 2, projection="3d")
    centre = _richest_square(world)
    draw_close_up(close, world, centre, CLOSE_UP_M)
    close.set_title(f"{CLOSE_UP_M:g} m around ({centre[0]:.1f}, {centre[1]:.1f})")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=100, format="png")
    Console().print(f"picture: {path}", soft_wrap=True)


def _richest_square(world: World) -> tuple[float, float]:
    """Centre of the square of the close-up that holds the most rock area, on the map as far as possible."""
    import numpy as np

    (west, east), (south, north) = world.ground.x_limits_m, world.ground.y_limits_m
    half = CLOSE_UP_M / 2
    if not len(world.rocks):
        return (west + east) / 2, (south + north) / 2
    places, areas = world.rocks.position_w[:, :2], world.rocks.diameters_m**2
    candidates = places[:: max(1, len(places) // 200)]
    near = [float(areas[(np.abs(places - centre) <= half).all(axis=1)].sum()) for centre in candidates]
    best = candidates[int(np.argmax(near))]
    x = np.clip(best[0], west + half, max(east - half, west + half))
    y = np.clip(best[1], south + half, max(north - half, south + half))
    return float(x), float(y)


def _rock_columns(world: World) -> dict[str, NDArray[Any]]:
    """The rock and cylinder tables as arrays, one a column."""
    import numpy as np

    rocks, cylinders = world.rocks, world.cylinders
    return {
        "rock_id": rocks.ids,
        "rock_position_w": rocks.position_w,
        "rock_size_m": rocks.extents_m,
        "rock_yaw_rad": rocks.yaw_rad,
        "rock_formation": rocks.formation,
        "rock_section_ratio": rocks.section_ratio,
        "cylinder_id": np.array([item.id for item in cylinders], dtype=np.int32),
        "cylinder_position_w": np.array([item.position_w for item in cylinders]).reshape(-1, 3),
        "cylinder_size_m": np.array([(item.radius_m, item.height_m) for item in cylinders]).reshape(-1, 2),
    }


def _rocks_glb(world: World) -> bytes:
    """Rocks and cylinders as binary glTF; glTF has y up, so (x, y, z) becomes (x, z, -y)."""
    import trimesh

    mesh = world.picture_mesh
    shape = trimesh.Trimesh(mesh.vertices_m[:, [0, 2, 1]] * (1.0, 1.0, -1.0), mesh.faces, process=False)
    glb: bytes = trimesh.Scene([shape]).export(file_type="glb")  # type: ignore[no-untyped-call]
    return glb


def summary_table(world: World) -> Table:
    """What the world holds: size, slopes, rocks by diameter (the bumps too), rock cover and soil."""
    import numpy as np
    from rich.table import Table

    from worlds.heightfield import slope_deg

    field = world.ground
    (west, east), (south, north) = field.x_limits_m, field.y_limits_m
    steepness = slope_deg(field)
    table = Table(title=f"{world.scenario.name}, seed {world.seed}", show_header=False)
    table.add_row("size", f"{east - west:.2f} x {north - south:.2f} m")
    table.add_row("cells", f"{field.heights_m.shape[1]} x {field.heights_m.shape[0]} of {field.resolution_m:g} m")
    table.add_row("heights", f"{field.heights_m.min():.2f} to {field.heights_m.max():.2f} m")
    table.add_row("slope", f"mean {steepness.mean():.1f}, p90 {np.percentile(steepness, 90):.1f} deg")
    for name, text in _rock_rows(world, (east - west) * (north - south)):
        table.add_row(name, text)
    faces = world.shapes.face_counts()
    table.add_row("cylinders", f"{len(world.cylinders)}")
    table.add_row("mesh faces", f"{faces[0]}, for contact {faces[1]}")
    table.add_row("soil", world.soil.name)
    table.add_row("origin", f"latitude {world.origin.latitude_deg:.6f}, longitude {world.origin.longitude_deg:.6f} deg")
    for note in world.notes:
        table.add_row("note", note)
    return table


def _rock_rows(world: World, area_m2: float) -> list[tuple[str, str]]:
    """Rows of the table on rocks: how many by diameter, and their cover beside what the law gives."""
    import numpy as np

    from worlds.build import random_rocks
    from worlds.rock_field import MESH_MIN_DIAMETER_M
    from worlds.rock_sizes import area_fraction

    drawn = random_rocks(world.scenario, world.ground, world.seed, world.scenario.name).diameters_m
    bumps = drawn[drawn < MESH_MIN_DIAMETER_M]
    diameters = np.concatenate([bumps, world.rocks.diameters_m])
    rows = []
    for low, high in zip(SIZE_CLASSES_M, (*SIZE_CLASSES_M[1:], np.inf), strict=True):
        name = f"rocks of {low:g} to {high:g} m" if np.isfinite(high) else f"rocks of {low:g} m and more"
        note = ", as bumps of the ground" if high <= MESH_MIN_DIAMETER_M else ""
        rows.append((name, f"{np.count_nonzero((diameters >= low) & (diameters < high))}{note}"))
    keys = world.scenario.rocks
    cover = np.pi / 4 * (diameters**2).sum() / area_m2
    text = f"{100 * cover:.2f} % of the ground"
    if keys.cfa > 0:
        span = np.array([keys.min_diameter_m, keys.max_diameter_m])
        law = float(-np.diff(area_fraction(keys.cfa, span))[0])
        text += f"; law: {100 * law:.2f} % between {span[0]:g} and {span[1]:g} m, {100 * keys.cfa:g} % of all sizes"
    return [*rows, ("rock cover", text)]
