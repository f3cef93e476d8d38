"""What the perception knows of rocks, soil and terrain: strict TOML files, decoded once and frozen.

``rendered`` (the simulator's camera) and ``mars`` (pictures of real rovers) ship in ``perception/knowledge``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec

from worlds.errors import InputError
from worlds.fuzzy import RuleBase, rule_base
from worlds.strict_toml import Limits, check_limits, convert_table, read_table

ROCK_INPUTS = ("contrast", "energy", "variance", "area", "strength")
PAPER_INPUTS = ("contrast", "energy", "variance", "area")  # the four of the 2004 paper, section 4
CLAST_INPUTS = ("stones", "stones_sure")  # need the table [clasts]
TERRAIN_INPUTS = (
    *PAPER_INPUTS,
    *("entropy", "homogeneity", "fine", "grain", "coarse", "score", "score_spread", "cover", "largest", "rest"),
    *("rock_size", "around_score", "around_largest", "around_fine", "around_coarse", "range", "skyline", "unseen"),
    *CLAST_INPUTS,
)
CLAST_CUES = (
    *("red", "red_median", "red_mean", "red_over", "red_most", "red_least", "score", "score_around", "light_over"),
    *("light_detail", "light_range", "chance", "chance_mean", "chance_most", "chance_least", "chance_around"),
)
CUE_NAMES = ("lightness", "green_red", "blue_yellow", "roughness", "likeness")
SKY_CUES = ("lightness", "green_red", "blue_yellow", "texture", "texture_over", "texture_level", "row")
PARTING_CUES = (
    *("area", "smaller", "whole_fill", "least_fill", "ellipse_gain", "ellipse_lack", "chord", "bend", "lesser_bend"),
    *("level", "above", "light_step", "lit_above", "hue_beside", "score_dip", "score_drop"),
)
LIMITS: Limits = {
    "soil.window_px": (1, 99),
    "soil.smooth_percentile": (0.0, 100.0),
    "soil.dark_percentile": (0.0, 100.0),
    "soil.bright_percentile": (0.0, 100.0),
    "soil.gradient_percentile": (0.0, 100.0),
    "soil.gradient_floor": (1e-3, 100.0),
    "soil.trend_stiffness": (1e-6, 1e9),
    "cues.shade_compensation": (0.0, 1.0),
    "binarization.blur_px": (0.1, 20.0),
    "binarization.roughness_window_px": (1, 99),
    "binarization.threshold": (0.0, 1.0),
    "binarization.threshold_span": (0.0, 1.0),
    "binarization.close_px": (1, 99),
    "binarization.open_px": (1, 99),
    "binarization.neck_ratio": (0.0, 1.0),
    "binarization.min_area_px": (1, 76800),
    "sky.colour.step_cost": (0.0, 1e3),
    "sky.colour.least": (0.0, 1e3),
    "sky.grey.step_cost": (0.0, 1e3),
    "sky.grey.least": (0.0, 1e3),
    "sky.colour.least_width": (0.0, 1.0),
    "sky.grey.least_width": (0.0, 1.0),
    "parting.least_px": (1, 76800),
    "clasts.rock_cut": (0.0, 1.0),
    "ground.max_range_m": (0.1, 1e4),
    "ground.horizon_dip_deg": (0.0, 45.0),
    "rock.min_certainty": (0.0, 1.0),
    "rock.round_ratio": (1.0, 100.0),
    "terrain.min_certainty": (0.0, 1.0),
}


class _Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A table of a knowledge file: a mistyped key is an error."""


class SoilKnowledge(_Table, frozen=True, kw_only=True):
    """How the soil of a picture is found: smooth, neither darkest nor brightest (percentiles)."""

    window_px: int = 9
    smooth_percentile: float = 40.0
    dark_percentile: float = 5.0
    bright_percentile: float = 98.0
    gradient_percentile: float = 20.0
    gradient_floor: float = 0.2
    trend_stiffness: float = 0.1  # of the surface through the soil's lightness, as a ridge; large: level


class Cue(_Table, frozen=True, kw_only=True):
    """Evidence for rock against one measure: straight lines between the knots, flat beyond the outer ones."""

    value: tuple[float, ...]
    evidence: tuple[float, ...]


