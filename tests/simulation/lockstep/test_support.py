"""The lock-step engine names what it cannot run; Drake runs that."""

import pytest

from drake_shared.analysis.batch import Batch, run_batch
from drake_shared.cli.main import main
from drake_shared.common.errors import InputError
from drake_shared.scenario import load_scenario
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.lockstep.engine import Lockstep
from drake_shared.simulation.lockstep.noise import is_drakes
from drake_shared.simulation.lockstep.support import unsupported
from drake_shared.simulation.trial import Simulation, TrialSettings

pytestmark = pytest.mark.skipif(not is_drakes(), reason="another C++ standard library draws other numbers")


def test_the_dynamic_plant_and_moving_obstacles_run_in_drake(scenario):
    scenario.plant = "dynamic"
    assert "DynamicPlant" in unsupported(Simulation(scenario))
    scenario.plant = "kinematic"
    scenario.obstacles[0].path = [[0.0, 1.4, 0.0], [1.0, 1.5, 0.0]]
    assert "moving" in unsupported(Simulation(scenario))


def test_a_learner_of_another_kind_runs_in_drake(scenario, fake_learner):
    learner = fake_learner([[0.1 * index, 0.0] for index in range(40)])
    assert "fake" in unsupported(Simulation(scenario, learner=learner))
    with pytest.raises(InputError, match="fake"):
        list(Lockstep(Simulation(scenario)).run([TrialSettings()], learners=[learner]))


def test_faults_run_in_drake_and_cannot_be_run_in_lockstep(capfd):
    assert main(["simulate", "--faults.pose-noise", "0.01", "--engine", "lockstep"]) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1
    assert "pose_noise" in error


def test_an_unknown_engine_is_bad_input():
    with pytest.raises(InputError) as caught:
        Batch(engine="gpu")
    assert caught.value.field == "engine"


@pytest.mark.parametrize(("engine", "word"), [("auto", "lock-step"), ("drake", "Drake")])
def test_the_engine_of_a_batch_is_told(engine, word):
    said: list[str] = []
    config = SharedControlConfig(driver="human")
    (row,) = run_batch(Batch(config=config, engine=engine), inform=said.append)
    assert row["success"]
    assert len(said) == 1
    assert word in said[0]


def test_both_engines_have_the_same_rows():
    config = SharedControlConfig(driver="human")
    rows = [list(run_batch(Batch(config=config, count=4, engine=name))) for name in ("drake", "lockstep")]
    for ours, drakes in zip(*rows, strict=True):
        numbers = {name for name, value in drakes.items() if isinstance(value, float)}
        assert {name: ours[name] for name in numbers} == pytest.approx(
            {name: drakes[name] for name in numbers}, rel=1e-9, nan_ok=True
        )
        assert ours.keys() == drakes.keys()
        assert all(ours[name] == drakes[name] for name in drakes.keys() - numbers)


def test_a_route_that_does_not_exist_is_bad_input():
    with pytest.raises(InputError):
        list(Lockstep(Simulation(load_scenario())).run([TrialSettings(route="nowhere")]))
