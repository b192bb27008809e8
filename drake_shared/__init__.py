"""Shared control for Drake: a person steers, a learner predicts where to, its confidence divides the command.

The method is that of Amirshirzad, Ugur, Bebek and Oztop, "Adaptive Shared Control with Human Intention
Estimation for Human Agent Collaboration" (2022). Every part is a Drake LeafSystem;
``MakeSharedControlDiagram`` wires them.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from drake_shared.analysis.counterfactual import (
        Counterfactual as Counterfactual,
        play_open_loop as play_open_loop,
    )
    from drake_shared.analysis.metrics import metrics as metrics, summarize as summarize
    from drake_shared.analysis.replay import write_replay as write_replay
    from drake_shared.arbitration.authority import Authority as Authority
    from drake_shared.arbitration.feedback import Feedback as Feedback
    from drake_shared.cockpit import (
        CockpitServer as CockpitServer,
        DriverLock as DriverLock,
        Session as Session,
        drive as drive,
        open_session as open_session,
    )
    from drake_shared.common.errors import (
        DrakeSharedError as DrakeSharedError,
        InputError as InputError,
        RunError as RunError,
    )
    from drake_shared.demonstrations import (
        Demonstration as Demonstration,
        Demonstrations as Demonstrations,
        read_demonstrations as read_demonstrations,
        write_demonstrations as write_demonstrations,
    )
    from drake_shared.learners import (
        Learner as Learner,
        calibrate as calibrate,
        check_learner as check_learner,
        load_learner as load_learner,
        save_learner as save_learner,
        train as train,
    )
    from drake_shared.robots import Arm as Arm, DiffDrive as DiffDrive, Robot as Robot
    from drake_shared.scenario import (
        Box as Box,
        Circle as Circle,
        Goal as Goal,
        Route as Route,
        Scenario as Scenario,
        Start as Start,
        Workspace as Workspace,
        load_scenario as load_scenario,
    )
    from drake_shared.simulation.config import (
        SharedControlConfig as SharedControlConfig,
        config_for as config_for,
        config_of_log as config_of_log,
        load_config as load_config,
    )
    from drake_shared.simulation.diagram import (
        AddSharedControl as AddSharedControl,
        MakeSharedControlDiagram as MakeSharedControlDiagram,
    )
    from drake_shared.simulation.faults import Faults as Faults
    from drake_shared.simulation.log import read_logs as read_logs, write_logs as write_logs
    from drake_shared.simulation.shared_control import SharedControl as SharedControl
    from drake_shared.simulation.teaching import teach as teach
    from drake_shared.simulation.trial import (
        Simulation as Simulation,
        Trial as Trial,
        TrialSettings as TrialSettings,
        read_log as read_log,
        run_trial as run_trial,
        write_log as write_log,
    )
    from drake_shared.systems.arbiter import Arbiter as Arbiter
    from drake_shared.systems.arbiters import arbiter_names as arbiter_names, make_arbiter as make_arbiter
    from drake_shared.systems.arm_plant import ArmPlant as ArmPlant
    from drake_shared.systems.confidence_blender import ConfidenceBlender as ConfidenceBlender
    from drake_shared.systems.conflict_feedback import ConflictFeedback as ConflictFeedback
    from drake_shared.systems.diff_drive_plant import DiffDrivePlant as DiffDrivePlant
    from drake_shared.systems.driver_presence import DriverPresence as DriverPresence
    from drake_shared.systems.dynamic_plant import DynamicPlant as DynamicPlant
    from drake_shared.systems.intention import Intention as Intention
    from drake_shared.systems.intention_estimator import IntentionEstimator as IntentionEstimator
    from drake_shared.systems.intention_visualizer import IntentionVisualizer as IntentionVisualizer
    from drake_shared.systems.mouse_input import MouseInput as MouseInput
    from drake_shared.systems.pose_watchdog import PoseWatchdog as PoseWatchdog
    from drake_shared.systems.recorded_input import RecordedInput as RecordedInput
    from drake_shared.systems.safety_filter import SafetyFilter as SafetyFilter
    from drake_shared.systems.surrogate_operator import (
        Behaviour as Behaviour,
        SurrogateOperator as SurrogateOperator,
    )
    from drake_shared.systems.waypoint_controller import WaypointController as WaypointController

# A name is imported when it is first used (PEP 562), so that a learner loads without Drake.
_NAMES = {
    "analysis.counterfactual": "Counterfactual play_open_loop",
    "analysis.metrics": "metrics summarize",
    "analysis.replay": "write_replay",
    "arbitration.authority": "Authority",
    "arbitration.feedback": "Feedback",
    "cockpit": "CockpitServer DriverLock Session drive open_session",
    "common.errors": "DrakeSharedError InputError RunError",
    "demonstrations": "Demonstration Demonstrations read_demonstrations write_demonstrations",
    "learners": "Learner calibrate check_learner load_learner save_learner train",
    "robots": "Arm DiffDrive Robot",
    "scenario": "Box Circle Goal Route Scenario Start Workspace load_scenario",
    "simulation.config": "SharedControlConfig config_for config_of_log load_config",
    "simulation.diagram": "AddSharedControl MakeSharedControlDiagram",
    "simulation.faults": "Faults",
    "simulation.log": "read_logs write_logs",
    "simulation.shared_control": "SharedControl",
    "simulation.teaching": "teach",
    "simulation.trial": "Simulation Trial TrialSettings read_log run_trial write_log",
    "systems.arbiter": "Arbiter",
    "systems.arbiters": "arbiter_names make_arbiter",
    "systems.arm_plant": "ArmPlant",
    "systems.confidence_blender": "ConfidenceBlender",
    "systems.conflict_feedback": "ConflictFeedback",
    "systems.diff_drive_plant": "DiffDrivePlant",
    "systems.driver_presence": "DriverPresence",
    "systems.dynamic_plant": "DynamicPlant",
    "systems.intention": "Intention",
    "systems.intention_estimator": "IntentionEstimator",
    "systems.intention_visualizer": "IntentionVisualizer",
    "systems.mouse_input": "MouseInput",
    "systems.pose_watchdog": "PoseWatchdog",
    "systems.recorded_input": "RecordedInput",
    "systems.safety_filter": "SafetyFilter",
    "systems.surrogate_operator": "Behaviour SurrogateOperator",
    "systems.waypoint_controller": "WaypointController",
}
"""Names by the module that holds them."""
_MODULES = {name: f"drake_shared.{module}" for module, names in _NAMES.items() for name in names.split()}

__all__ = sorted(_MODULES)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})
