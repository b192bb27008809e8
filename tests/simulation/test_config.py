"""The config: its checks, its two forms as JSON and YAML, and trials run again from their logs."""

import dataclasses
import json

import numpy as np
import pytest

from drake_shared.arbitration.authority import Authority
from drake_shared.common.errors import InputError
from drake_shared.common.files import models_directory
from drake_shared.learners import load_learner
from drake_shared.robots import Arm, DiffDrive
from drake_shared.simulation.config import (
    SharedControlConfig,
    blend_for,
    config_for,
    config_of_log,
    load_config,
)
from drake_shared.simulation.faults import Faults
from drake_shared.simulation.trial import Simulation, TrialSettings, read_log, settings_of_log, write_log

UNUSUAL = SharedControlConfig(
    arbitration="blend",
    authority=Authority(floor=0.2, conflict_time=None),
    look_ahead=0.7,
    safety_clearance=0.05,
    faults=Faults(delay=0.1, pose_noise=0.01),
    confidence_gain=30.0,
    end="duration",
)


@pytest.fixture(scope="module")
def learner():
    return load_learner(models_directory() / "learners" / "two_obstacles_default.safetensors")


@pytest.mark.parametrize("config", [SharedControlConfig(), UNUSUAL, config_for("paper")])
def test_json_gives_an_equal_config_back(config):
    again = SharedControlConfig.from_json(json.loads(json.dumps(config.to_json())))
    assert again == config
    assert hash(again) == hash(config)


def test_the_preset_paper_is_the_blend_alone_and_the_default_what_serves_drivers_best():
    paper = config_for("paper", end="duration")
    assert (paper.arbitration, paper.safety_clearance, paper.end) == ("blend", None, "duration")
    assert not paper.authority.enabled
    best = config_for("default")
    assert best == config_for("default", DiffDrive())
    assert (best.arbitration, best.safety_clearance) == ("fusion", 0.03)
    assert config_for("default", arbitration="blend", safety_clearance=None) == SharedControlConfig()


def test_the_default_suits_the_robot():
    assert config_for("default", DiffDrive(footprint_radius=0.0267)).safety_clearance == pytest.approx(0.003)
    arm = config_for("default", Arm())
    assert (arm.arbitration, arm.safety_clearance) == ("blend", pytest.approx(0.015))
    assert config_for("of my own") == SharedControlConfig()
    assert config_for(None) == blend_for(None)


@pytest.mark.parametrize(
    ("fields", "named"),
    [
        ({"driver": "robot"}, "driver"),
        ({"end": "never"}, "end"),
        ({"look_ahead": 0.0}, "look_ahead"),
        ({"look_ahead": None}, "look_ahead"),
        ({"look_ahead": "far"}, "look_ahead"),
        ({"confidence_gain": -1.0}, "confidence_gain"),
        ({"confidence_gain": float("nan")}, "confidence_gain"),
        ({"safety_clearance": 2.0}, "safety_clearance"),
        ({"safety_clearance": 1e-4}, "safety_clearance"),
        ({"arbitration": 3}, "arbitration"),
        ({"arbitration": "traded:threshold"}, "arbitration"),
        ({"arbitration_options": ["threshold"]}, "arbitration_options"),
        ({"arbitration_options": {"threshold": {}}}, "arbitration_options.threshold"),
        ({"arbitration_options": {"threshold": float("nan")}}, "arbitration_options.threshold"),
        ({"driver": "agent", "arbitration": "human"}, "driver"),
        ({"driver": "agent", "authority": Authority(floor=0.5)}, "authority"),
        ({"arbitration": "halves", "authority": Authority(floor=0.5)}, "authority"),
        ({"driver": "human", "faults": Faults(late_learner=0.1)}, "faults.late_learner"),
        ({"driver": "agent", "faults": Faults(loss=0.1)}, "faults.loss"),
    ],
)
def test_values_out_of_range_and_contradictions_are_refused(fields, named):
    with pytest.raises(InputError) as caught:
        SharedControlConfig(**fields)
    assert caught.value.field == named


