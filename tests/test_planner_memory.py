from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import structs

from planner import ground_cells as gc
from planner import terrain_map as tm
from worlds.types import FloatArray, GroundPlane, Observation, PerceivedRock

HERE = np.zeros(2)
VIEW = np.array([[1.0, -0.8], [8.0, -6.0], [8.0, 6.0], [1.0, 0.8]])


def rock(x: float, y: float, *, sd: float = 0.1, size: float = 0.4, certainty: float = 0.8) -> PerceivedRock:
    return PerceivedRock((x, y, 0.0), size, size, 0.2, 0.0, certainty, 0, float(np.hypot(x, y)), sd)


def seen(time_s: float, *rocks: PerceivedRock, outline: FloatArray = VIEW) -> Observation:
    return Observation(time_s, rocks, np.zeros((0, 0), dtype="<U1"), np.zeros((0, 0, 2)), outline)


def after(*observations: Observation) -> tm.TerrainMemory:
    memory = tm.empty_memory(HERE)
    for observation in observations:
        memory = tm.remember(memory, observation, HERE)
    return memory


def test_two_views_of_a_rock_are_one_rock_and_surer() -> None:
    once, twice = after(seen(0, rock(4, 0))), after(seen(0, rock(4, 0)), seen(1, rock(4.1, 0.02)))
    assert len(twice.rocks) == 1
    assert twice.rocks.certainty[0] > once.rocks.certainty[0]
    assert 4.0 < twice.rocks.centre_w[0, 0] < 4.1


def test_a_nearer_view_corrects_a_far_one() -> None:
    rocks = after(seen(0, rock(5.0, 0, sd=0.6)), seen(1, rock(4.4, 0, sd=0.05))).rocks
    assert len(rocks) == 1
    assert abs(rocks.centre_w[0, 0] - 4.4) < 0.06


def test_neighbours_stay_two() -> None:
    assert len(after(*(seen(t, rock(3, 0), rock(3, 0.8)) for t in range(3))).rocks) == 2


def test_a_rock_not_seen_again_is_dropped_and_one_out_of_view_is_kept() -> None:
    first = seen(0, rock(3, 0, certainty=0.5), rock(0.5, 0.5))
    memory = after(first, *(seen(t) for t in range(1, 5)))
    np.testing.assert_allclose(memory.rocks.centre_w, [[0.5, 0.5]])


def test_a_hidden_rock_is_not_doubted() -> None:
    front, behind = rock(2.0, 0, size=0.8), rock(4.0, 0, size=0.3)
    rocks = after(seen(0, front, behind), *(seen(t, front) for t in range(1, 6))).rocks
    assert len(rocks) == 2


def test_a_pebble_is_no_rock_and_a_rock_inside_a_larger_one_vanishes() -> None:
    low = PerceivedRock((3.0, 1.0, 0.0), 0.1, 0.1, 0.02, 0.0, 0.9, 0, 3.2, 0.05)
    rocks = after(seen(0, low, rock(3, 0, size=1.0), rock(3.25, 0, size=0.2, sd=0.02))).rocks
    assert len(rocks) == 1


def test_memory_is_capped_nearest_first() -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(1.0, 8.0, (60, 2))
    memory = tm.remember(
        tm.empty_memory(HERE), seen(0, *(rock(x, y, size=0.05) for x, y in places)), HERE, tm.MemoryModel(capacity=10)
    )
    kept = np.sort(np.linalg.norm(memory.rocks.centre_w, axis=1))
    np.testing.assert_allclose(kept, np.sort(np.linalg.norm(places, axis=1))[:10])


@settings(deadline=None, max_examples=40)
@given(
    st.lists(
        st.lists(st.tuples(st.floats(1.2, 8), st.floats(-4, 4), st.floats(0.02, 1.0), st.floats(0, 1)), max_size=8),
        max_size=4,
    )
)
def test_any_views_keep_the_memory_sound(frames: list[list[tuple[float, float, float, float]]]) -> None:
    rocks = after(
        *(
            seen(t, *(rock(x, y, sd=sd, certainty=certainty) for x, y, sd, certainty in frame))
            for t, frame in enumerate(frames)
        )
    ).rocks
    assert len(rocks) <= sum(map(len, frames))
    assert (np.linalg.eigvalsh(rocks.covariance) > 0).all()
    assert ((rocks.certainty > 0) & (rocks.certainty < 1)).all()


