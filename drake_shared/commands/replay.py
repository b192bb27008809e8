"""``drake-shared replay``: a trial as a stand-alone Meshcat page."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated

import tyro

from drake_shared.commands.common import say
from drake_shared.errors import InputError


@dataclasses.dataclass(kw_only=True)
class Replay:
    """Writes a trial as a web page that needs nothing else: robot, way driven, changing prediction."""

    log: Annotated[Path, tyro.conf.Positional]
    """Log of the trial."""
    out: Path
    """HTML file to write."""
    model: Path | None = None
    """Learner whose prediction is shown; default: the one that took part, if its file is still there."""

    def run(self) -> None:
        """Does it."""
        from drake_shared.files import check_target
        from drake_shared.replay import write_replay
        from drake_shared.trial import read_log

        trial = read_log(self.log)
        check_target(self.out)
        learner = self._learner(trial.metadata)
        write_replay(trial, self.out, learner=learner)
        say(f"wrote {self.out}" + ("" if learner else " (without a prediction: its learner was not found)"))

    def _learner(self, metadata):
        from drake_shared.files import models_directory
        from drake_shared.learners import load_learner

        if self.model is not None:
            return load_learner(self.model)
        if metadata.get("learner_id") is None:
            return None
        for file in sorted((models_directory() / "learners").glob("*.safetensors")):
            learner = load_learner(file)
            if learner.metadata.get("id") == metadata["learner_id"]:
                return learner
        named = metadata.get("learner_file")
        if named is not None and Path(named).is_file():
            learner = load_learner(named)
            if learner.metadata.get("id") == metadata["learner_id"]:
                return learner
            raise InputError(named, "", "is no longer the learner of this log; give another with --model")
        return None
