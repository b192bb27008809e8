"""Exports read back equal, each through its own library."""

import csv
import json

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader

from drake_shared.analysis.export import export
from drake_shared.analysis.export.lerobot import write_lerobot
from drake_shared.analysis.export.mcap_files import write_mcap
from drake_shared.analysis.export.tables import write_csv
from drake_shared.cli.main import main
from drake_shared.common.errors import InputError
from drake_shared.simulation.config import SharedControlConfig
from drake_shared.simulation.log import write_log
from drake_shared.simulation.trial import Simulation, TrialSettings


@pytest.fixture(scope="module")
def logs(_two_obstacles, route_learner):
    """A trial with agent and safety filter, and two of the human alone."""
    config = SharedControlConfig(safety_clearance=0.05)
    shared = Simulation(_two_obstacles, learner=route_learner(_two_obstacles), config=config)
    first = shared.run(TrialSettings(route="left_right", seed=1))
    alone = Simulation(_two_obstacles)
    others = [alone.run(TrialSettings(route=route, seed=2)) for route in ("right_left", "left_right")]
    return [("filtered", first), *zip(("alone", "again"), others, strict=True)]


def same(one, other) -> bool:
    return np.array_equal(one, other, equal_nan=np.asarray(one).dtype.kind == "f")


def read_mcap(path):
    """Columns and metadata of a trial."""
    with path.open("rb") as file:
        reader = make_reader(file)
        (metadata,) = (item.metadata for item in reader.iter_metadata() if item.name == "drake_shared")
        rows = [json.loads(message.data) for _, _, message in reader.iter_messages(topics=["/log"])]
    columns = {name: [np.nan if row[name] is None else row[name] for row in rows] for name in rows[0]}
    return columns, json.loads(metadata["log"])


def read_lerobot(folder):
    """The features of each episode, as arrays."""
    frames = pq.read_table(folder / "data").to_pandas()
    return [
        {name: np.stack(values.to_list()) for name, values in episode.items()}
        for _, episode in frames.groupby("episode_index")
    ]


def test_csv_reads_back_to_the_bit(logs, tmp_path):
    export(logs, tmp_path / "out", write_csv)
    for name, trial in logs:
        with (tmp_path / "out" / f"{name}.csv").open() as file:
            rows = list(csv.DictReader(file))
        assert list(rows[0]) == list(trial.columns)
        words = {"true": 1.0, "false": 0.0}
        for column, values in trial.columns.items():
            found = np.array([float(words.get(row[column], row[column])) for row in rows])
            assert same(found, values.astype(float))
        text = (tmp_path / "out" / "README.md").read_text()
        assert all(f"`{column}`" in text for column in trial.columns)
    assert list(pd.read_csv(tmp_path / "out" / "trials.csv")["log"]) == [name for name, _ in logs]


def test_mcap_reads_back_to_the_bit_and_has_foxgloves_schemas(logs, tmp_path):
    export(logs, tmp_path / "out", write_mcap)
    for name, trial in logs:
        columns, metadata = read_mcap(tmp_path / "out" / f"{name}.mcap")
        assert metadata == json.loads(json.dumps(dict(trial.metadata)))
        assert all(same(values, columns[column]) for column, values in trial.columns.items())
        with (tmp_path / "out" / f"{name}.mcap").open("rb") as file:
            messages = list(make_reader(file).iter_messages())
        schemas = {channel.topic: schema.name for schema, channel, _ in messages}
        assert schemas["/pose"] == "foxglove.PoseInFrame"
        assert schemas["/path"] == schemas["/route"] == "foxglove.PosesInFrame"
        poses = [json.loads(message.data) for _, channel, message in messages if channel.topic == "/pose"]
        assert [pose["pose"]["position"]["x"] for pose in poses] == trial["x"].tolist()


def test_lerobot_dataset_holds_all_commands_rounded_to_float32(logs, tmp_path):
    # A robot, and with it the columns of the log, is the same with and without filter.
    export(logs, tmp_path / "out", write_lerobot)
    episodes = read_lerobot(tmp_path / "out")
    for (_, trial), frames in zip(logs, episodes, strict=True):
        rows = len(trial["t"]) - 1
        for who in ("human", "autonomous", "shared"):
            assert same(frames[f"action.{who}"], trial.commands(who)[:rows].astype(np.float32))
        applied = "safe" if "safe_left" in trial.columns else "shared"
        assert same(frames["action"], trial.commands(applied)[:rows].astype(np.float32))
        assert same(frames["is_intervention"], (trial.commands("human")[:rows] != 0.0).any(axis=1))
        assert frames["timestamp"] == pytest.approx(trial["t"][:rows], abs=1e-6)
        assert frames["next.done"].sum() == 1


def test_lerobot_dataset_has_the_layout_of_version_3(logs, tmp_path):
    export(logs, tmp_path / "out", write_lerobot)
    info = json.loads((tmp_path / "out" / "meta" / "info.json").read_text())
    data = pq.ParquetFile(tmp_path / "out" / info["data_path"].format(chunk_index=0, file_index=0))
    assert info["codebase_version"] == "v3.0"
    assert info["fps"] == 20
    assert (info["total_episodes"], data.num_row_groups) == (3, 3)
    assert info["total_frames"] == data.metadata.num_rows
    for name, feature in info["features"].items():
        kind = data.schema_arrow.field(name).type
        shape = [kind.list_size] if feature["shape"] != [1] else [1]
        assert feature["shape"] == shape
    episodes = pd.read_parquet(tmp_path / "out" / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    assert (episodes["dataset_to_index"] - episodes["dataset_from_index"] == episodes["length"]).all()
    assert episodes["dataset_from_index"][0] == 0
    tasks = pd.read_parquet(tmp_path / "out" / "meta" / "tasks.parquet")
    assert tasks.index.name == "task"
    assert set(tasks["task_index"]) == {0, 1}
    stats = json.loads((tmp_path / "out" / "meta" / "stats.json").read_text())
    state = np.concatenate([frames["observation.state"] for frames in read_lerobot(tmp_path / "out")])
    assert stats["observation.state"]["std"] == pytest.approx(state.std(axis=0, dtype=np.float64), rel=1e-5)


def test_what_cannot_be_exported_is_refused_and_leaves_nothing(logs, tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("keep")
    twice = [logs[0], logs[0]]
    for given, out in ((logs, tmp_path / "full"), ([], tmp_path / "new"), (twice, tmp_path / "new")):
        with pytest.raises(InputError):
            export(given, out, write_csv)
    assert [path.name for path in tmp_path.iterdir()] == ["full"]


def test_command_takes_folders_of_logs(logs, tmp_path):
    for name, trial in logs:
        write_log(trial, tmp_path / "logs" / f"{name}.parquet")
    out = str(tmp_path / "out")
    assert main(["export", str(tmp_path / "logs"), "--format", "lerobot", "--out", out]) == 0
    assert len(read_lerobot(tmp_path / "out")) == 3
    assert main(["export", str(tmp_path / "logs"), "--format", "csv", "--out", out]) == 2
