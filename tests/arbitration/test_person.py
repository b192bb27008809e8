"""The files of persons, and what is refused."""

import json

import pytest

from drake_shared.arbitration.person import Person, person_path, read_person, write_person
from drake_shared.common.errors import InputError
from drake_shared.robots import DiffDrive, describe_robot

PERSON = Person(
    robot=describe_robot(DiffDrive()).to_json(),
    noises=(0.1, 1.0),
    noise_times=(0.5,),
    probability=(0.25, 0.75),
    trials=3,
)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "anna.json"
    write_person(PERSON, path)
    return path


def test_a_file_is_read_as_it_was_written(file):
    assert read_person(file, DiffDrive()) == PERSON


def test_names_lie_in_the_state_folder_and_files_where_they_are(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert person_path("anna") == tmp_path / "drake_shared" / "people" / "anna.json"
    assert person_path("folder/anna.json").parts == ("folder", "anna.json")
    for name in ("", "../anna", "a/b"):
        with pytest.raises(InputError):
            person_path(name)


def test_a_file_of_another_robot_is_refused(file):
    with pytest.raises(InputError) as caught:
        read_person(file, DiffDrive(max_speed=0.3))
    assert caught.value.field == "robot"


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("probability", [0.5, float("nan")]),
        ("probability", [0.5, float("inf")]),
        ("probability", [-0.5, 1.0]),
        ("probability", [1.0]),
        ("probability", [0.0, 0.0]),
        ("noises", []),
        ("noise_times", "0.5"),
    ],
)
def test_a_prior_that_is_no_distribution_is_refused(file, field, value):
    file.write_text(json.dumps(json.loads(file.read_text()) | {field: value}))
    with pytest.raises(InputError) as caught:
        read_person(file, DiffDrive())
    assert caught.value.field == field


@pytest.mark.parametrize("text", ["{", "[]", "{}"])
def test_another_file_is_refused(file, text):
    file.write_text(text)
    with pytest.raises(InputError):
        read_person(file, DiffDrive())


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError):
        read_person(tmp_path / "nobody.json", DiffDrive())
