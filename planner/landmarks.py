"""Rocks as landmarks: a map in the rover's own belief that corrects its pose, and is corrected with it.

Extended Kalman filter over the state of `planner.localization` and the places of M rocks (EKF-SLAM: Durrant-Whyte and
Bailey, IEEE Robotics and Automation Magazine 13(2), 2006). Between two pictures only the rover's own part is worked on;
what the map gets from that is made up for at the next picture (`localization.Carried`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import hypot

import numpy as np

from planner.ground_cells import inside_polygon
from planner.landmark_matching import Index, MatchModel, Pairs, compatible, gate, individually
from planner.landmark_views import (
    AXES,
    AZIMUTH,
    DISTANCE,
    RockViews,
    ViewModel,
    camera_offset,
    expected_views,
    level_axes,
    placed,
    rock_views,
)
from planner.localization import LocalizationState, nothing_carried
from planner.localization_kernels import FACTOR, STATES, YAW, Z
from worlds.geometry import wrap_angle
from worlds.types import BoolArray, FloatArray, IntArray, Observation, PoseEstimate, Vector3


@dataclass(frozen=True)
class LandmarkModel:
    """What is seen, how it is matched, and what is kept."""

    view: ViewModel = ViewModel()  # noqa: RUF009 - frozen
    match: MatchModel = MatchModel()  # noqa: RUF009 - frozen
    most: int = 120  # landmarks
    keep_m: float = 5.0  # farther than this from the rover only one landmark a cell is kept ...
    cell_m: float = 2.0
    sure_range_m: tuple[float, float] = (1.2, 3.5)  # where a landmark should be seen
    most_missed: int = 4
    lost_share: float = 0.25  # of the landmarks that should be seen; fewer are met: a bad look
    lost_least: int = 4  # of them at least, for a judgement
    lost_looks: int = 4  # bad looks in a row: lost
    lost_sd_m: float = 2.5  # as is one whose place is not known better than this ...
    lost_travel_share: float = 0.02  # ... and this share of its wheels' travel


@dataclass(frozen=True, eq=False)
class LandmarkMap:
    """M landmarks, their errors' covariances with each other and with the rover's state, and what is known of each."""

    place_w: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))  # (M, 3)
    cross: FloatArray = field(default_factory=lambda: np.zeros((STATES, 0)))  # (13, 3 M)
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))  # (3 M, 3 M)
    log_size: FloatArray = field(default_factory=lambda: np.zeros(0))  # (M,) of the diameter
    views: FloatArray = field(default_factory=lambda: np.zeros(0))  # (M,) how often seen
    missed: FloatArray = field(default_factory=lambda: np.zeros(0))  # (M,) in a row, in view
    by_scale: FloatArray = field(default_factory=lambda: np.zeros(0))  # (3 M,) as of the state
    bad_looks: int = 0

    def __len__(self) -> int:
        return len(self.log_size)

    def select(self, index: Index) -> LandmarkMap:
        """Only the landmarks ``index`` (K,)."""
        rows = (3 * index[:, None] + np.arange(3)).ravel()
        return LandmarkMap(
            self.place_w[index],
            self.cross[:, rows],
            self.covariance[np.ix_(rows, rows)],
            self.log_size[index],
            self.views[index],
            self.missed[index],
            self.by_scale[rows],
            self.bad_looks,
        )


@dataclass(frozen=True, eq=False)
class Watched:
    """The belief after a picture, and how it went."""

    state: LocalizationState
    landmarks: LandmarkMap
    seen: int = 0
    matched: int = 0
    expected: int = 0
    lost: str = ""  # how it shows; empty if it does not
    pairs: tuple[Index, Index] = (np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp))  # landmark, rock


def watch(
    state: LocalizationState,
    known: LandmarkMap,
    observation: Observation,
    estimate: PoseEstimate,
    camera_b: Vector3,
    model: LandmarkModel | None = None,
) -> Watched:
    """The belief after the rocks of a picture, which were placed by the pose ``estimate`` at the time of ``state``."""
    model = model or LandmarkModel()
    known = _caught_up(known, state)
    state = replace(state, carried=nothing_carried(), by_scale=state.carried.passed @ state.by_scale)
    views = rock_views(observation, estimate, camera_b, model.view)
    pairs, should = _matched(state, known, views, observation, camera_b, model)
    met = len(pairs[0])
    bad = int(should.sum()) >= model.lost_least and met < model.lost_share * should.sum()
    good = int(should.sum()) >= model.lost_least and not bad
    known = replace(known, bad_looks=0 if good else known.bad_looks + bad)
    fresh = _unlike_any(state, known, views, pairs, camera_b)
    state, known = _corrected(state, known, views, pairs, camera_b)
    known = _counted(known, views, pairs, should)
    if not bad and known.bad_looks < model.lost_looks:
        known = _extended(state, known, views, fresh, camera_b)
    known = _thinned(known, state.mean[:2], model)
    result = Watched(state, known, len(views), met, int(should.sum()), pairs=pairs)
    return replace(result, lost=_lost(result, model))


def _caught_up(known: LandmarkMap, state: LocalizationState) -> LandmarkMap:
    """The map as the readings since the last picture leave it."""
    carried, cross = state.carried, known.cross
    return replace(
        known,
        place_w=known.place_w + (cross.T @ carried.pulled).reshape(-1, 3),
        cross=carried.passed @ cross,
        covariance=known.covariance - cross.T @ carried.learned @ cross,
        by_scale=known.by_scale - cross.T @ carried.learned @ state.by_scale,
    )


def _joint(state: LocalizationState, known: LandmarkMap) -> FloatArray:
    """Covariance (13 + 3 M, 13 + 3 M) of state and map."""
    return np.block([[state.covariance, known.cross], [known.cross.T, known.covariance]])


def _rows(by_state: FloatArray, by_place: FloatArray, landmark: Index, count: int) -> FloatArray:
    """Derivatives (P, C, 13 + 3 M) of what is expected of some landmarks by state and map."""
    rows = np.zeros((len(landmark), by_state.shape[1], STATES + 3 * count))
    rows[:, :, :STATES] = by_state
    for pair, column in enumerate(STATES + 3 * landmark):
        rows[pair, :, column : column + 3] = by_place[pair]
    return rows


def _off(seen: FloatArray, expected: FloatArray) -> FloatArray:
    """Differences (..., C), the azimuth's within half a turn."""
    off = seen - expected
    off[..., AZIMUTH] = (off[..., AZIMUTH] + np.pi) % (2.0 * np.pi) - np.pi
    return off


