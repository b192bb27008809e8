"""A whole run: what ends it, before its tasks or after them, is said and costs nothing that is done."""

import errno
import json
import os
import shutil
from pathlib import Path

import pytest

from drake_shared.common.errors import InputError, RunError
from drake_shared.experiments import reproduce as whole
from drake_shared.experiments.section import QUICK, Experiment, Section
from drake_shared.simulation.runner import Task


def told(_scenario, _size, results) -> Section:
    return Section(title="Small", text=results, data={"small": [{"value": value} for value in results]})


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Runs an experiment of two small tasks in ``tmp_path / "run"``."""

    def run(report=told, **options) -> list[Section]:
        experiment = Experiment(
            name="small",
            tasks=lambda *_: [Task("json:dumps", {"obj": [number]}) for number in range(2)],
            cost=lambda _: 0.1,
            report=report,
        )
        monkeypatch.setattr(whole, "find_experiments", lambda _: [experiment])
        return whole.reproduce(tmp_path / "run", size=QUICK, **options)

    return run


def files(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"workers": 0}, "workers must be at least 1, got 0"),
        ({"cluster": "nowhere"}, "--cluster must be the"),
    ],
)
def test_where_nothing_can_be_run_no_folder_is_begun(run, tmp_path, options, said):
    with pytest.raises(InputError, match=said):
        run(**options)
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_full_when_the_report_is_written_is_said_and_the_rest_follows(
    run, tmp_path, monkeypatch
):
    write = Path.write_text

    def full(path, *arguments, **options):
        if "report.html" in path.name:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(path, *arguments, **options)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_text", full)
        with pytest.raises(RunError, match=r"report\.html: .*No space left") as caught:
            run()
    assert "\n" not in str(caught.value)
    assert files(tmp_path / "run") == {"run.json", "results", "data", "report.json"}
    asked = []
    (section,) = run(resume=True, say=asked.append)
    assert section.text == ["[0]", "[1]"]
    # How long it will take is said only where something is to be run.
    assert [text.split()[0] for text in asked] == ["wrote"]
    assert "report.html" in files(tmp_path / "run")


def test_a_report_is_not_put_where_the_run_is_no_more(run, tmp_path):
    def remove(*arguments) -> Section:
        shutil.rmtree(tmp_path / "run")
        return told(*arguments)

    with pytest.raises(RunError, match=r"run\.json was removed"):
        run(remove)
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_is_begun_anew_has_no_report_before_its_own(run, tmp_path):
    run()
    assert json.loads((tmp_path / "run" / "report.json").read_text())["title"] == whole.TITLE
    data = tmp_path / "run" / "data"
    (data / "own.parquet").touch()
    assert files(data) == {"small.parquet", "own.parquet"}

    def give_up(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(give_up, force=True)
    assert files(tmp_path / "run") == {"run.json", "results", "data"}
    assert files(data) == {"own.parquet"}


@pytest.mark.parametrize(
    "text", ["", "[]", '{"sections": [{}]}', '{"sections": [{"data": ["../run", 1, "a b"]}]}']
)
def test_a_report_that_says_nothing_true_of_its_data_removes_none(run, tmp_path, text):
    run()
    folder = tmp_path / "run"
    (folder / "run.parquet").touch()
    (folder / "report.json").write_text(text)
    run(lambda *_: Section(title="Other", text=[]), force=True)
    assert {"run.parquet", "data"} <= files(folder)
    assert files(folder / "data") == {"small.parquet"}