def cue_lines(named: Iterable[tuple[str, Cue]]) -> list[str]:
    """Lines of a knowledge file, one a cue."""
    return [f"{name} = {{ value = {list(cue.value)}, evidence = {list(cue.evidence)} }}" for name, cue in named]


def _named(table: _Table, names: tuple[str, ...]) -> tuple[tuple[str, Cue], ...]:
    found = ((name, getattr(table, name)) for name in names)
    return tuple((name, cue) for name, cue in found if cue is not None)


class CueSet(_Table, frozen=True, kw_only=True):
    """Additive evidence of any of the cues; score = logistic(bias + sum). Colours are CIE Lab minus the soil's."""

    bias: float
    lightness: Cue | None = None
    green_red: Cue | None = None
    blue_yellow: Cue | None = None
    roughness: Cue | None = None  # mean gradient over the soil's own
    likeness: Cue | None = None  # share of rock, by the first look, among pixels of the same colour in the picture

    def named(self) -> tuple[tuple[str, Cue], ...]:
        """Name and evidence of the cues that are there."""
        return _named(self, CUE_NAMES)


class RockCues(CueSet, frozen=True, kw_only=True):
    """The first look, which judges each pixel by itself."""

    shade_compensation: float = 0.0  # 1: colours against soil darkened to the pixel's lightness, 0: as it is


class Binarization(_Table, frozen=True, kw_only=True):
    """From the picture to rock pixels; lengths in pixels of the working picture."""

    blur_px: float = 1.0
    roughness_window_px: int = 9
    threshold: float = 0.45  # of the score, where a window gives no optimum of its own
    threshold_span: tuple[float, float] = (0.3, 0.6)  # an optimum outside is pulled to the nearer end
    spread: float = 0.15  # a window whose score deviates less has no two classes
    edge_low: float = 40.0
    edge_high: float = 110.0
    edge_score: float = 0.3  # an edge pixel beside rock with at least this score closes the outline
    close_px: int = 5
    open_px: int = 5
    neck_ratio: float = 0.0  # a blob is parted where it is narrower than this share of its parts' width; 0: never
    min_area_px: int = 80


class Parting(_Table, frozen=True, kw_only=True):
    """Evidence that a straight line through a blob parts two rocks, in log odds; see `perception.rock_parting`."""

    bias: float
    threshold: float  # log odds that all lines together must have that one of them parts two rocks
    least_px: int  # pixels that a cut must leave on either side
    area: Cue | None = None  # decimal logarithm of the pixels of the blob
    smaller: Cue | None = None  # the same of the smaller part
    whole_fill: Cue | None = None  # area over that of the ellipse with the same moments: of the blob
    least_fill: Cue | None = None  # the lesser of the two parts
    ellipse_gain: Cue | None = None  # fill times area, of both parts minus the blob, over the smaller part's area
    ellipse_lack: Cue | None = None  # what the blob's fill lacks of 1, times its area, over the smaller part's
    chord: Cue | None = None  # length of the cut over the root of the smaller area
    bend: Cue | None = None  # how deep the outline bends in at that end of the cut where it does so more, pixels
    lesser_bend: Cue | None = None  # and at the other end
    level: Cue | None = None  # 1 where the cut is level, 0 where it is upright
    above: Cue | None = None  # the same, negative where the smaller part lies below
    light_step: Cue | None = None  # step of L* at the cut over the blob's standard deviation
    lit_above: Cue | None = None  # L* of the smaller part minus that of 3 pixels of the other beside it, times `above`
    hue_beside: Cue | None = None  # difference of b* / L* between the same two
    score_dip: Cue | None = None  # rock score along the cut minus the blob's
    score_drop: Cue | None = None  # and minus the smaller part's

    def named(self) -> tuple[tuple[str, Cue], ...]:
        """Name and evidence of the cues that are there."""
        return _named(self, PARTING_CUES)