def _matched(
    state: LocalizationState,
    known: LandmarkMap,
    views: RockViews,
    observation: Observation,
    camera_b: Vector3,
    model: LandmarkModel,
) -> tuple[tuple[Index, Index], BoolArray]:
    """Landmarks and the views that are they; and which landmarks (M,) should have been seen."""
    none = np.zeros(0, dtype=np.intp)
    if len(known) == 0:
        return (none, none), np.zeros(0, dtype=bool)
    expected, by_state, by_place = expected_views(state, known.place_w, camera_b)
    distance = np.exp(expected[:, DISTANCE])
    inside = np.zeros(len(known), dtype=bool)
    if len(observation.footprint_w) >= 3:
        inside = inside_polygon(observation.footprint_w, known.place_w[:, :2])
    near, far = model.sure_range_m
    should = inside & (distance > near) & (distance < far) & (known.views >= 3)
    if len(views) == 0:
        return (none, none), should
    rough = np.flatnonzero((np.abs(expected[:, AZIMUTH]) < 1.2) & (distance < model.view.reach_m + 3.0))
    rows = _rows(by_state[rough], by_place[rough], rough, len(known))
    stacked = rows.reshape(-1, rows.shape[2])
    whole = stacked @ _joint(state, known) @ stacked.T
    blocks = AXES * np.arange(len(rough))[:, None] + np.arange(AXES)
    alone = whole[blocks[:, :, None], blocks[:, None, :]]
    noise = views.sd[:] ** 2
    off = _off(views.seen[None, :], expected[rough, None])
    sized = (views.log_size[None] - known.log_size[rough, None]) ** 2 / (2.0 * model.view.size_sd**2)
    spread = alone[:, None] + noise[None, :, :, None] * np.eye(AXES)
    apart = individually(off, spread) + sized
    first, view = np.nonzero(apart < gate(AXES, model.match.confidence))
    if len(first) == 0:
        return (none, none), should
    index = blocks[first].ravel()
    # Two pairs of one rock or one landmark exclude each other, so that their noises never meet.
    joint = whole[np.ix_(index, index)] + np.diag(noise[view].ravel())
    pairs = Pairs(rough[first], view, off[first, view], joint, sized[first, view])
    taken = compatible(pairs, model.match)
    return (pairs.landmark[taken], pairs.view[taken]), should


def _unlike_any(
    state: LocalizationState,
    known: LandmarkMap,
    views: RockViews,
    pairs: tuple[Index, Index],
    camera_b: Vector3,
) -> Index:
    """Views (K,) that are no landmark's, by a wide gate."""
    free = np.ones(len(views), dtype=bool)
    free[pairs[1]] = False
    if len(known) and len(views):
        expected, _, _ = expected_views(state, known.place_w, camera_b)
        off = _off(views.seen[None, :, :2], expected[:, None, :2])
        apart = np.abs(off / (3.0 * np.hypot(views.sd[None, :, :2], 0.03)))
        free &= ~(apart.max(axis=2) < 1.0).any(axis=0)
    return np.flatnonzero(free)


