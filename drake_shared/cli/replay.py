"""``drake-shared replay``: a trial as a stand-alone Meshcat page."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import tyro

from drake_shared.cli.common import load_learner_for, print_json, say
from drake_shared.common.errors import InputError


@dataclasses.dataclass(kw_only=True)
class Replay:
    """Writes a trial as a web page that needs nothing else: robot, way driven, changing prediction."""

    log: Annotated[Path, tyro.conf.Positional]
    """Log of the trial."""
    out: Path
    """HTML file to write."""
    model: Path | None = None
    """Learner whose prediction is shown; default: the one that took part, if its file is still there."""
    arbitration: str | None = None
    """Play the human's commands anew under this arbiter, in open loop; see simulate --arbitration."""
    authority: str | None = None
    """What the blend leaves to the human, see simulate --authority; default: what it left then."""
    json: bool = False
    """With --arbitration: print what was measured as one JSON object."""

    def run(self) -> None:
        """Does it."""
        from drake_shared.analysis.replay import write_replay
        from drake_shared.common.files import check_target
        from drake_shared.simulation.trial import read_log

        trial = read_log(self.log)
        check_target(self.out)
        learner = self._learner(trial.metadata)
        if self.arbitration is not None:
            self._play(trial, learner)
            return
        write_replay(trial, self.out, learner=learner)
        say(f"wrote {self.out}" + ("" if learner else " (without a prediction: its learner was not found)"))

    def _play(self, recorded, learner) -> None:
        from drake_shared.analysis.counterfactual import LEFT, play_open_loop
        from drake_shared.analysis.replay import write_replay
        from drake_shared.arbitration.authority import parse_authority

        assert self.arbitration is not None
        if learner is None and self.arbitration != "human":
            raise InputError("--model", "", "must be given: the learner of this log was not found")
        authority = None if self.authority is None else parse_authority(self.authority)
        played = play_open_loop(recorded, arbiter=self.arbitration, learner=learner, authority=authority)
        when = (
            f"the pose never left the recorded one by {LEFT} m"
            if played.left_at is None
            else f"the pose left the recorded one by {LEFT} m at {played.left_at:.2f} s"
        )
        note = f"Open loop: recorded input under arbitration {self.arbitration!r}; {when}"
        write_replay(played.trial, self.out, learner=learner, recorded=recorded.positions, note=note)
        measures = played.measures()
        if self.json:
            told = {"open_loop": True, "arbitration": played.trial.metadata["arbitration"]}
            print_json(told | {"left_recorded_pose_at": played.left_at, "metrics": measures})
        else:
            print(note)
            _print_measures(measures)
        say(f"wrote {self.out}")

    def _learner(self, metadata):
        from drake_shared.common.files import models_directory
        from drake_shared.learners import load_learner

        if self.model is not None:
            return load_learner_for(metadata["scenario"]["name"], self.model)
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


def _print_measures(measures: dict[str, Any]) -> None:
    for name, value in measures.items():
        if value is not None:
            print(f"  {name:24s} {float(value):10.4g}")
