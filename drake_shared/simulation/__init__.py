"""Shared control in a Drake diagram: config, wiring, trials, logs, and runners for many trials."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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
    from drake_shared.simulation.log import (
        Trial as Trial,
        log_columns as log_columns,
        read_log as read_log,
        read_logs as read_logs,
        write_log as write_log,
        write_logs as write_logs,
    )
    from drake_shared.simulation.settings import (
        TrialSettings as TrialSettings,
        settings_of_log as settings_of_log,
    )
    from drake_shared.simulation.shared_control import SharedControl as SharedControl
    from drake_shared.simulation.teaching import teach as teach
    from drake_shared.simulation.trial import (
        RunningTrial as RunningTrial,
        Simulation as Simulation,
        run_trial as run_trial,
    )

# A name is imported when it is first used (PEP 562): the command line reads configs without loading Drake.
_NAMES = {
    "config": "SharedControlConfig config_for config_of_log load_config",
    "diagram": "AddSharedControl MakeSharedControlDiagram",
    "faults": "Faults",
    "log": "Trial log_columns read_log read_logs write_log write_logs",
    "settings": "TrialSettings settings_of_log",
    "shared_control": "SharedControl",
    "teaching": "teach",
    "trial": "RunningTrial Simulation run_trial",
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = sorted(_MODULES)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value
    return value