def _corrected(
    state: LocalizationState,
    known: LandmarkMap,
    views: RockViews,
    pairs: tuple[Index, Index],
    camera_b: Vector3,
) -> tuple[LocalizationState, LandmarkMap]:
    """State and map after the matched views.

    That all distances may be off by one share is no error that the gain reckons with: geometry that is off a little
    would pull an estimate of it anywhere. What it would do to state and map is kept beside (after Schmidt, 1966).
    """
    landmark, view = pairs
    if len(landmark) == 0:
        return state, known
    expected, by_state, by_place = expected_views(state, known.place_w, camera_b)
    rows = _rows(by_state[landmark], by_place[landmark], landmark, len(known))
    rows = rows.reshape(-1, rows.shape[2])
    off = _off(views.seen[view], expected[landmark]).ravel()
    noise = views.sd[view].ravel() ** 2
    joint = _joint(state, known)
    reach = joint @ rows.T
    spread = rows @ reach + np.diag(noise)
    gain = np.linalg.solve(spread, reach.T).T
    step = gain @ off
    joint = joint - gain @ reach.T
    by_scale = np.concatenate([state.by_scale, known.by_scale])
    told = np.zeros((len(view), AXES))
    told[:, DISTANCE] = 1.0
    by_scale = by_scale + gain @ (told.ravel() - rows @ by_scale)
    joint = 0.5 * (joint + joint.T)
    mean = state.mean + step[:STATES]
    mean[YAW] = wrap_angle(float(mean[YAW]))
    mean[FACTOR] = np.clip(mean[FACTOR], -0.5, 1.5)
    corrected = replace(
        state, mean=mean, covariance=np.ascontiguousarray(joint[:STATES, :STATES]), by_scale=by_scale[:STATES]
    )
    return corrected, replace(
        known,
        place_w=known.place_w + step[STATES:].reshape(-1, 3),
        cross=joint[:STATES, STATES:],
        covariance=joint[STATES:, STATES:],
        by_scale=by_scale[STATES:],
    )


def _counted(known: LandmarkMap, views: RockViews, pairs: tuple[Index, Index], should: BoolArray) -> LandmarkMap:
    """The map with sizes averaged, and views and misses counted."""
    landmark, view = pairs
    times, missed, size = known.views.copy(), known.missed + should, known.log_size.copy()
    size[landmark] += (views.log_size[view] - size[landmark]) / np.minimum(times[landmark] + 1.0, 5.0)
    times[landmark] += 1.0
    missed[landmark] = 0.0
    return replace(known, views=times, missed=missed, log_size=size)


def _extended(
    state: LocalizationState,
    known: LandmarkMap,
    views: RockViews,
    fresh: Index,
    camera_b: Vector3,
) -> LandmarkMap:
    """The map with the views ``fresh`` as new landmarks."""
    if len(fresh) == 0:
        return known
    new = RockViews(views.seen[fresh], views.sd[fresh], views.log_size[fresh])
    place, by_state, own = placed(state, new, camera_b)
    slope = by_state.reshape(-1, STATES)
    # A share too much of the distance and what it brings the rover to believe lie along the line of sight.
    eye = state.mean[: Z + 1] + camera_offset(state, camera_b) @ level_axes(float(state.mean[YAW]))
    by_scale = (eye - place).ravel()
    covariance = slope @ state.covariance @ slope.T
    for k in range(len(fresh)):
        covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] += own[k]
    beside = slope @ known.cross
    return LandmarkMap(
        np.vstack([known.place_w, place]),
        np.hstack([known.cross, state.covariance @ slope.T]),
        np.block([[known.covariance, beside.T], [beside, covariance]]),
        np.concatenate([known.log_size, new.log_size]),
        np.concatenate([known.views, np.ones(len(fresh))]),
        np.concatenate([known.missed, np.zeros(len(fresh))]),
        np.concatenate([known.by_scale, slope @ state.by_scale + by_scale]),
        known.bad_looks,
    )


def _thinned(known: LandmarkMap, here_w: FloatArray, model: LandmarkModel) -> LandmarkMap:
    """The map without what is missed again and again, and with one landmark a cell far from the rover."""
    if len(known) == 0:
        return known
    apart = np.hypot(*(known.place_w[:, :2] - here_w).T)
    kept = known.missed < model.most_missed + 0.3 * known.views
    far = apart > model.keep_m
    kept &= ~far | (known.views >= 3)
    cells: IntArray = np.floor(known.place_w[:, :2] / model.cell_m).astype(np.int32)
    best: dict[tuple[int, int], int] = {}
    for index in np.flatnonzero(kept & far):
        cell = (int(cells[index, 0]), int(cells[index, 1]))
        if cell not in best or known.views[index] > known.views[best[cell]]:
            best[cell] = int(index)
    kept[far] = False
    kept[list(best.values())] = True
    chosen = np.flatnonzero(kept)
    if len(chosen) > model.most:
        order = np.argsort(apart[chosen], kind="stable")[: model.most]
        chosen = np.sort(chosen[order])
    return known if len(chosen) == len(known) else known.select(chosen)


def _lost(watched: Watched, model: LandmarkModel) -> str:
    """What shows that the rover does not know where it is; empty if nothing does."""
    bad = watched.landmarks.bad_looks
    if bad >= model.lost_looks:
        return f"{watched.matched} of {watched.expected} landmarks met, {bad} pictures in a row"
    sd = hypot(*np.sqrt(np.diag(watched.state.place_covariance)[:2]))
    if sd > model.lost_sd_m + model.lost_travel_share * watched.state.travel_m:
        return f"place known to {sd:.1f} m only"
    return ""