def test_options_of_the_arbiter_may_follow_its_name():
    config = SharedControlConfig(arbitration="traded:threshold=0.6, kind=soft")
    assert config.arbitration == "traded"
    assert config.arbitration_options == {"threshold": 0.6, "kind": "soft"}


def test_yaml_gives_the_fields_that_differ(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("arbitration: traded\narbitration_options: {threshold: 0.6}\nfaults: {delay: 0.2}\n")
    assert load_config(file) == SharedControlConfig(
        arbitration="traded:threshold=0.6", faults=Faults(delay=0.2)
    )
    file.write_text("")
    assert load_config(file) == SharedControlConfig()


@pytest.mark.parametrize(
    ("text", "field", "said"),
    [
        ("drivers: human", "drivers", "'driver'"),
        ("authority: {flor: 0.3}", "authority.flor", "'floor'"),
        ("faults: {delays: 0.3}", "faults.delays", "'delay'"),
        ("authority: {floor: 3}", "authority.floor", "3"),
        ("authority: off", "authority", ""),
        ("faults: {freeze_time: 1}", "faults.freeze_time", "freeze"),
        ("{driver: human, faults: {learner_nan: 0.5}}", "faults.learner_nan", "human"),
        ("look_ahead: far", "look_ahead", "far"),
        ("- driver", "", ""),
        ("driver: [", "", "YAML"),
    ],
)
def test_a_fault_in_yaml_names_the_file_the_field_and_the_likely_name(tmp_path, text, field, said):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(InputError) as caught:
        load_config(file)
    assert caught.value.source == str(file)
    assert caught.value.field == field
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.yaml"):
        load_config(tmp_path / "none.yaml")


def assert_same_trial(one, other):
    assert list(one.columns) == list(other.columns)
    for name, values in one.columns.items():
        np.testing.assert_array_equal(other[name], values, err_msg=name)


@pytest.mark.parametrize("driver", [None, "human"])
def test_a_trial_is_run_again_from_its_log_with_the_same_bits(scenario, learner, tmp_path, driver):
    settings = TrialSettings(seed=3, route="left_right", driver=driver, confidence_gain=50.0)
    trial = Simulation(scenario, learner=learner, config=UNUSUAL).run(settings)
    write_log(trial, tmp_path / "trial.parquet")
    log = read_log(tmp_path / "trial.parquet")
    config = config_of_log(log.metadata)
    assert config == UNUSUAL
    assert_same_trial(trial, Simulation(scenario, learner=learner, config=config).run(settings_of_log(log)))


def test_a_log_of_version_0_1_0_holds_the_config_in_parts(scenario, learner):
    # Paths were not repaired then.
    used = dataclasses.replace(UNUSUAL, path_repair=False)
    trial = Simulation(scenario, learner=learner, config=used).run(TrialSettings(seed=1))
    old = {name: value for name, value in trial.metadata.items() if name != "config"}
    config = config_of_log(old)
    assert config == dataclasses.replace(used, confidence_gain=None)
    again = Simulation(scenario, learner=learner, config=config)
    assert_same_trial(trial, again.run(settings_of_log(dataclasses.replace(trial, metadata=old))))


@pytest.mark.parametrize(
    ("metadata", "expected"),
    [
        ({}, config_for("paper")),
        (
            {"arbitration": {"name": "traded", "configuration": {"threshold": 0.6, "margin": 0.1}}},
            SharedControlConfig(arbitration="traded:threshold=0.6,margin=0.1", path_repair=False),
        ),
        (
            {"arbitration": {"name": "human", "configuration": {"weight": 1.0}}, "mode": "human"},
            SharedControlConfig(driver="human", path_repair=False),
        ),
        ({"arbitration": {"name": "blend", "configuration": {"authority": None}}}, config_for("paper")),
    ],
)
def test_old_metadata_name_the_arbiter_and_its_numbers(metadata, expected):
    assert config_of_log(metadata) == expected


def test_without_a_learner_the_human_drives_alone_whatever_the_config_says(scenario):
    for driver in ("shared", "agent"):
        trial = Simulation(scenario, config=SharedControlConfig(driver=driver)).run(TrialSettings(seed=2))
        assert trial.metadata["mode"] == "human"
        np.testing.assert_array_equal(trial.commands("shared"), trial.commands("human"))
