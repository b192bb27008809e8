"""A run of experiments: errors before and after its tasks lose no results."""

import errno
import json
import os
import shutil
from pathlib import Path

import pytest

from drake_shared.common.errors import InputError, RunError
from drake_shared.experiments import reproduce as module
from drake_shared.experiments.section import QUICK, Experiment, PlannedTask, Section
from drake_shared.simulation.runner import Task


def small_report(_scenario, _size, results) -> Section:
    return Section(title="Small", text=results, data={"small": [{"value": value} for value in results]})


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Runs an experiment of two small tasks in ``tmp_path / "run"``."""

    def run(report=small_report, **options) -> list[Section]:
        experiment = Experiment(
            name="small",
            plan=lambda *_: [PlannedTask(Task("json:dumps", {"obj": [one]}), 0.1) for one in range(2)],
            report=report,
        )
        monkeypatch.setattr(module, "find_experiments", lambda _: [experiment])
        return module.reproduce(tmp_path / "run", size=QUICK, **options)

    return run


def files(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_experiments_are_found_by_name_and_by_module():
    names = [experiment.name for experiment in module.find_experiments()]
    assert names == list(module.MODULES)
    for only in (["weighting", "sensitivity"], ["sensitivity", "fig2_weighting"]):
        chosen = module.find_experiments(only)
        assert [experiment.name for experiment in chosen] == ["weighting", "sensitivity"]
    with pytest.raises(InputError, match="fig9"):
        module.find_experiments(["fig9"])


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"workers": 0}, "workers"),
        ({"cluster": "nowhere"}, "--cluster"),
    ],
)
def test_without_workers_no_folder_is_created(run, tmp_path, options, named):
    with pytest.raises(InputError, match=named):
        run(**options)
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_full_when_the_report_is_written_ends_the_run_which_can_be_resumed(
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
    messages = []
    (section,) = run(resume=True, say=messages.append)
    assert section.text == ["[0]", "[1]"]
    # The expected time is given only if tasks remain.
    assert [text.split()[0] for text in messages] == ["wrote"]
    assert "report.html" in files(tmp_path / "run")


def test_no_report_is_written_to_a_removed_run(run, tmp_path):
    def remove(*arguments) -> Section:
        shutil.rmtree(tmp_path / "run")
        return small_report(*arguments)

    with pytest.raises(RunError, match=r"run\.json"):
        run(remove)
    assert list(tmp_path.iterdir()) == []


def test_an_overwritten_run_has_no_report_of_the_old_one(run, tmp_path):
    run()
    assert json.loads((tmp_path / "run" / "report.json").read_text())["title"] == module.TITLE
    data = tmp_path / "run" / "data"
    (data / "own.parquet").touch()
    assert files(data) == {"small.parquet", "own.parquet"}

    def interrupt(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(interrupt, force=True)
    assert files(tmp_path / "run") == {"run.json", "results", "data"}
    assert files(data) == {"own.parquet"}


@pytest.mark.parametrize(
    "text", ["", "[]", '{"sections": [{}]}', '{"sections": [{"data": ["../run", 1, "a b"]}]}']
)
def test_a_damaged_report_removes_no_data(run, tmp_path, text):
    run()
    folder = tmp_path / "run"
    (folder / "run.parquet").touch()
    (folder / "report.json").write_text(text)
    run(lambda *_: Section(title="Other", text=[]), force=True)
    assert {"run.parquet", "data"} <= files(folder)
    assert files(folder / "data") == {"small.parquet"}
