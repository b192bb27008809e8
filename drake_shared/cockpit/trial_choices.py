"""What a person may choose on the page between trials: scenario, learner, arbiter, K, feedback, route."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from drake_shared.arbitration.authority import Authority
from drake_shared.arbitration.feedback import Feedback
from drake_shared.cockpit.messages import Setup
from drake_shared.common.errors import InputError
from drake_shared.common.files import created_once, numbered
from drake_shared.demonstrations import Demonstrations
from drake_shared.learners import Learner, load_learner, save_learner, train
from drake_shared.learners.storage import shipped_learners
from drake_shared.scenario import Scenario, clearance_scorer, load_scenario, shipped_scenarios
from drake_shared.simulation.config import SharedControlConfig, blend_for, config_for
from drake_shared.simulation.teaching import demonstration_of
from drake_shared.simulation.trial import Trial
from drake_shared.systems.arbiters import arbiter_names

FREE, ASK = "free", "ask"
"""Values of ``--route``: nobody instructs a route, or the driver names one before each trial."""

DRIVES_TO_TRAIN = 3
"""Number of drives to the goal without contact from which a learner can be trained on the page."""

# A learner that is trained in seconds, while the person waits.
_TRAINED_ON_PAGE = "cesn"


class TrialChoices:
    """The choices, and what follows from them.

    Args:
        scenario: The task at first. The shipped ones can be chosen too.
        learner: The learner at first.
        config: How control is shared; the page changes its arbiter, K and feedback.
        route: Name of the instructed route, ``FREE`` or ``ASK``.

    Raises:
        InputError: The scenario has no route of that name.
    """

    def __init__(
        self,
        scenario: Scenario,
        learner: Learner | None,
        config: SharedControlConfig | None = None,
        *,
        route: str = FREE,
    ) -> None:
        self.scenario = scenario
        self.learner = learner
        self.config = config
        self.error: str | None = None
        """Why the last choice was refused."""
        self._own = scenario
        self._policy = route
        self._scenarios = shipped_scenarios()
        self._learners: dict[str, Learner | Path] = {**shipped_learners()}
        self._learner_name = None if learner is None else self._add_learner(learner)
        self.route: str | None = None
        if route not in (FREE, ASK):
            scenario.route(route)
            self.route = route

    @property
    def needs_route(self) -> bool:
        """Whether the driver must name a route before the next trial."""
        return self._policy == ASK and self.route is None and bool(self.scenario.routes)

    def next_trial(self) -> None:
        """Forgets the route of the last trial, if the driver names one before each."""
        if self._policy == ASK:
            self.route = None

    def choose(self, setup: Setup) -> bool:
        """Makes a choice. Returns whether anything but the route has changed.

        A choice that cannot be made leaves everything as it was, and :attr:`error` says why.
        """
        self.error = None
        before = self._chosen()
        try:
            scenario = self._find_scenario(setup.scenario)
            name = setup.learner
            if scenario.name != self.scenario.name:
                # The learner of another scenario is of no use; one that ships for the new one is.
                name = next(iter(self._names_for(scenario)), None)
            learner = self._find_learner(name)
            config = self._changed_config(scenario, learner, setup)
            route = setup.route if setup.route in {item.name for item in scenario.routes} else None
        except InputError as error:
            self.error = str(error)
            return False
        self.scenario, self.learner, self.config, self.route = scenario, learner, config, route
        self._learner_name = name
        return before != self._chosen()

    def train(self, trials: Sequence[Trial], folder: Path | None) -> Learner:
        """Trains a learner on drives, chooses it, and saves it to ``folder``.

        Raises:
            DrakeSharedError: Nothing can be learnt from the drives, or the file cannot be written.
        """
        score = clearance_scorer(self.scenario)
        items = tuple(demonstration_of(trial, score=score(trial.positions)) for trial in trials)
        metadata = {"scenario": self.scenario.name, "operator": "MouseInput"}
        learner = train(Demonstrations(items=items, metadata=metadata), learner=_TRAINED_ON_PAGE)
        if folder is not None:
            learner = load_learner(_save_new(learner, folder, f"{self.scenario.name}_{len(items)}_drives"))
        self.learner = learner
        self._learner_name = self._add_learner(learner)
        self.config = dataclasses.replace(_default_config(self.scenario, learner), feedback=self._feedback)
        return learner

    def describe(self, *, usable_drives: int) -> dict[str, Any]:
        """Returns the ``setup`` message.

        Args:
            usable_drives: Number of drives in this scenario that a learner could be trained on.
        """
        return {
            "scenarios": sorted({self._own.name, *self._scenarios}),
            "learners": self._names_for(self.scenario),
            "arbitrations": [name for name in arbiter_names() if name not in ("human", "agent")],
            "scenario": self.scenario.name,
            "learner": self._learner_name,
            "arbitration": self._arbitration,
            "confidence_gain": self._gain,
            **dataclasses.asdict(self._feedback),
            "own_gain": None if self.learner is None else round(self.learner.confidence_gain, 4),
            "routes": [route.name for route in self.scenario.routes],
            "route": self.route,
            "needs_route": self.needs_route,
            "drives": usable_drives,
            "drives_to_train": DRIVES_TO_TRAIN,
            "error": self.error,
        }

    @property
    def _arbitration(self) -> str:
        return (self.config or _default_config(self.scenario, self.learner)).arbitration

    @property
    def _gain(self) -> float | None:
        return None if self.config is None else self.config.confidence_gain

    @property
    def _feedback(self) -> Feedback:
        return Feedback() if self.config is None else self.config.feedback

    def _chosen(self) -> tuple[Any, ...]:
        return self.scenario.name, self._learner_name, self._arbitration, self._gain, self._feedback

    def _changed_config(
        self, scenario: Scenario, learner: Learner | None, setup: Setup
    ) -> SharedControlConfig:
        base, arbitration = self.config, setup.arbitration
        if base is None or type(scenario.robot) is not type(self.scenario.robot):
            base = _default_config(scenario, learner)
            if arbitration == self._arbitration:
                # Not chosen for this robot.
                arbitration = base.arbitration
        feedback = Feedback(rumble=setup.rumble, tone=setup.tone, resistance=setup.resistance)
        changes: dict[str, Any] = {"confidence_gain": setup.confidence_gain, "feedback": feedback}
        if arbitration != base.arbitration:
            blend = blend_for(None if learner is None else learner.preset)
            changes |= {
                "arbitration": arbitration,
                "arbitration_options": {},
                "authority": blend.authority if arbitration == blend.arbitration else Authority(),
            }
        return dataclasses.replace(base, **changes)

    def _find_scenario(self, name: str) -> Scenario:
        if name == self.scenario.name:
            return self.scenario
        return self._own if name == self._own.name else load_scenario(self._scenarios.get(name, name))

    def _find_learner(self, name: str | None) -> Learner | None:
        if name is None:
            return None
        if name not in self._learners:
            raise InputError("setup", "learner", f"must be one of: {', '.join(self._learners)}", repr(name))
        found = self._learners[name]
        if isinstance(found, Path):
            found = self._learners[name] = load_learner(found)
        return found

    def _names_for(self, scenario: Scenario) -> list[str]:
        """Names of the learners for a scenario: those that ship for it, and those that name it."""
        return [name for name, learner in self._learners.items() if _serves(name, learner, scenario.name)]

    def _add_learner(self, learner: Learner) -> str:
        name = Path(learner.metadata.get("file") or learner.name).stem
        self._learners[name] = learner
        return name


def _default_config(scenario: Scenario, learner: Learner | None) -> SharedControlConfig:
    return config_for(None if learner is None else learner.preset, scenario.robot)


def _save_new(learner: Learner, folder: Path, name: str) -> Path:
    """Saves a learner under a name that no file in ``folder`` has: another session may share it."""
    for own in numbered(name):
        path = folder / f"{own}.safetensors"
        try:
            with created_once(path) as temporary:
                save_learner(learner, temporary)
            break
        except InputError:
            if not path.exists():
                raise
    return path


def _serves(name: str, learner: Learner | Path, scenario: str) -> bool:
    if isinstance(learner, Path):
        return name.rpartition("_")[0] == scenario
    return bool(learner.metadata.get("scenario", scenario) == scenario)
