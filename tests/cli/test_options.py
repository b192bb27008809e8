"""Options that are generated from the config, their old spellings, and files of a config."""

import json

import pytest

from drake_shared.arbitration.authority import Authority
from drake_shared.cli.main import main, parse
from drake_shared.cli.old_spellings import translate
from drake_shared.common.errors import InputError
from drake_shared.common.files import models_directory
from drake_shared.simulation.config import SharedControlConfig, config_for
from drake_shared.simulation.faults import Faults

PAPER = str(models_directory() / "learners" / "two_obstacles_paper.safetensors")


def control(*arguments: str) -> SharedControlConfig:
    return parse(["simulate", *arguments]).control


@pytest.mark.parametrize(
    ("arguments", "fields"),
    [
        ((), {}),
        (("--driver", "human"), {"driver": "human"}),
        (("--arbitration", "agent"), {"arbitration": "agent"}),
        (
            ("--arbitration", "traded:threshold=0.6"),
            {"arbitration": "traded", "arbitration_options": {"threshold": 0.6}},
        ),
        (
            ("--authority.floor", "0.3", "--authority.conflict-time", "None"),
            {"arbitration": "blend", "authority": Authority(floor=0.3, conflict_time=None)},
        ),
        (
            ("--authority.enabled", "False"),
            {"arbitration": "blend", "authority": Authority(enabled=False)},
        ),
        (("--confidence-gain", "40"), {"arbitration": "blend", "confidence_gain": 40.0}),
        (("--faults.delay", "0.2"), {"faults": Faults(delay=0.2)}),
        (
            ("--safety-clearance", "0.05", "--look-ahead", "0.8", "--end", "duration"),
            {"arbitration": "blend", "safety_clearance": 0.05, "look_ahead": 0.8, "end": "duration"},
        ),
    ],
)
def test_every_field_of_the_config_is_an_option(arguments, fields):
    assert control(*arguments) == config_for("default", **fields)


@pytest.mark.parametrize("command", ["drive", "teach --out x", "simulate", "evaluate"])
def test_the_commands_that_run_trials_take_the_same_options(command):
    options = ["--arbitration", "halves", "--look-ahead", "0.8", "--faults.slip", "0.1"]
    control = parse([*command.split(), *options]).control
    assert (control.arbitration, control.look_ahead, control.faults) == ("halves", 0.8, Faults(slip=0.1))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("--mode human", ["--driver", "human"]),
        ("--mode=human", ["--driver", "human"]),
        ("--safety 0.05", ["--safety-clearance", "0.05"]),
        ("--authority off", ["--authority.enabled", "False"]),
        ("--authority on", ["--authority.enabled", "True"]),
        (
            "--authority floor=0.3,conflict_time=off",
            [
                *("--authority.enabled", "True", "--authority.floor", "0.3"),
                *("--authority.conflict_time", "None"),
            ],
        ),
        ("--fault delay=0.2,loss=0.1", ["--faults.delay", "0.2", "--faults.loss", "0.1"]),
    ],
)
def test_options_of_version_0_1_0_are_translated_with_one_warning(capsys, old, new):
    assert translate([*old.split(), "--seed", "3"]) == [*new, "--seed", "3"]
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    control(*old.split())


@pytest.mark.parametrize("old", ["--fault", "--fault delay", "--fault delay=1,delay=2", "--authority floor"])
def test_old_options_without_a_value_are_refused(old):
    with pytest.raises(InputError, match=old.split()[0]):
        translate(old.split())


def test_options_of_today_are_not_warned_about(capsys):
    control("--driver", "human", "--authority.floor", "0.1", "--faults.delay", "0.2")
    assert capsys.readouterr().err == ""


def test_the_learners_preset_names_the_config_unless_it_is_given(tmp_path):
    assert control("--preset", "paper") == config_for("paper")
    assert control("--model", PAPER) == config_for("paper")
    assert control("--preset", "paper", "--look-ahead", "0.5") == config_for("paper", look_ahead=0.5)
    with_authority = control("--preset", "paper", "--authority.enabled", "True")
    assert with_authority == config_for("paper", authority=Authority())
    file = tmp_path / "mine.yaml"
    file.write_text("look_ahead: 0.9\n")
    assert control("--preset", "paper", "--config", str(file)) == SharedControlConfig(look_ahead=0.9)


def test_options_win_over_the_file_of_the_config(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("faults: {freeze: 1.0, delay: 0.2}\nlook_ahead: 0.9\n")
    given = control("--config", str(file), "--faults.freeze-time", "2", "--look-ahead", "0.7")
    assert given == SharedControlConfig(faults=Faults(freeze=1.0, delay=0.2, freeze_time=2), look_ahead=0.7)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--autority.floor", "0.3"), "--authority.floor"),
        (("--look-ahed", "0.3"), "--look-ahead"),
        (("--authority.floor", "3"), "--authority.floor"),
        (("--faults.loss", "3"), "--faults.loss"),
        (("--faults.freeze-time", "3"), "--faults.freeze-time"),
        (("--faults.loss", "0.1", "--driver", "agent"), "--faults.loss"),
        (("--look-ahead", "0"), "--look-ahead"),
        (("--config", "none.yaml"), "none.yaml"),
        (("--arbitration", "coin"), "coin"),
    ],
)
def test_bad_options_are_one_line_with_the_option_and_the_likely_one(capsys, arguments, said):
    assert main(["simulate", *arguments]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert said in err


def test_a_file_of_a_config_reaches_the_trials_and_their_logs(capsys, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("arbitration: halves\nend: duration\n")
    assert main(["simulate", "--config", str(file), "--json", "--out", str(tmp_path / "logs")]) == 0
    (row,) = json.loads(capsys.readouterr().out)["trials"]
    assert row["mean_human_weight"] == 0.5


def test_the_version_is_printed(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("drake-shared ")
