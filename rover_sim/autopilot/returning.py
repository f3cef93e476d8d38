"""Where "return" leads: to a rally point, to the fence's return point or home; or back on the rover's own track."""

from __future__ import annotations

import math

from rover_sim.autopilot.fence import nearest
from rover_sim.autopilot.fence_guard import FenceGuard
from rover_sim.autopilot.mission import DriveTo, Mission
from rover_sim.autopilot.parameters import ParameterTable
from rover_sim.autopilot.safety_parameters import rally_rules, track_rules
from rover_sim.autopilot.track import Track
from worlds.types import FloatArray, Vector3


class ReturnPlaces:
    """Rally points and the way that the rover came."""

    def __init__(self, parameters: ParameterTable, guard: FenceGuard) -> None:
        self.rally_w: tuple[Vector3, ...] = ()
        self.track = Track()
        self._parameters = parameters
        self._guard = guard

    def place(self, position_w: FloatArray | Vector3, home_w: Vector3) -> tuple[str, Vector3]:
        """What the place is, and where.

        Rally points outside of the fence or too far away do not count, and places with a clear way go before others.
        Without any rally point, a rover that has broken out goes to the fence's return point, or home if there is none.
        """
        with_home, limit_m = self._parameters.derived(rally_rules)
        rally = [
            place
            for place in self.rally_w
            if math.dist(place[:2], position_w[:2]) <= limit_m and self._guard.allows(place, home_w)
        ]
        if not rally and self._guard.breached and self._guard.fence.return_w is not None:
            return "the fence's return point", self._guard.fence.return_w
        places = [*rally, home_w] if with_home else rally
        clear = [place for place in places if not self._guard.crosses(position_w, place, home_w)]
        chosen = nearest(clear or places, position_w)
        return ("a rally point", chosen) if chosen is not None and chosen in rally else ("home", home_w)

    def note(self, position_w: FloatArray) -> None:
        """Remember that the armed rover is here."""
        spacing_m, most = self._parameters.derived(track_rules)
        if most:
            self.track.add(position_w, spacing_m, most)

    def way_back(self) -> Mission:
        """Back to where the rover was armed, on its own track; empty if that is not known."""
        known = [] if self.track.full else self.track.crumbs_w
        return Mission(tuple(DriveTo(place) for place in reversed(known)))