def test_the_view_marks_cells_and_classes_roughen_them() -> None:
    letters = np.array([["S", "M"]])
    centres = np.array([[[3.0, 0.5], [3.0, -0.5]]])
    observation = Observation(0.0, (), letters, centres, VIEW)
    cells = gc.take_in(gc.empty_cells(HERE), gc.camera_view(observation, HERE))
    known, rough = gc.sample(cells, np.array([[3.0, 0.5], [3.0, -0.5], [-3.0, 0.0], [500.0, 0.0]]))
    assert known.tolist() == [True, True, False, False]
    assert rough[0] == 0.0
    assert 0.1 < rough[1] <= 0.8


def test_cells_move_with_the_rover() -> None:
    cells = gc.take_in(gc.empty_cells(HERE), gc.driven_view(np.array([5.0, 0.0, 0.0]), 0.6, 0.0))
    moved = gc.recentre(cells, np.array([12.0, 1.0]))
    assert not np.array_equal(moved.origin_w, cells.origin_w)
    assert gc.sample(moved, np.array([[5.0, 0.0]]))[0][0]
    assert not gc.sample(gc.recentre(cells, np.array([900.0, 0.0])), np.array([[5.0, 0.0]]))[0][0]


def test_inside_a_concave_outline() -> None:
    outline = np.array([[0, 0], [4, 0], [4, 4], [2, 1], [0, 4]], dtype=float)
    points = np.array([[0.5, 2.0], [2.0, 2.0], [3.5, 2.0], [5.0, 1.0]])
    assert gc.inside_polygon(outline, points).tolist() == [True, False, True, False]


def test_a_view_that_runs_out_of_the_picture_does_not_shrink_a_rock() -> None:
    whole = rock(3.0, 0.0, size=0.24)
    part = structs.replace(whole, height_m=0.04, width_m=0.08, length_m=0.20, cut=True, range_m=1.0)
    rocks = after(seen(0, whole), seen(1, part), seen(2, part), seen(3, part)).rocks
    assert len(rocks) == 1
    assert rocks.height_m[0] > 0.18
    assert rocks.width_m[0] > 0.20


def test_a_cell_keeps_its_surest_height_and_who_told_it() -> None:
    raised = GroundPlane(np.array([0.0, 0.0, 0.2]), np.array([0.0, 0.0, 1.0]))
    cells = gc.take_in(gc.empty_cells(HERE), gc.camera_view(replace(seen(1.0), ground=raised), HERE))
    far, never = (at(cells, place) for place in ((6.0, 0.0), (-3.0, 0.0)))
    assert far[0] == gc.Source.CAMERA
    np.testing.assert_allclose(far[1:], [1.0, 0.2, (0.02 + 0.035 * 6.0) ** 2], rtol=0.05)
    assert never[0] == gc.Source.NOBODY
    driven = gc.take_in(cells, gc.driven_view(np.array([6.0, 0.0, 0.3]), 0.4, 2.0))
    np.testing.assert_allclose(at(driven, (6.0, 0.0)), [gc.Source.WHEELS, 2.0, 0.3, 0.02**2], rtol=1e-5)
    again = gc.take_in(driven, gc.camera_view(replace(seen(3.0), ground=raised), HERE))
    np.testing.assert_allclose(at(again, (6.0, 0.0)), [gc.Source.WHEELS, 3.0, 0.3, 0.02**2], rtol=1e-5)


def at(cells: gc.GroundCells, place: tuple[float, float]) -> tuple[float, float, float, float]:
    """Source, time, height and variance of a cell."""
    column, row = (int(value) for value in np.floor((np.array(place) - cells.origin_w) / gc.CELL_M))
    layers = cells.source, cells.seen_s, cells.height_m, cells.variance_m2
    source, seen_s, height, variance = (float(layer[row, column]) for layer in layers)
    return source, seen_s, height, variance


def test_what_hides_behind_a_rock_is_not_seen() -> None:
    tall = PerceivedRock((3.0, 0.0, 0.0), 0.5, 0.5, 0.6, 0.0, 0.9, 0, 3.0, 0.05)
    cells = gc.take_in(gc.empty_cells(HERE), gc.camera_view(seen(0.0, tall), HERE))
    known = gc.sample(cells, np.array([[4.0, 0.0], [4.0, 1.0], [2.5, 0.0]]))[0]
    assert known.tolist() == [False, True, True]


def test_a_part_of_a_rock_leaves_it_where_it_was_seen_whole() -> None:
    whole = seen(0, rock(3.0, 0.0, sd=0.05, size=0.9))
    part = seen(1, rock(3.0, 0.3, sd=0.05, size=0.3))
    assert abs(after(whole, part).rocks.centre_w[0, 1]) < 0.02
    again = seen(1, rock(3.0, 0.1, sd=0.05, size=0.9))
    assert after(whole, again).rocks.centre_w[0, 1] > 0.04
