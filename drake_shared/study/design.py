"""The design of a study, as its file states it."""

from __future__ import annotations

import dataclasses
import functools
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from drake_shared.analysis.glossary import OF_TRIALS
from drake_shared.common.errors import InputError
from drake_shared.common.suggestions import did_you_mean
from drake_shared.common.typed_fields import read_fields
from drake_shared.common.yaml_document import parse_yaml, read_yaml, value_of
from drake_shared.learners.storage import find_file
from drake_shared.scenario import Scenario, load_scenario, shipped_scenarios
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.study.orders import Order, assign_groups, assign_orders
from drake_shared.study.questionnaires import Questionnaire, load_questionnaire

RUN_FIELDS = ("late_share", "latency_p99", "ping")
"""What trials carry beside their metrics and an exclusion rule can name: share of late control steps, 99th
percentile of the latency from event to command in [s], and round-trip time in [s]."""
SHOWN = ("prediction", "weight")
"""What a condition can hide on the page."""
_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Condition:
    """A condition.

    Attributes:
        config: How control is shared.
        learner: File (relative to the study's) or name of the learner; the study's if None.
        page: What the page shows, of `SHOWN`; true for what is not named.
    """

    config: SharedControlConfig = dataclasses.field(default_factory=SharedControlConfig)
    learner: str | None = None
    page: Mapping[str, bool] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in self.page:
            if name not in SHOWN:
                raise InputError("condition", f"page.{name}", f"is unknown{did_you_mean(name, SHOWN)}")


@dataclasses.dataclass(frozen=True, kw_only=True)
class DeclaredMeasure:
    """A measure on which conditions are compared.

    Attributes:
        name: Of a metric of trials, or QUESTIONNAIRE.SCORE.
        smallest_effect: The smallest difference between conditions that matters, in the measure's unit.
        hypothesis: That conditions differ, or that they differ by less than the smallest effect.
    """

    name: str
    smallest_effect: float
    hypothesis: Literal["difference", "equivalence"] = "difference"

    def __post_init__(self) -> None:
        if self.smallest_effect <= 0.0:
            raise InputError("measure", "smallest_effect", "must be positive", self.smallest_effect)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Measures:
    """The measures, declared before the data: decisions are made about the primary ones."""

    primary: tuple[DeclaredMeasure, ...]
    secondary: tuple[DeclaredMeasure, ...] = ()


@dataclasses.dataclass(frozen=True, kw_only=True)
class ExclusionRule:
    """Excludes trials, or participants by the mean over their trials, beyond a bound.

    Attributes:
        measure: A metric of trials, or one of `RUN_FIELDS`.
        above, below: Bounds; exactly one is given.
        of: What is excluded.
    """

    measure: str
    above: float | None = None
    below: float | None = None
    of: Literal["trial", "participant"] = "trial"

    def __post_init__(self) -> None:
        if (self.above is None) == (self.below is None):
            raise InputError("rule", "above", "or below must be given, and not both")
        known = (*OF_TRIALS, *RUN_FIELDS)
        if self.measure not in known:
            raise InputError("rule", "measure", f"is unknown{did_you_mean(self.measure, known)}")

    def holds(self, value: float | None) -> bool:
        """Whether a value is beyond the bound; an undefined one is not."""
        if value is None:
            return False
        return value > self.above if self.above is not None else value < (self.below or 0.0)

    def __str__(self) -> str:
        bound = f"above {self.above:g}" if self.above is not None else f"below {self.below:g}"
        return f"{self.measure} {bound}"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Questionnaires:
    """Names or files of questionnaires, asked once, after each block, or after each trial."""

    participant: tuple[str, ...] = ()
    block: tuple[str, ...] = ()
    trial: tuple[str, ...] = ()

    def names(self) -> tuple[str, ...]:
        """All of them."""
        return (*self.participant, *self.block, *self.trial)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Texts:
    """Texts of the page, in Markdown."""

    consent: str
    introduction: str = ""
    thanks: str = "Thank you for taking part."


