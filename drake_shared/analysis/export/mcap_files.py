"""Logs as MCAP files with Foxglove's schemas, one file for each trial."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mcap.writer import Writer

from drake_shared.simulation.log import Trial

FRAME = "world"
LOG, METADATA = "/log", "drake_shared"
_NUMBER, _WHOLE, _TEXT = {"type": "number"}, {"type": "integer"}, {"type": "string"}


def _object(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties}


_TIME = _object(sec=_WHOLE, nsec=_WHOLE)
_POSE = _object(
    position=_object(x=_NUMBER, y=_NUMBER, z=_NUMBER),
    orientation=_object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER),
)
_HEAD = {"timestamp": _TIME, "frame_id": _TEXT}
_POSE_IN_FRAME = _object(**_HEAD, pose=_POSE)
_POSES_IN_FRAME = _object(**_HEAD, poses={"type": "array", "items": _POSE})


def write_mcap(logs: Sequence[tuple[str, Trial]], folder: Path) -> None:
    """Writes ``NAME.mcap`` for each trial to a folder that exists.

    Topics: ``/pose`` (foxglove.PoseInFrame), ``/path`` and ``/route`` (foxglove.PosesInFrame, once, at the
    start) and ``/log``, a message with all columns for each row. Messages are JSON; times are those of the
    trial. The metadata record ``drake_shared`` holds the log's metadata as JSON.
    """
    for name, trial in logs:
        with (folder / f"{name}.mcap").open("wb") as file:
            _write(trial, file)


def _write(trial: Trial, file: Any) -> None:
    writer = Writer(file)
    writer.start(library="drake_shared")
    columns = {name: values.tolist() for name, values in trial.columns.items()}
    kinds = {name: "boolean" if isinstance(values[0], bool) else "number" for name, values in columns.items()}
    row_schema = _object(**{name: {"type": [kind, "null"]} for name, kind in kinds.items()})
    pose, path, route, log = (
        _channel(writer, topic, schema, fields)
        for topic, schema, fields in (
            ("/pose", "foxglove.PoseInFrame", _POSE_IN_FRAME),
            ("/path", "foxglove.PosesInFrame", _POSES_IN_FRAME),
            ("/route", "foxglove.PosesInFrame", _POSES_IN_FRAME),
            (LOG, "drake_shared.LogRow", row_schema),
        )
    )
    yaws = columns.get("yaw") or [0.0] * len(columns["t"])
    poses = [_pose(position, yaw) for position, yaw in zip(trial.positions.tolist(), yaws, strict=True)]
    named = {item["name"]: item for item in trial.metadata["scenario"]["routes"]}
    _add(writer, path, 0.0, {**_head(0.0), "poses": poses})
    if trial.metadata.get("route") in named:
        points = named[trial.metadata["route"]]["waypoints"]
        _add(writer, route, 0.0, {**_head(0.0), "poses": [_pose(point, 0.0) for point in points]})
    for index, time in enumerate(columns["t"]):
        _add(writer, pose, time, {**_head(time), "pose": poses[index]})
        row = {name: values[index] for name, values in columns.items()}
        _add(writer, log, time, {k: None if isinstance(v, float) and v != v else v for k, v in row.items()})
    writer.add_metadata(METADATA, {"log": json.dumps(dict(trial.metadata))})
    writer.finish()  # type: ignore[no-untyped-call]


def _channel(writer: Writer, topic: str, name: str, schema: dict[str, Any]) -> int:
    number = writer.register_schema(name=name, encoding="jsonschema", data=json.dumps(schema).encode())
    return writer.register_channel(topic=topic, message_encoding="json", schema_id=number)


def _add(writer: Writer, channel: int, time: float, message: dict[str, Any]) -> None:
    stamp = round(1e9 * time)
    data = json.dumps(message).encode()
    writer.add_message(channel_id=channel, log_time=stamp, publish_time=stamp, data=data)


def _head(time: float) -> dict[str, Any]:
    seconds, rest = divmod(round(1e9 * time), 1_000_000_000)
    return {"timestamp": {"sec": seconds, "nsec": rest}, "frame_id": FRAME}


def _pose(position: Sequence[float], yaw: float) -> dict[str, Any]:
    x, y, z = (*position, 0.0)[:3]
    half = 0.5 * yaw
    orientation = {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)}
    return {"position": {"x": x, "y": y, "z": z}, "orientation": orientation}
