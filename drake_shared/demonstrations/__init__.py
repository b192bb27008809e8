"""Demonstrations of a task: trajectories, scores, sampling weights and Parquet files. Knows no Drake.

- `trajectories`: `Demonstration`, positions over time, and `Demonstrations`, those of one task
- `weights`: scores and the probabilities with which training samples demonstrations
- `parquet`: reading and writing files, and logs of trials as demonstrations
- `alignment`: pauses counted out, and one pace for all
- `units`: whether they are in seconds and metres
- `progress_clock`: how far along the demonstrations a robot is
"""

from drake_shared.demonstrations.alignment import align, motion_time
from drake_shared.demonstrations.parquet import (
    LOG_FORMAT,
    METADATA_KEY,
    provenance_of_trial,
    read_demonstrations,
    write_demonstrations,
)
from drake_shared.demonstrations.progress_clock import ProgressClock
from drake_shared.demonstrations.trajectories import Demonstration, Demonstrations
from drake_shared.demonstrations.units import check_units
from drake_shared.demonstrations.weights import (
    Scorer,
    demonstration_weights,
    load_scorer,
    min_score_width,
    sampling_weights,
    score_demonstrations,
)

__all__ = [
    "LOG_FORMAT",
    "METADATA_KEY",
    "Demonstration",
    "Demonstrations",
    "ProgressClock",
    "Scorer",
    "align",
    "check_units",
    "demonstration_weights",
    "load_scorer",
    "min_score_width",
    "motion_time",
    "provenance_of_trial",
    "read_demonstrations",
    "sampling_weights",
    "score_demonstrations",
    "write_demonstrations",
]