@dataclasses.dataclass(frozen=True, kw_only=True)
class Study:
    """A study.

    Attributes:
        name: Lower-case letters, digits and underscores.
        title: Of the report.
        scenario: File (relative to the study's) or name.
        learner: File (relative to the study's) or name of the learner of conditions that name none.
        conditions: By name.
        design: Each participant meets all conditions, or one.
        order: How the order of conditions is chosen within participants.
        participants: Their number.
        blocks: How often each condition is met; the order is repeated.
        trials: Of a block; a multiple of the number of routes.
        practice: Trials before the first block, in the participant's first condition.
        routes: Names of the routes that participants are instructed to drive; all of the scenario if empty.
        texts, questionnaires, measures, exclusions: See their classes.
        most_ping: Largest round-trip time of a participant's machine, in [s].
        seed: Of orders, routes and simulated participants.
        folder: Of the study's file; not a field of it.
    """

    name: str
    title: str = ""
    scenario: str = "two_obstacles"
    learner: str | None = None
    conditions: Mapping[str, Condition]
    design: Literal["within", "between"] = "within"
    order: Literal["williams", "permutations", "random"] = "williams"
    participants: int
    blocks: int = 1
    trials: int
    practice: int = 2
    routes: tuple[str, ...] = ()
    texts: Texts
    questionnaires: Questionnaires = dataclasses.field(default_factory=Questionnaires)
    measures: Measures
    exclusions: tuple[ExclusionRule, ...] = ()
    most_ping: float = 0.1
    seed: int = 1
    folder: Path = dataclasses.field(default=Path(), compare=False)

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise InputError("study", "name", "must be of lower-case letters, digits and _", repr(self.name))
        if len(self.conditions) < 2:
            raise InputError("study", "conditions", "must be at least two", len(self.conditions))
        for name in self.conditions:
            if not _NAME.fullmatch(name):
                raise InputError("study", f"conditions.{name}", "must be of lower-case letters, digits and _")
        for name, least in (("participants", 2), ("blocks", 1), ("trials", 1), ("practice", 0), ("seed", 0)):
            if getattr(self, name) < least:
                raise InputError("study", name, f"must be at least {least}", getattr(self, name))
        if self.most_ping <= 0.0:
            raise InputError("study", "most_ping", "must be positive", self.most_ping)

    def orders(self) -> list[Order]:
        """The conditions of each participant, in their order; see `drake_shared.study.orders`."""
        return self._orders

    @functools.cached_property
    def _orders(self) -> list[Order]:
        count = len(self.conditions)
        if self.design == "between":
            return assign_groups(count, self.participants, self.seed)
        return assign_orders(self.order, count, self.participants, self.seed)

    def load_scenario(self) -> Scenario:
        """The scenario of the trials, read once."""
        return self._scenario

    @functools.cached_property
    def _scenario(self) -> Scenario:
        named = self.scenario in shipped_scenarios()
        return load_scenario(self.scenario if named else self.folder / self.scenario)

    def learner_of(self, condition: str) -> str | None:
        """File or name of the learner of a condition; None if the human drives alone."""
        chosen = self.conditions[condition]
        if chosen.config.driver == "human":
            return None
        learner = chosen.learner or self.learner
        if learner is None:
            raise InputError("study", f"conditions.{condition}.learner", "must be given: an agent takes part")
        beside = self.folder / learner
        return os.fspath(beside if beside.is_file() else find_file(learner))

    def route_names(self) -> tuple[str, ...]:
        """The routes that are instructed."""
        return self.routes or tuple(route.name for route in self.load_scenario().routes)

    def load_questionnaires(self) -> dict[str, Questionnaire]:
        """All questionnaires, by their name in the study."""
        return {name: load_questionnaire(name, self.folder) for name in self.questionnaires.names()}

    def to_json(self) -> dict[str, Any]:
        """All fields but the folder, as JSON holds them."""
        found = dataclasses.asdict(self)
        del found["folder"]
        return found


def load_study(path: str | os.PathLike[str]) -> Study:
    """Reads a study from its YAML file and checks it.

    Raises:
        InputError: The file cannot be read; a field is unknown, of another type or out of range; a scenario,
            route, learner, questionnaire or measure does not exist; or the orders cannot be balanced.
    """
    root = parse_yaml(read_yaml(path, "a study"), source=path, what="a study")
    return study_from_json({} if root is None else value_of(root), source=path)


def study_from_json(data: Any, *, source: str | os.PathLike[str]) -> Study:
    """The study that plain values describe, checked as in `load_study`."""
    if isinstance(data, Mapping) and "folder" in data:
        raise InputError(source, "folder", "is unknown")
    study = dataclasses.replace(read_fields(Study, data, source=source), folder=Path(source).parent)
    try:
        _check(study)
    except InputError as error:
        if error.source != "study":
            raise
        raise error.within(source) from error
    return study


def _check(study: Study) -> None:
    """Checks what the study names, and whether its parts fit."""
    known = {route.name for route in study.load_scenario().routes}
    for index, route in enumerate(study.routes):
        if route not in known:
            raise InputError("study", f"routes[{index}]", f"is unknown{did_you_mean(route, known)}")
    routes = len(study.route_names())
    if study.trials % routes:
        expected = f"must be a multiple of the number of routes, {routes}, so that each is driven as often"
        raise InputError("study", "trials", expected, study.trials)
    study.orders()
    for condition in study.conditions:
        try:
            study.learner_of(condition)
        except InputError as error:
            if error.source == "study":
                raise
            field = f"conditions.{condition}.learner"
            raise InputError("study", field, f"cannot be found ({error})") from error
    asked = study.load_questionnaires()
    scores = {f"{name}.{score}" for name, found in asked.items() for score in found.scores}
    _check_measures(study.measures, {*OF_TRIALS, *scores})


def _check_measures(measures: Measures, known: set[str]) -> None:
    if not measures.primary:
        raise InputError("study", "measures.primary", "must name at least one measure")
    seen: set[str] = set()
    for kind in ("primary", "secondary"):
        for index, measure in enumerate(getattr(measures, kind)):
            field = f"measures.{kind}[{index}].name"
            if measure.name not in known:
                expected = f"is unknown{did_you_mean(measure.name, sorted(known))}"
                raise InputError("study", field, expected)
            if measure.name in seen:
                raise InputError("study", field, "must be declared once", repr(measure.name))
            seen.add(measure.name)
