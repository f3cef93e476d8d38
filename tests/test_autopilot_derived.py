"""What the autopilot makes of its parameters is kept, and made anew after every kind of change."""

from __future__ import annotations

import pytest

from rover_sim.autopilot.parameters import Parameter, ParameterTable
from rover_sim.autopilot.safety_parameters import ARDUPILOT_SAFETY, PX4_SAFETY, battery_levels, fence_rules
from rover_sim.sim.battery import Battery
from rover_sim.sim.rover import load_rover


def test_what_follows_from_parameters_follows_their_changes() -> None:
    table = ParameterTable(ARDUPILOT_SAFETY)
    first = table.derived(battery_levels)
    assert table.derived(battery_levels) is first
    assert table.set("BATT_LOW_VOLT", 22.0)
    assert [level.voltage_v for level in table.derived(battery_levels)] == [22.0, 19.8]
    assert not table.derived(fence_rules).on
    table.extend(PX4_SAFETY)
    assert [level.name for level in table.derived(battery_levels)] == ["low", "critical", "emergency"]
    assert table.derived(fence_rules).on
    table.remove(parameter.name for parameter in PX4_SAFETY)
    assert [level.name for level in table.derived(battery_levels)] == ["low", "critical"]
    assert not table.derived(fence_rules).on


def test_a_refused_value_changes_nothing_that_follows() -> None:
    table = ParameterTable((Parameter("WIDTH", 1.0, 0.0, 2.0, "m"),))

    def twice(parameters: ParameterTable) -> float:
        return 2.0 * parameters["WIDTH"]

    assert table.derived(twice) == 2.0
    assert not table.set("WIDTH", 3.0)
    assert table.derived(twice) == 2.0


@pytest.mark.parametrize(
    ("charge", "cell_V"), [(1.0, 4.18), (0.95, 4.115), (0.9, 4.05), (0.35, 3.615), (0.02, 3.06), (0.0, 2.9)]
)
def test_a_cell_at_rest_has_the_voltage_of_the_table(charge: float, cell_V: float) -> None:
    rover = load_rover("husky")
    reading = Battery(rover, charge).read(0.0, 0.0)
    assert reading.voltage_v + reading.current_a * rover.battery.resistance_ohm == pytest.approx(6 * cell_V)
