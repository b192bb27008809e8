"""Which learners there are: those of this package, and those that others register.

A learner from outside is a class with a ``name``, the methods of `drake_shared.learners.Learner`, and

- ``train(demonstrations, *, preset, weighted, seed, seconds, iterations, progress)``, a class method that
  returns one,
- ``to_file()``, which returns its tensors and a description that JSON can hold,
- ``from_file(path, tensors, description)``, a class method that gives it back.

It is registered under its name in the entry point group ``drake_shared.learners``.
"""

from __future__ import annotations

import importlib
import os
from typing import Any

from drake_shared.common.entry_points import load_registered, registered_names
from drake_shared.common.errors import InputError

GROUP = "drake_shared.learners"
_BUILT_IN = {
    "cesn": "drake_shared.learners.cesn.learner:CesnLearner",
    "cnmp": "drake_shared.learners.cnmp.learner:CnmpLearner",
    "ensemble": "drake_shared.learners.ensemble:EnsembleLearner",
    "mixture": "drake_shared.learners.mixture.learner:MixtureLearner",
    "promp": "drake_shared.learners.promp:PrompLearner",
}


def learner_names() -> list[str]:
    """Names of all learners that are registered."""
    return sorted({*_BUILT_IN, *registered_names(GROUP)})


def find_learner(name: str, *, source: str | os.PathLike[str] = "learner") -> Any:
    """The class of the learner of that name.

    Args:
        name: As files and the command line call it.
        source: What asked for it, for the error message.

    Raises:
        InputError: There is none of that name, or what was registered cannot be imported.
    """
    if name in _BUILT_IN:
        module, _, kind = _BUILT_IN[name].partition(":")
        return getattr(importlib.import_module(module), kind)
    found = load_registered(GROUP, name, source=source, field="learner")
    if found is None:
        raise InputError(source, "learner", f"must be one of {', '.join(learner_names())}", repr(name))
    return found
