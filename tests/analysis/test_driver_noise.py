"""The noise of a person, from earlier trials to the next one."""

import dataclasses

import numpy as np
import pytest

from drake_shared.analysis.driver_noise import person_of
from drake_shared.arbitration.fusion import Fusion
from drake_shared.arbitration.fusion_model import FusionModel
from drake_shared.arbitration.person import read_person, write_person
from drake_shared.arbitration.routes import routes_of
from drake_shared.arbitration.rule import ArbiterInputs
from drake_shared.cli.main import main
from drake_shared.common.errors import InputError
from drake_shared.operators.behaviour import Behaviour
from drake_shared.scenario import load_scenario
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.log import read_log, write_log
from drake_shared.simulation.trial import Simulation, TrialSettings

SCENARIO = load_scenario("two_obstacles")


def drives(noise: float):
    simulation = Simulation(SCENARIO, config=SharedControlConfig(driver="human"))
    behaviour = Behaviour(noise=noise)
    return [
        simulation.run(TrialSettings(seed=seed, route="left_left", behaviour=behaviour)) for seed in range(2)
    ]


@pytest.fixture(scope="module")
def steady():
    return drives(0.1)


@pytest.fixture(scope="module")
def noisy():
    return drives(1.2)


def mean_noise(person) -> float:
    pairs = np.repeat(person.noises, len(person.noise_times))
    return float(pairs @ np.array(person.probability))


def test_noisy_and_steady_drives_are_told_apart(steady, noisy):
    people = [person_of(trials, ["one", "two"])[0] for trials in (steady, noisy)]
    assert mean_noise(people[0]) < 0.45 < 0.7 < mean_noise(people[1])
    for person in people:
        assert sum(person.probability) == pytest.approx(1.0, abs=1e-2)
        assert min(person.probability) > 0.0


def test_trials_of_another_robot_are_refused(steady):
    other = dataclasses.replace(steady[1], metadata=dict(steady[1].metadata))
    limits = {"command_limits": [1.0, 1.0]}
    other.metadata["robot"] = {**other.metadata["robot"], **limits}
    with pytest.raises(InputError) as caught:
        person_of([steady[0], other], ["one", "two"])
    assert caught.value.field == "robot"


def test_another_driver_in_mid_drive_is_noticed_and_so_is_the_return(steady, noisy):
    person, _ = person_of(steady, ["one", "two"])
    fusion = Fusion(
        FusionModel(noise_prior=person.probability),
        routes_of(SCENARIO, []),
        scenario=SCENARIO,
        robot=SCENARIO.robot,
        period=SCENARIO.control_period,
    )
    state, nothing, found = fusion.initial_state(1), np.full(1, np.nan), []
    for trial, steps in ((steady[0], range(80)), (noisy[0], range(60, 160)), (steady[0], range(80, 190))):
        poses, human = np.stack([trial["x"], trial["y"], trial["yaw"]]), trial.commands("human").T
        for step in steps:
            now = slice(step, step + 1)
            inputs = ArbiterInputs(
                human=human[:, now],
                autonomous=human[:, now],
                confidence=nothing,
                pose=poses[:, now],
                clearance=nothing,
            )
            _, _, state = fusion.step(state, inputs)
            np.testing.assert_allclose(state["probability"].sum(), 1.0)
        found.append(state["another_driver"].item())
    assert found == [0.0, 1.0, 0.0]


def test_a_drive_of_another_driver_is_left_out_of_the_file_of_a_person(steady, noisy):
    own, none = person_of(steady, ["one", "two"])
    person, others = person_of([*steady, noisy[0]], ["one", "two", "three"])
    assert not none
    assert set(others) == {"three"}
    assert others["three"] < 3.0  # It is another one's from its start on.
    assert person == own
    with pytest.raises(InputError) as caught:
        person_of([steady[0], noisy[0], *drives(1.8)[:1]], ["one", "two", "three"])
    assert caught.value.source in {"one", "two", "three"}


def test_a_person_of_earlier_logs_starts_the_next_trials(steady, noisy, tmp_path, capfd):
    logs = [tmp_path / f"{index}.parquet" for index in range(3)]
    for log, trial in zip(logs, [*steady, noisy[0]], strict=True):
        write_log(trial, log)
    file = tmp_path / "anna.json"
    assert main(["fit-operator", *map(str, logs), "--person", str(file)]) == 0
    person = read_person(file, SCENARIO.robot)
    assert person == person_of(steady, ["one", "two"])[0]
    assert f"{logs[2]} is left out" in capfd.readouterr().err
    out = tmp_path / "out"
    command = ["simulate", "--person", str(file), "--out", str(out)]
    assert main(command) == 0
    (log,) = out.glob("*.parquet")
    kept = read_log(log).metadata["arbitration"]["configuration"]["noise_prior"]
    np.testing.assert_allclose(kept, person.probability, rtol=1e-3)
    capfd.readouterr()
    assert main(["simulate", "--arbitration", "blend", "--person", str(file)]) == 2
    write_person(dataclasses.replace(person, robot={"type": "Another"}), file)
    assert main(["simulate", "--person", str(file)]) == 2
    assert capfd.readouterr().err.count("\n") == 2
