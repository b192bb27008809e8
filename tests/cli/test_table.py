"""Tables of figures for people."""

import pytest

from drake_shared.cli.table import figure_lines


@pytest.mark.parametrize(("command_unit", "effort"), [("rad/s", "rad"), ("m/s", "m")])
def test_figures_of_commands_have_the_unit_of_the_robot(command_unit, effort):
    names = ("dissimilarity", "human_effort", "completion_time", "success")
    rows = figure_lines([(name, "1") for name in names], command_unit=command_unit)
    units = [row.split()[2] for row in rows]
    assert units == [command_unit, effort, "s", "higher"]
