"""Ten thousand transfers with everything that can go wrong, from fixed seeds: lists whole, results true, nobody stuck.

A small share runs with the other tests, the whole with ``pytest -m slow tests/test_mavlink_fuzz_transfers.py``.
"""

from __future__ import annotations

import sys

import pytest

from rover_sim.mavlink.persona import PERSONAS
from tests.mavlink_transfers import Desk


def run(persona: str, count: int, seed: int) -> Desk:
    desk = Desk(PERSONAS[persona], seed)
    values = {name: desk.yard.autopilot.parameters[name] for name in desk.yard.autopilot.parameters.names}
    for _ in range(count):
        desk.transfer()
    after = desk.yard.autopilot.parameters
    assert values == {name: after[name] for name in after.names}
    return desk


@pytest.mark.parametrize("persona", PERSONAS)
def test_a_share_of_the_transfers(persona: str) -> None:
    desk = run(persona, 65, 1)
    assert desk.counts["stored"] > 40
    assert {f"result {code}" for code in (0, 3, 4, 14, 15)} <= desk.counts.keys()  # all of it happens


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize(
    ("persona", "count", "seed"), [("ardupilot", 4_000, 2), ("px4", 3_000, 3), ("generic", 3_000, 4)]
)
def test_ten_thousand_transfers(persona: str, count: int, seed: int) -> None:
    desk = run(persona, count, seed)
    sys.stdout.write(f"{persona} {dict(sorted(desk.counts.items()))}\n")
