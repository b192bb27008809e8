"""How control is shared, as one object: on the command line, in YAML files, in logs and in Python."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from collections.abc import Mapping
from typing import Any, Literal

from drake_shared.arbitration.authority import Authority
from drake_shared.arbitration.blend import DRIVERS
from drake_shared.arbitration.feedback import Feedback
from drake_shared.common.errors import InputError
from drake_shared.common.suggestions import suggestion
from drake_shared.common.typed_fields import read_fields
from drake_shared.common.yaml_document import parse_yaml, read_yaml, value_of
from drake_shared.robots import Arm, DiffDrive, Robot
from drake_shared.simulation.faults import Faults

ENDS = ("reached", "duration")
LEAST_CLEARANCE, MOST_CLEARANCE = 0.001, 1.0
"""Range of the clearance that a safety filter can keep, in [m]."""
_BLEND = "blend"
_CLEARANCES: Mapping[type, float] = {DiffDrive: 0.03 / 0.267, Arm: 0.015 / 0.09}
"""What the safety filter keeps by default, as a share of the robot's characteristic length."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class SharedControlConfig:
    """How control is shared between human and agent, and what the trials are.

    Raises:
        InputError: A field is out of range, or two of them contradict each other.
    """

    driver: Literal["shared", "human", "agent"] = "shared"
    """Who drives: shared control, the human alone, or the agent alone."""
    arbitration: str = _BLEND
    """Arbiter of shared control: blend (by confidence), halves, traded, leader-follower, fusion (by the
    posterior of the driver's route), hindsight, rt-v2, consistency, or a registered one, with options as in
    traded:threshold=0.6,margin=0.1. human and agent are short for that driver."""
    arbitration_options: Mapping[str, float | str] = dataclasses.field(default_factory=dict)
    """Options of the arbiter, by name."""
    authority: Authority = dataclasses.field(default_factory=Authority)
    """What the human keeps, whatever the agent's confidence."""
    look_ahead: float = 0.6
    """The agent steers to the position predicted this time ahead, in s."""
    path_repair: bool = True
    """Predicted paths that lead through obstacles known to the agent are moved aside, or end there."""
    safety_clearance: float | None = None
    """Distance that a safety filter keeps to obstacles, in m. None turns the filter off."""
    feedback: Feedback = dataclasses.field(default_factory=Feedback)
    """What the person feels of a conflict with the agent."""
    faults: Faults = dataclasses.field(default_factory=Faults)
    """Faults that are injected; all zero: none."""
    confidence_gain: float | None = None
    """K of eq. (1), in 1/m^2. None takes the learner's own."""
    end: Literal["reached", "duration"] = "reached"
    """The trial ends at the goal, or always at its full duration."""

    def __post_init__(self) -> None:
        self._split_arbitration()
        for name, known in (("driver", DRIVERS), ("end", ENDS)):
            value = getattr(self, name)
            if value not in known:
                expected = f"must be one of {', '.join(known)}{suggestion(str(value), known)}"
                raise InputError("config", name, expected, repr(value))
        if not isinstance(self.path_repair, bool):
            raise InputError("config", "path_repair", "must be true or false", repr(self.path_repair))
        for name in ("look_ahead", "safety_clearance", "confidence_gain"):
            value = getattr(self, name)
            optional = value is None and name != "look_ahead"
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if not (optional or (is_number and 0.0 < value < math.inf)):
                raise InputError("config", name, "must be positive and finite", repr(value))
        clearance = self.safety_clearance
        if clearance is not None and not LEAST_CLEARANCE <= clearance <= MOST_CLEARANCE:
            expected = f"must be from {LEAST_CLEARANCE} to {MOST_CLEARANCE:g} m"
            raise InputError("config", "safety_clearance", expected, clearance)
        if self.authority.enabled and self.authority != Authority():
            if self.arbitration != _BLEND:
                raise InputError("config", "authority", f"cannot be combined with {self.arbitration!r}")
            if self.driver != "shared":
                raise InputError("config", "authority", f"cannot be combined with driver {self.driver!r}")
        self.faults.check_driver(self.driver)

    def __hash__(self) -> int:
        return hash(json.dumps(self.to_json(), sort_keys=True))

    def to_json(self) -> dict[str, Any]:
        """All fields, as JSON holds them; `from_json` reads them."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(
        cls, data: Mapping[str, Any], *, source: str | os.PathLike[str] = "config"
    ) -> SharedControlConfig:
        """The config that ``data`` describes; fields that are missing have their defaults.

        Raises:
            InputError: A field is unknown, of another type, out of range, or contradicts another one.
        """
        return read_fields(cls, data, source=source)

    def _split_arbitration(self) -> None:
        """Moves options in the text of ``arbitration`` to their field, and a driver there to ``driver``."""
        if not isinstance(self.arbitration, str):
            raise InputError(
                "config", "arbitration", "must be the name of an arbiter", repr(self.arbitration)
            )
        if not isinstance(self.arbitration_options, Mapping):
            expected = "must be options with values"
            raise InputError("config", "arbitration_options", expected, repr(self.arbitration_options))
        for option, value in self.arbitration_options.items():
            if not isinstance(value, int | float | str) or value != value:
                expected = "must be a number or text"
                raise InputError("config", f"arbitration_options.{option}", expected, repr(value))
        name, colon, text = self.arbitration.partition(":")
        if colon:
            options = dict(self.arbitration_options) | _parse_options(text)
            object.__setattr__(self, "arbitration_options", options)
        if name in ("human", "agent"):
            if self.driver not in ("shared", name):
                raise InputError("config", "driver", f"cannot be combined with {name!r}", repr(self.driver))
            object.__setattr__(self, "driver", name)
            name = _BLEND
        object.__setattr__(self, "arbitration", name)


def config_for(preset: str | None, robot: Robot | None = None, **changes: Any) -> SharedControlConfig:
    """The config that goes with learners of a preset, where none is given.

    Args:
        preset: "default" gives what serves drivers best: with a differential drive posterior fusion and the
            safety filter, with an arm the blend and the safety filter. Other ones give `blend_for`.
        robot: The Pioneer if None.
        changes: Fields that differ.
    """
    robot = robot or DiffDrive()
    if preset == "default":
        if isinstance(robot, DiffDrive):
            changes = {"arbitration": "fusion", **changes}
        for kind, share in _CLEARANCES.items():
            if isinstance(robot, kind):
                changes = {"safety_clearance": round(share * robot.characteristic_length, 6), **changes}
    return blend_for(preset, **changes)


def blend_for(preset: str | None, **changes: Any) -> SharedControlConfig:
    """The blend by confidence, as it suits learners of a preset.

    Args:
        preset: "paper" gives eq. (2) alone, without authority or path repair, as in the paper; any other one
            has both. None (no learner) has neither, since there is no agent.
        changes: Fields that differ.
    """
    if preset in (None, "paper"):
        changes = {"authority": Authority(enabled=False), "path_repair": False, **changes}
    return SharedControlConfig(**changes)


# A tip that is pushed in three axes turns further off a route by noise than wheels do.
_ARM_AUTHORITY = Authority(conflict_angle=1.2, agreement_angle=0.8, conflict_time=0.5)


def config_for_robot(config: SharedControlConfig, robot: Robot) -> SharedControlConfig:
    """``config``, but for an arm its own authority in place of the default one."""
    has_default = (
        config.authority == Authority() and config.arbitration == _BLEND and config.driver == "shared"
    )
    if isinstance(robot, Arm) and has_default:
        return dataclasses.replace(config, authority=_ARM_AUTHORITY)
    return config


def load_config(path: str | os.PathLike[str]) -> SharedControlConfig:
    """Reads a config from a YAML file.

    Raises:
        InputError: The file cannot be read, or a field is unknown, of another type, out of range, or
            contradicts another one. The error names the file and the path of the field.
    """
    root = parse_yaml(read_yaml(path, "a config"), source=path, what="a config")
    return SharedControlConfig.from_json({} if root is None else value_of(root), source=path)


def config_of_log(
    metadata: Mapping[str, Any], *, source: str | os.PathLike[str] = "the log"
) -> SharedControlConfig:
    """The config with which a trial was run, from the metadata of its log.

    What the trial's own settings changed is not in it. Logs of version 0.1.0 hold the config in parts.

    Raises:
        InputError: The metadata hold no valid config.
    """
    if "config" in metadata:
        data = metadata["config"]
        # Logs that are older than the field were made without it.
        data = {"path_repair": False, **data} if isinstance(data, Mapping) else data
        return SharedControlConfig.from_json(data, source=source)
    # Logs that are older than arbitration have no such field, and no authority.
    arbitration = metadata.get("arbitration", {"name": _BLEND, "configuration": {"authority": None}})
    if not isinstance(arbitration, Mapping) or not isinstance(arbitration.get("configuration"), Mapping):
        raise InputError(source, "arbitration", "must be name and configuration of an arbiter")
    name, configuration = arbitration.get("name"), arbitration["configuration"]
    data = {"arbitration": name, "path_repair": False}
    if name == _BLEND:
        authority = configuration.get("authority")
        data["authority"] = {"enabled": False} if authority is None else authority
    elif name == "traded":
        data["arbitration_options"] = configuration
    for field in ("look_ahead", "safety_clearance", "faults", "end"):
        if metadata.get(field) is not None:
            data[field] = metadata[field]
    return SharedControlConfig.from_json(data, source=source)


def _parse_options(text: str) -> dict[str, float | str]:
    options: dict[str, float | str] = {}
    for part in text.split(","):
        name, equals, value = (item.strip() for item in part.partition("="))
        if not (name and equals and value):
            raise InputError("config", "arbitration", "must be name:option=value,...", repr(part))
        try:
            options[name] = float(value)
        except ValueError:
            options[name] = value
    return options
