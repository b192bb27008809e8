"""Learners of other packages, registered by an entry point."""

import sys
import textwrap

import numpy as np
import pytest

from drake_shared.cli.main import main
from drake_shared.common.errors import InputError, RunError
from drake_shared.common.files import sha256_of
from drake_shared.demonstrations import Demonstration, Demonstrations, write_demonstrations
from drake_shared.learners import find_learner, learner_names, load_learner, save_learner, train
from drake_shared.scenario import load_scenario
from drake_shared.simulation.trial import Simulation, TrialSettings

# A learner that predicts the mean of its demonstrations, with their variance, whatever it is shown.
OUTSIDE = """
import numpy as np

class MeanLearner:
    name, preset, confidence_gain, metadata = "mean", "none", 30.0, {"clock": "time"}

    def __init__(self, paths, grid):
        self.demonstrations, self.grid, self.duration = paths, grid, float(grid[-1])

    @classmethod
    def train(cls, demonstrations, **options):
        return cls(np.stack([item.positions for item in demonstrations]), demonstrations[0].times)

    def predict(self, times, positions, query_times):
        pick = np.searchsorted(self.grid, query_times)
        return self.demonstrations.mean(0)[pick], self.demonstrations.var(0)[pick] + 1e-4

    def to_file(self):
        return {"paths": self.demonstrations, "grid": self.grid}, {"id": "forged", "format": "forged"}

    @classmethod
    def from_file(cls, path, tensors, description):
        return cls(tensors["paths"], tensors["grid"])
"""


@pytest.fixture
def outside(tmp_path, monkeypatch):
    (tmp_path / "mean_learner.py").write_text(textwrap.dedent(OUTSIDE))
    info = tmp_path / "mean_learner-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mean-learner\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[drake_shared.learners]\nmean = mean_learner:MeanLearner\nbroken = no_such_module:Nothing\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    yield tmp_path
    sys.modules.pop("mean_learner", None)


def test_the_learners_of_the_package_are_registered():
    assert {"cesn", "cnmp", "mixture", "promp"} <= set(learner_names())


def test_an_unknown_name_is_refused_and_the_known_ones_are_listed():
    with pytest.raises(InputError, match="cesn, cnmp, ensemble, mixture, promp"):
        find_learner("nonsense")


def test_a_learner_from_outside_trains_saves_loads_and_drives(outside):
    scenario = load_scenario()
    grid = np.linspace(0.0, 15.0, 151)
    paths = [route.path(scenario.start) for route in scenario.routes]
    items = tuple(
        Demonstration(times=grid, positions=path.position(np.linspace(0, path.length, 151))) for path in paths
    )
    demonstrations = Demonstrations(items=items, metadata={"scenario": scenario.name})
    write_demonstrations(outside / "demos.parquet", demonstrations)
    files = ["--demos", str(outside / "demos.parquet"), "--out", str(outside / "mean.learner")]
    assert main(["train", "--learner", "mean", *files]) == 0
    learner = load_learner(outside / "mean.learner")
    assert type(learner).__name__ == "MeanLearner"
    trial = Simulation(scenario, learner=learner).run(TrialSettings(route="left_left"))
    assert trial.metadata["learner"] == "mean"
    assert trial.metadata["learner_id"] == learner.metadata["id"] == sha256_of(outside / "mean.learner")[:16]
    assert trial.metadata["learner_file"] == str(outside / "mean.learner")
    assert 0 < trial["human_weight"][:-1].mean() < 1


def test_an_entry_point_that_fails_to_import_is_named(outside):
    with pytest.raises(InputError, match=r"broken.*no_such_module"):
        find_learner("broken")


REQUIRING = """
def train(demonstrations, *, preset, iterations):
    from mean_learner import MeanLearner
    assert (preset, iterations) == ("default", None)
    return MeanLearner.train(demonstrations)
"""


def test_a_trainer_beside_the_class_gets_what_it_requires_and_nothing_else(outside):
    (outside / "mean_training.py").write_text(REQUIRING)
    with open(outside / "mean_learner-1.0.dist-info" / "entry_points.txt", "a") as file:
        file.write("[drake_shared.trainers]\nmean = mean_training:train\n")
    times = np.linspace(0.0, 2.0, 21)
    item = Demonstration(times=times, positions=np.stack([times, times], axis=-1))
    learner = train(Demonstrations(items=(item,)), learner="mean", seed=3)
    assert type(learner).__name__ == "MeanLearner"
    with pytest.raises(InputError, match="wings"):
        train(Demonstrations(items=(item,)), learner="mean", wings=2)
    sys.modules.pop("mean_training")


@pytest.mark.parametrize(
    ("method", "error"), [("train", RunError), ("to_file", InputError), ("from_file", InputError)]
)
def test_an_exception_in_a_learner_from_outside_names_it(outside, monkeypatch, method, error):
    grid, path = np.linspace(0.0, 1.0, 11), outside / "mean.safetensors"
    item = Demonstration(times=grid, positions=np.stack([grid, grid], axis=-1))
    demonstrations = Demonstrations(items=(item, item))
    save_learner(train(demonstrations, learner="mean"), path)
    monkeypatch.setattr(find_learner("mean"), method, lambda *_, **__: 1 / 0)
    other = outside / "other.safetensors"

    def use():
        if method == "from_file":
            return load_learner(path)
        return save_learner(train(demonstrations, learner="mean"), other)

    with pytest.raises(error, match=r"mean.*ZeroDivisionError"):
        use()
    assert not other.exists()
