"""Which learners there are: those of this package, and those that other packages register.

A learner of another package is registered under its name in the entry point group ``drake_shared.learners``.
The entry point is a class whose instances are `drake_shared.learners.Learner` and which has

- ``to_file()``, which returns its tensors and a JSON-serializable description,
- ``from_file(path, tensors, description)``, a class method that makes it from them.

A dataclass that derives from `drake_shared.learners.stored.StoredLearner` has both. `load_learner` adds "id"
and "file" to the ``metadata`` of an instance, which must be an attribute that can be set. Instances are
checked by `drake_shared.learners.check_learner` whenever they are trained or loaded.

Its trainer is the function that the entry point of the same name in the group ``drake_shared.trainers``
gives, or, without one, a class method ``train``. It takes demonstrations and any of the keyword arguments
preset, weighted, seed, seconds, iterations, progress and begun, and returns an instance.

Training is apart from prediction, so that a learner loads and predicts without what trains it.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable
from typing import Any, cast

from drake_shared.common.entry_points import load_registered, registered_names
from drake_shared.common.errors import InputError
from drake_shared.common.suggestions import suggestion
from drake_shared.learners.base import Learner

GROUP, TRAINERS = "drake_shared.learners", "drake_shared.trainers"
_ROOM = "drake_shared.learners."
# Of each learner of this package, where its class is and where its trainer.
_BUILT_IN = {
    "cesn": ("cesn.learner:CesnLearner", "cesn.training:train_cesn"),
    "cnmp": ("cnmp.learner:CnmpLearner", "cnmp.training:train"),
    "ensemble": ("ensemble.learner:EnsembleLearner", "ensemble.training:train_ensemble"),
    "mixture": ("mixture.learner:MixtureLearner", "mixture.training:train_mixture"),
    "promp": ("promp:PrompLearner", "promp:train_promp"),
}

Trainer = Callable[..., Learner]


def learner_names() -> list[str]:
    """Names of all learners that are registered."""
    return sorted({*_BUILT_IN, *registered_names(GROUP)})


def find_learner(name: str, *, source: str | os.PathLike[str] = "learner") -> Any:
    """Returns the class of the learner that is registered as ``name``.

    Args:
        name: As in files and on the command line.
        source: Where the name comes from, for the error message.

    Raises:
        InputError: The name is unknown, or what was registered cannot be imported.
    """
    if name in _BUILT_IN:
        return _built_in(_BUILT_IN[name][0])
    found = load_registered(GROUP, name, source=source, field="learner")
    if found is None:
        expected = f"must be one of {', '.join(learner_names())}{suggestion(name, learner_names())}"
        raise InputError(source, "learner", expected, repr(name))
    return found


def find_trainer(name: str, *, source: str | os.PathLike[str] = "train") -> Trainer:
    """Returns the function that trains the learner that is registered as ``name``; see `find_learner`.

    Raises:
        InputError: The name is unknown, what was registered cannot be imported, or it has no trainer.
    """
    if name in _BUILT_IN:
        return cast(Trainer, _built_in(_BUILT_IN[name][1]))
    found = load_registered(TRAINERS, name, source=source, field="learner")
    trainer = getattr(find_learner(name, source=source), "train", None) if found is None else found
    if not callable(trainer):
        raise InputError(source, "learner", f"must have a trainer: {name!r} has no class method 'train'")
    return cast(Trainer, trainer)


def _built_in(place: str) -> Any:
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(_ROOM + module), name)
