"""The task: world, obstacles, routes and goal; its YAML files and their checks."""

from drake_shared.scenario.checks import check_scenario
from drake_shared.scenario.files import load_scenario, scenario_from_dict, shipped_scenarios
from drake_shared.scenario.obstacles import Box, Circle, Obstacle
from drake_shared.scenario.scenario import Goal, Route, Scenario, Start, Workspace, clearance_scorer

__all__ = [
    "Box",
    "Circle",
    "Goal",
    "Obstacle",
    "Route",
    "Scenario",
    "Start",
    "Workspace",
    "check_scenario",
    "clearance_scorer",
    "load_scenario",
    "scenario_from_dict",
    "shipped_scenarios",
]
