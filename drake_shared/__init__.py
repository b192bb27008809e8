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
_MODULES = {
    "AddSharedControl": "drake_shared.simulation.diagram",
    "Arbiter": "drake_shared.systems.arbiter",
    "Arm": "drake_shared.robots",
    "ArmPlant": "drake_shared.systems.arm_plant",
    "Authority": "drake_shared.arbitration.authority",
    "Behaviour": "drake_shared.systems.surrogate_operator",
    "Box": "drake_shared.scenario",
    "Circle": "drake_shared.scenario",
    "CockpitServer": "drake_shared.cockpit",
    "ConfidenceBlender": "drake_shared.systems.confidence_blender",
    "ConflictFeedback": "drake_shared.systems.conflict_feedback",
    "Counterfactual": "drake_shared.analysis.counterfactual",
    "Demonstration": "drake_shared.demonstrations",
    "Demonstrations": "drake_shared.demonstrations",
    "DiffDrive": "drake_shared.robots",
    "DiffDrivePlant": "drake_shared.systems.diff_drive_plant",
    "DrakeSharedError": "drake_shared.common.errors",
    "DriverLock": "drake_shared.cockpit",
    "DriverPresence": "drake_shared.systems.driver_presence",
    "DynamicPlant": "drake_shared.systems.dynamic_plant",
    "Faults": "drake_shared.simulation.faults",
    "Feedback": "drake_shared.arbitration.feedback",
    "Goal": "drake_shared.scenario",
    "InputError": "drake_shared.common.errors",
    "Intention": "drake_shared.systems.intention",
    "IntentionEstimator": "drake_shared.systems.intention_estimator",
    "IntentionVisualizer": "drake_shared.systems.intention_visualizer",
    "Learner": "drake_shared.learners",
    "MakeSharedControlDiagram": "drake_shared.simulation.diagram",
    "MouseInput": "drake_shared.systems.mouse_input",
    "PoseWatchdog": "drake_shared.systems.pose_watchdog",
    "RecordedInput": "drake_shared.systems.recorded_input",
    "Robot": "drake_shared.robots",
    "Route": "drake_shared.scenario",
    "RunError": "drake_shared.common.errors",
    "SafetyFilter": "drake_shared.systems.safety_filter",
    "Scenario": "drake_shared.scenario",
    "Session": "drake_shared.cockpit",
    "SharedControl": "drake_shared.simulation.shared_control",
    "SharedControlConfig": "drake_shared.simulation.config",
    "Simulation": "drake_shared.simulation.trial",
    "Start": "drake_shared.scenario",
    "SurrogateOperator": "drake_shared.systems.surrogate_operator",
    "Trial": "drake_shared.simulation.trial",
    "TrialSettings": "drake_shared.simulation.trial",
    "WaypointController": "drake_shared.systems.waypoint_controller",
    "Workspace": "drake_shared.scenario",
    "arbiter_names": "drake_shared.systems.arbiters",
    "calibrate": "drake_shared.learners",
    "check_learner": "drake_shared.learners",
    "config_for": "drake_shared.simulation.config",
    "config_of_log": "drake_shared.simulation.config",
    "drive": "drake_shared.cockpit",
    "load_config": "drake_shared.simulation.config",
    "load_learner": "drake_shared.learners",
    "load_scenario": "drake_shared.scenario",
    "make_arbiter": "drake_shared.systems.arbiters",
    "metrics": "drake_shared.analysis.metrics",
    "open_session": "drake_shared.cockpit",
    "play_open_loop": "drake_shared.analysis.counterfactual",
    "read_demonstrations": "drake_shared.demonstrations",
    "read_log": "drake_shared.simulation.trial",
    "read_logs": "drake_shared.simulation.log",
    "run_trial": "drake_shared.simulation.trial",
    "save_learner": "drake_shared.learners",
    "summarize": "drake_shared.analysis.metrics",
    "teach": "drake_shared.simulation.teaching",
    "train": "drake_shared.learners",
    "write_demonstrations": "drake_shared.demonstrations",
    "write_log": "drake_shared.simulation.trial",
    "write_logs": "drake_shared.simulation.log",
    "write_replay": "drake_shared.analysis.replay",
}

__all__ = sorted(_MODULES)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_MODULES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})
