"""What the lock-step engine cannot do."""

from __future__ import annotations

from drake_shared.common.errors import InputError
from drake_shared.learners import Learner
from drake_shared.learners.rows import predicts_rows
from drake_shared.robots import DiffDrive
from drake_shared.simulation.lockstep.arbiters import has_rule
from drake_shared.simulation.lockstep.noise import is_drakes
from drake_shared.simulation.trial import Simulation
from drake_shared.systems.diff_drive_plant import DiffDrivePlant
from drake_shared.systems.surrogate_operator import SurrogateOperator
from drake_shared.systems.waypoint_controller import WaypointController

ENGINES = ("auto", "drake", "lockstep")


def reason_for_drake(simulation: Simulation, engine: str) -> str | None:
    """Why trials of a simulation run in Drake; None if the lock-step engine runs them.

    Args:
        simulation: The trials.
        engine: One of `ENGINES`; "auto" takes the lock-step engine wherever it can run the trials.

    Raises:
        InputError: ``engine`` is unknown, or is "lockstep" where that engine cannot run the trials.
    """
    if engine not in ENGINES:
        raise InputError("simulate", "engine", f"must be one of {', '.join(ENGINES)}", repr(engine))
    if engine == "drake":
        return "Drake is chosen"
    reason = unsupported(simulation)
    if reason is not None and engine == "lockstep":
        raise InputError("--engine lockstep", "", f"cannot run {reason}; use --engine drake or auto")
    return None if reason is None else f"the lock-step engine cannot run {reason}"


def unsupported(simulation: Simulation, learner: Learner | None = None) -> str | None:
    """Names what the lock-step engine cannot run in trials of a simulation; None if it can run them.

    Args:
        simulation: The trials.
        learner: Of a trial; the simulation's own if None.
    """
    parts, config, scenario = simulation.parts, simulation.config, simulation.scenario
    learner = learner or simulation.learner
    if type(simulation.robot) is not DiffDrive:
        return f"robot {type(simulation.robot).__name__}"
    if type(parts.operator) is not SurrogateOperator:
        return f"operator {type(parts.operator).__name__}"
    if type(parts.plant) is not DiffDrivePlant:
        return f"plant {type(parts.plant).__name__}"
    if any(obstacle.path for obstacle in scenario.obstacles):
        return "moving obstacles"
    if type(parts.controller) is not WaypointController:
        return f"controller {type(parts.controller).__name__}"
    if parts.driver_switch is not parts.arbiter or not has_rule(parts.driver_switch):
        return f"arbiter {parts.arbitration['name']}"
    if config.feedback:
        return "feedback of conflicts"
    faults = config.faults
    if faults.on_pose or faults.on_learner or faults.slip:
        return f"fault {', '.join(faults.to_json())}"
    if learner is not None and not predicts_rows(learner):
        return f"learner {learner.name}"
    if not is_drakes():
        return "the random numbers of this C++ standard library"
    return None