class ClastCues(_Table, frozen=True, kw_only=True):
    """Additive evidence that a pixel shows a clast, of any of the cues; see `perception.clasts` for how they are made.

    Means are over 3 x 3 pixels where not said otherwise, and so are most and least.
    """

    bias: float
    red: Cue | None = None  # logarithm of red over blue, minus the picture's median
    red_median: Cue | None = None
    red_mean: Cue | None = None
    red_over: Cue | None = None  # minus its mean over 7 x 7
    red_most: Cue | None = None  # the reddest neighbour, minus the same
    red_least: Cue | None = None
    score: Cue | None = None  # evidence of rock
    score_around: Cue | None = None  # mean over 7 x 7
    light_over: Cue | None = None  # logarithm of the grey level, minus its mean over 13 x 13
    light_detail: Cue | None = None  # minus its mean
    light_range: Cue | None = None  # most minus least
    chance: Cue | None = None  # of a clast, by the first look; in the second only
    chance_mean: Cue | None = None
    chance_most: Cue | None = None
    chance_least: Cue | None = None
    chance_around: Cue | None = None  # mean over 7 x 7

    def named(self) -> tuple[tuple[str, Cue], ...]:
        """Name and evidence of the cues that are there."""
        return _named(self, CLAST_CUES)


class ClastKnowledge(_Table, frozen=True, kw_only=True):
    """Evidence for clasts down to a few pixels: two looks."""

    rock_cut: float  # chance over which a pixel belongs to a rock or pebble
    first: ClastCues
    second: ClastCues


class SkyEvidence(_Table, frozen=True, kw_only=True):
    """Additive evidence for sky or far ridge in cells of the picture, in log odds, and the price of the skyline."""

    bias: float
    step_cost: float  # of the skyline, a row of cells between neighbouring columns
    least: float  # evidence that a column must have to count as sky at all
    least_width: float  # share of the columns that sky must have, or it is none
    lightness: Cue | None = None  # L*, a* and b* minus the median of the lower half
    green_red: Cue | None = None
    blue_yellow: Cue | None = None
    texture: Cue | None = None  # natural logarithm of the mean gradient over that of the lower half
    texture_over: Cue | None = None  # the same, over a broader window, the largest over the cell in its column
    texture_level: Cue | None = None  # logarithm of the gradient itself
    row: Cue | None = None  # 0 top, 1 bottom

    def named(self) -> tuple[tuple[str, Cue], ...]:
        """Name and evidence of the cues that are there."""
        return _named(self, SKY_CUES)


class Sky(_Table, frozen=True, kw_only=True):
    """Sky without a known attitude: evidence for pictures with colour and without."""

    colour: SkyEvidence
    grey: SkyEvidence


class GroundKnowledge(_Table, frozen=True, kw_only=True):
    """How far and how well the ground is known."""

    max_range_m: float = 10.0
    min_diameter_m: float = 0.0  # smaller rocks are left to the wheels and not placed
    horizon_dip_deg: float = 2.0  # what is closer to the horizon is too far to judge
    pixel_sd: float = 0.7
    attitude_sd_deg: float = 0.3
    ground_sd_m: float = 0.045  # of the ground near the rover against the believed plane
    slope_sd: float = 0.018  # how far rolling ground leaves the plane, per metre of range


class RockKnowledge(_Table, frozen=True, kw_only=True):
    """When a blob counts as a rock, and how its shape is read."""

    min_certainty: float = 0.4
    round_ratio: float = 1.25  # extents that differ by less: formation 0


class TerrainKnowledge(_Table, frozen=True, kw_only=True):
    """When a window counts as one of the classes."""

    min_certainty: float = 0.0  # of the strongest class; a window of which the rules know less is uncertain


class _File(_Table, frozen=True, kw_only=True):
    name: str
    soil: SoilKnowledge
    cues: RockCues
    second_cues: CueSet | None = None  # a second look, with what the first one found; None: the first look counts
    grey_cues: CueSet | None = None  # the only look at pictures without colour; None: `cues` without those of colour
    binarization: Binarization
    parting: Parting | None = None  # lines that part the rocks of one blob; None: necks alone part them
    clasts: ClastKnowledge | None = None  # None: rocks are made of their own evidence, and no rule asks for clasts
    sky: Sky
    ground: GroundKnowledge
    rock: RockKnowledge
    terrain: TerrainKnowledge


