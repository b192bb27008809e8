"""Shared control for Drake: a person steers, a learner predicts where to, its confidence divides the command.

The method is that of Amirshirzad, Ugur, Bebek and Oztop, "Adaptive Shared Control with Human Intention
Estimation for Human Agent Collaboration" (2022). Every part is a Drake LeafSystem;
``MakeSharedControlDiagram`` wires them.
"""

from drake_shared.arbitration import arbiter_names, make_arbiter
from drake_shared.authority import Authority
from drake_shared.counterfactual import Counterfactual, play_open_loop
from drake_shared.demonstrations import read_demonstrations, write_demonstrations
from drake_shared.diagram import AddSharedControl, MakeSharedControlDiagram, SharedControl
from drake_shared.errors import DrakeSharedError, InputError, RunError
from drake_shared.faults import Faults
from drake_shared.learners import calibrate, load_learner, save_learner, train
from drake_shared.metrics import metrics, summarize
from drake_shared.replay import write_replay
from drake_shared.scenario import Scenario, load_scenario
from drake_shared.systems.confidence_blender import ConfidenceBlender
from drake_shared.systems.diff_drive_plant import DiffDrivePlant
from drake_shared.systems.dynamic_plant import DynamicPlant
from drake_shared.systems.intention_estimator import Intention, IntentionEstimator
from drake_shared.systems.intention_visualizer import IntentionVisualizer
from drake_shared.systems.mouse_input import MouseInput
from drake_shared.systems.recorded_input import RecordedInput
from drake_shared.systems.safety_filter import SafetyFilter
from drake_shared.systems.surrogate_operator import Behaviour, SurrogateOperator
from drake_shared.systems.waypoint_controller import WaypointController
from drake_shared.teaching import teach
from drake_shared.trial import Simulation, Trial, TrialSettings, read_log, run_trial, write_log

__all__ = [
    "AddSharedControl",
    "Authority",
    "Behaviour",
    "ConfidenceBlender",
    "Counterfactual",
    "DiffDrivePlant",
    "DrakeSharedError",
    "DynamicPlant",
    "Faults",
    "InputError",
    "Intention",
    "IntentionEstimator",
    "IntentionVisualizer",
    "MakeSharedControlDiagram",
    "MouseInput",
    "RecordedInput",
    "RunError",
    "SafetyFilter",
    "Scenario",
    "SharedControl",
    "Simulation",
    "SurrogateOperator",
    "Trial",
    "TrialSettings",
    "WaypointController",
    "arbiter_names",
    "calibrate",
    "load_learner",
    "load_scenario",
    "make_arbiter",
    "metrics",
    "play_open_loop",
    "read_demonstrations",
    "read_log",
    "run_trial",
    "save_learner",
    "summarize",
    "teach",
    "train",
    "write_demonstrations",
    "write_log",
    "write_replay",
]
