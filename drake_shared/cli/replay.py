"""``drake-shared replay``: a trial as a stand-alone Meshcat page."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from drake_shared.arbitration.authority import Authority
from drake_shared.cli.command import Command, OptionalPath, OptionalText
from drake_shared.cli.common import learner_of_log, print_json
from drake_shared.cli.table import figure_lines
from drake_shared.common.console import say
from drake_shared.common.errors import InputError
from drake_shared.simulation.config import SharedControlConfig, blend_for, load_config

if TYPE_CHECKING:
    from drake_shared.learners import Learner
    from drake_shared.simulation.trial import Trial


@dataclasses.dataclass(kw_only=True)
class Replay(Command):
    """Writes a trial as a stand-alone web page: robot, path and changing prediction."""

    log: Annotated[Path, tyro.conf.Positional]
    """Log of the trial."""
    out: Path
    """HTML file to write."""
    model: OptionalPath = None
    """Learner whose prediction is shown; default: the one of the trial, if its file is found."""
    arbitration: OptionalText = None
    """Play the human's commands again under this arbiter, in open loop; see simulate --arbitration."""
    authority: Annotated[Authority, tyro.conf.FlagConversionOff] = dataclasses.field(
        default_factory=Authority
    )
    config: OptionalPath = None
    """YAML file that says how control is shared, to play the human's commands again so, in open loop."""
    json: bool = False
    """With --arbitration or --config: print the metrics as one JSON object, those of the part in which the
    pose is the recorded one."""
    authority_given: tyro.conf.Suppress[bool] = False

    @classmethod
    def defaults(cls, arguments: Sequence[str]) -> dict[str, Any]:
        """Whether an authority is given; else it is that of the recorded trial."""
        return {"authority_given": any(item.startswith("--authority.") for item in arguments)}

    def run(self) -> None:
        """Runs the command."""
        from drake_shared.analysis.replay import write_replay
        from drake_shared.common.files import check_target
        from drake_shared.simulation.trial import read_log

        trial = read_log(self.log)
        check_target(self.out)
        learner = learner_of_log(trial.metadata, self.model)
        if self.arbitration is not None or self.config is not None:
            self._play(trial, learner)
            return
        write_replay(trial, self.out, learner=learner)
        say(f"wrote {self.out}" + ("" if learner else " (without a prediction: its learner was not found)"))

    def _config(self, metadata: Mapping[str, Any], learner: Learner | None) -> SharedControlConfig:
        """How control is shared: as recorded, but for what is given."""
        from drake_shared.analysis.counterfactual import open_loop_config

        config = open_loop_config(metadata) if self.config is None else load_config(self.config)
        if self.arbitration is not None:
            changed = SharedControlConfig(arbitration=self.arbitration)
            authority = config.authority
            if config.arbitration != changed.arbitration:
                # The recorded trial does not say what the human keeps with the other arbiter.
                authority = blend_for(None if learner is None else learner.preset).authority
            config = dataclasses.replace(
                config,
                driver=changed.driver,
                arbitration=changed.arbitration,
                arbitration_options=changed.arbitration_options,
                authority=authority if changed.driver == "shared" else Authority(),
            )
        return dataclasses.replace(config, authority=self.authority) if self.authority_given else config

    def _play(self, recorded: Trial, learner: Learner | None) -> None:
        from drake_shared.analysis.counterfactual import MAX_DEVIATION, play_open_loop
        from drake_shared.analysis.replay import write_replay

        config = self._config(recorded.metadata, learner)
        if learner is None and config.driver != "human":
            raise InputError("--model", "", "must be given: the learner of this log was not found")
        played = play_open_loop(recorded, config=config, learner=learner)
        when = (
            f"the pose never left the recorded one by {MAX_DEVIATION} m"
            if played.left_at is None
            else f"the pose left the recorded one by {MAX_DEVIATION} m at {played.left_at:.2f} s"
        )
        name = self.arbitration or config.arbitration
        note = f"Open loop: recorded input under arbitration {name!r}; {when}"
        write_replay(played.trial, self.out, learner=learner, recorded=recorded.positions, note=note)
        measures = played.metrics()
        if self.json:
            result = {"open_loop": True, "arbitration": played.trial.metadata["arbitration"]}
            print_json(result | {"left_recorded_pose_at": played.left_at, "metrics": measures})
        else:
            print(note)
            if played.left_at is None:
                known = ((name, value) for name, value in measures.items() if value is not None)
                print("\n".join(figure_lines((name, f"{float(value):.4g}") for name, value in known)))
            else:
                print("From there on the recorded commands answer to another pose: no figures are given.")
        say(f"wrote {self.out}")