@dataclass(frozen=True)
class Knowledge:
    """A whole knowledge file with its rule bases."""

    name: str
    soil: SoilKnowledge
    cues: RockCues
    second_cues: CueSet | None
    grey_cues: CueSet | None
    binarization: Binarization
    parting: Parting | None
    clasts: ClastKnowledge | None
    sky: Sky
    ground: GroundKnowledge
    rock: RockKnowledge
    terrain: TerrainKnowledge
    rock_rules: RuleBase
    terrain_rules: RuleBase
    paper_rules: RuleBase  # of the terrain classes, by the 2004 paper's own features alone


def load_knowledge(name_or_path: str | Path) -> Knowledge:
    """Knowledge of a shipped name (``mars``, ``rendered``) or of a TOML file.

    Raises InputError naming the file, the key and what is allowed.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        shipped = Path(__file__).parent / "knowledge"
        path = shipped / f"{name_or_path}.toml"
        if not path.is_file():
            names = ", ".join(sorted(p.stem for p in shipped.glob("*.toml")))
            raise InputError(f"knowledge {str(name_or_path)!r} is not shipped; allowed are {names} or a .toml file")
    return _decode(read_table(path), str(path))


def _decode(table: dict[str, Any], source: str) -> Knowledge:
    rules = {key: table.pop(key, {}) for key in ("rock_rules", "terrain_rules", "paper_rules")}
    plain = convert_table(table, _File, source)
    check_limits(plain, LIMITS, source)
    for key in ("cues", "second_cues", "grey_cues"):
        _check_cues(getattr(plain, key), f"{source}: {key}", first_look=key != "second_cues")
    for key, evidence in (("sky.colour", plain.sky.colour), ("sky.grey", plain.sky.grey), ("parting", plain.parting)):
        for name, cue in evidence.named() if evidence is not None else ():
            _check_cue(cue, f"{source}: {key}.{name}")
    _check_clasts(plain.clasts, rules["terrain_rules"], source)
    return Knowledge(
        **{field: getattr(plain, field) for field in plain.__struct_fields__},
        rock_rules=_rules(rules["rock_rules"], f"{source}: rock_rules", ROCK_INPUTS),
        terrain_rules=_rules(rules["terrain_rules"], f"{source}: terrain_rules", TERRAIN_INPUTS),
        paper_rules=_rules(rules["paper_rules"], f"{source}: paper_rules", PAPER_INPUTS),
    )


def _check_cues(cues: CueSet | None, source: str, *, first_look: bool) -> None:
    for name, cue in cues.named() if cues is not None else ():
        if first_look and name == "likeness":
            raise InputError(f"{source}: likeness needs a look before it; it may stand in second_cues only")
        _check_cue(cue, f"{source}.{name}")


def _check_clasts(clasts: ClastKnowledge | None, rules: Any, source: str) -> None:
    asked = sorted(set(CLAST_INPUTS) & set(rules.get("input", ()) if isinstance(rules, dict) else ()))
    if clasts is None and asked:
        raise InputError(f"{source}: terrain_rules: input {asked[0]!r} needs the table clasts, which is not there")
    for look, cues in (("first", clasts.first), ("second", clasts.second)) if clasts is not None else ():
        for name, cue in cues.named():
            if look == "first" and name.startswith("chance"):
                raise InputError(f"{source}: clasts.first: {name} needs a look before it; it may stand in second only")
            _check_cue(cue, f"{source}: clasts.{look}.{name}")
        if not cues.named():
            raise InputError(f"{source}: clasts.{look}: no cue; any of {', '.join(CLAST_CUES)}")


def _check_cue(cue: Cue, source: str) -> None:
    rising = all(a < b for a, b in pairwise(cue.value))
    if len(cue.value) != len(cue.evidence) or len(cue.value) < 2 or not rising:
        raise InputError(f"{source}: value must rise and be as long as evidence, two knots or more")


def _rules(table: Any, source: str, allowed: tuple[str, ...]) -> RuleBase:
    base = rule_base(table if isinstance(table, dict) else {}, source)
    for name in base.input_names:
        if name not in allowed:
            raise InputError(f"{source}: unknown input {name!r}; allowed are {', '.join(allowed)}")
    return base
