"""Explicit rocks of a scenario: aspect and sections."""

from __future__ import annotations

import numpy as np
import pytest

from worlds.build import build_world
from worlds.errors import ScenarioError
from worlds.rock_shape import PROFILES
from worlds.scenario import Goal, Obstacle, Rocks, Scenario, Terrain
from worlds.types import Rock

SECTIONS = (0.2, 0.6, 0.9, 1.0, 0.9, 0.7, 0.5, 0.3, 0.1)


def built(**keys: object) -> Rock:
    measures = {"kind": "rock", "position_m": (2.0, 2.0), "radius_m": 0.5, "height_m": 0.3} | keys
    scenario = Scenario(
        name="x",
        terrain=Terrain(kind="flat", size_m=(12.0, 12.0), resolution_m=0.2),
        rocks=Rocks(cfa=0.0),
        obstacle=(Obstacle(**measures),),  # type: ignore[arg-type]
        goal=Goal(position_m=(4.0, 0.0)),
    )
    return build_world(scenario, 0).rocks[0]


@pytest.mark.parametrize(
    ("formation", "aspect", "wanted"), [(0, None, 1.0), (3, None, 1.6), (0, 1.2, 1.2), (3, 2.25, 2.25)]
)
def test_aspect_is_length_over_width_at_equal_area(formation: int, aspect: float | None, wanted: float) -> None:
    rock = built(formation=formation, aspect=aspect)
    assert rock.length_m / rock.width_m == pytest.approx(wanted)
    assert rock.diameter_m == pytest.approx(1.0)


def test_sections_replace_those_of_the_formation() -> None:
    assert built(formation=4, sections=SECTIONS).shape.section_ratio == SECTIONS
    assert built(formation=4).shape.section_ratio == tuple(PROFILES[4])


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"sections": (1.0, 0.5)}, "obstacle[0].sections: has 2 numbers; give the 9"),
        ({"sections": (0.5,) * 9}, "the largest must be 1"),
        ({"sections": (1.0, 0.0, *(1.0,) * 7)}, "between the tips at least 0.05"),
        ({"sections": (1.5, *(1.0,) * 8)}, "obstacle[0].sections[0] = 1.5: allowed are 0 to 1"),
        ({"aspect": 0.5}, "obstacle[0].aspect = 0.5: allowed are 1 to 10"),
        ({"kind": "cylinder", "aspect": 1.5}, "obstacle[0].kind = cylinder"),
    ],
)
def test_impossible_shapes_are_told(keys: dict[str, object], told: str) -> None:
    with pytest.raises(ScenarioError) as error:
        built(**keys)
    assert told in str(error.value)


def test_a_place_beside_the_tip_of_a_long_rock_is_outside_of_it() -> None:
    """The circle around the rock holds the start, the rock itself does not."""
    rock = built(position_m=(0.0, 0.7), radius_m=0.5, aspect=4.0, formation=5)
    assert rock.length_m == pytest.approx(2.0)
    assert np.hypot(*rock.position_w[:2]) < rock.length_m / 2
