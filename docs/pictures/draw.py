"""Draws the pictures of the documentation from trials that it runs. ``scripts/pictures`` calls it."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle as Disc, Rectangle
from matplotlib.transforms import Affine2D

from drake_shared import (
    Authority,
    Scenario,
    SharedControlConfig,
    Simulation,
    Trial,
    TrialSettings,
    config_for,
    load_learner,
    load_scenario,
    teach,
    train,
)
from drake_shared.simulation.config import blend_for

HERE = Path(__file__).parent
HUMAN, AGENT, OBSTACLE, GOAL = "#0072b2", "#d55e00", "0.55", "#009e73"
HALL = """\
name: hall
goal: {x: 5.0, y: 0.0}
workspace: {x_min: -0.7, x_max: 5.7, y_min: -1.6, y_max: 1.6}
obstacles:
- !Circle {name: pillar, x: 2.0, y: 0.0, radius: 0.3}
- !Box {name: desk, x: 3.8, y: 1.2, length: 0.8, width: 0.5}
routes:
- name: left
  waypoints: [[0.0, 0.0], [2.0, 0.9], [3.8, 0.2], [5.0, 0.0]]
  sides: {pillar: left, desk: right}
- name: right
  waypoints: [[0.0, 0.0], [2.0, -0.9], [3.8, -0.3], [5.0, 0.0]]
  sides: {pillar: right, desk: right}
"""


def main() -> None:
    """Writes every picture."""
    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    drawings = (prediction, weight, gain, authority, hall)
    chosen = set(sys.argv[1:])
    for draw in drawings:
        if not chosen or draw.__name__ in chosen:
            save(draw.__name__, draw)


def save(name: str, draw: Callable[[], Figure]) -> None:
    """Writes one picture as PNG."""
    figure = draw()
    figure.savefig(HERE / f"{name}.png", dpi=150)
    plt.close(figure)
    print(f"wrote {name}.png")


def prediction() -> Figure:
    """The predicted path and its spread at four moments of one trial."""
    scenario = load_scenario("two_obstacles")
    simulation = Simulation(scenario, learner=load_learner("two_obstacles"), config=blend_for("default"))
    running = simulation.begin(TrialSettings(route="right_left", seed=1))
    estimator, arbiter = simulation.parts.estimator, simulation.parts.arbiter
    figure, axes = plt.subplots(2, 2, figsize=(9, 5), layout="constrained", sharex=True, sharey=True)
    for axis, time in zip(axes.flat, (0.2, 2.5, 5.0, 7.0), strict=True):
        running.advance(time)
        trial = running.finish()
        intention = estimator.GetOutputPort("intention").Eval(estimator.GetMyContextFromRoot(running.root))
        w = arbiter.GetOutputPort("human_weight").Eval(arbiter.GetMyContextFromRoot(running.root)).item()
        draw_scene(axis, scenario)
        for path in simulation.learner.demonstrations:
            axis.plot(*path.T, color="0.8", linewidth=1, zorder=0)
        mean, variance = intention.mean[intention.first :], intention.variance[intention.first :]
        width = 1.96 * np.sqrt(variance[:, 1])
        axis.fill_between(mean[:, 0], mean[:, 1] - width, mean[:, 1] + width, color=AGENT, alpha=0.18, lw=0)
        axis.plot(*mean.T, color=AGENT, label="predicted path, 95% band")
        axis.plot(trial["x"], trial["y"], color=HUMAN, linewidth=2, label="driven path")
        axis.plot(trial["x"][-1], trial["y"][-1], "o", color=HUMAN)
        axis.set_title(f"t = {time:.1f} s: human weight w = {w:.2f}", fontsize=9)
    axes[0, 0].plot([], [], color="0.8", label="demonstrations")
    axes[0, 0].legend(fontsize=7, loc="upper right", frameon=False)
    return figure


def weight() -> Figure:
    """The human weight over the driven distance, with both presets."""
    scenario = load_scenario("two_obstacles")
    figure, axis = plt.subplots(figsize=(8, 2.8), layout="constrained")
    for preset, style in (("default", "-"), ("paper", "--")):
        learner = load_learner(f"two_obstacles_{preset}")
        simulation = Simulation(scenario, learner=learner, config=blend_for(preset))
        trial = simulation.run(TrialSettings(route="right_left", seed=1))
        axis.plot(trial["x"], trial["human_weight"], style, color=HUMAN, label=f"preset {preset}")
    for obstacle in scenario.obstacles:
        axis.axvspan(obstacle.x - obstacle.radius, obstacle.x + obstacle.radius, color=OBSTACLE, alpha=0.25)
        axis.annotate(f"{obstacle.name} obstacle", (obstacle.x, 1.02), ha="center", fontsize=7)
    axis.set(xlabel="x, m", ylabel="human weight w", ylim=(0, 1.1), xlim=(0, 5))
    axis.legend(frameon=False, loc="upper right")
    return figure


def gain() -> Figure:
    """Confidence against mean variance for three values of K."""
    learner = load_learner("two_obstacles")
    scenario = load_scenario("two_obstacles")
    simulation = Simulation(scenario, learner=learner, config=blend_for("default"))
    trial = simulation.run(TrialSettings(route="right_left", seed=1))
    variance = np.geomspace(1e-4, 1.0, 300)
    figure, axis = plt.subplots(figsize=(8, 2.8), layout="constrained")
    for factor, style in ((0.2, ":"), (1.0, "-"), (5.0, "--")):
        K = factor * learner.confidence_gain
        axis.semilogx(
            variance, np.minimum(1.0, 1.0 / (K * variance)), style, color=AGENT, label=f"K = {K:.0f} / m²"
        )
    axis.plot(trial["mean_variance"], np.full(len(trial["t"]), -0.04), "|", color="0.4", clip_on=False)
    axis.annotate(
        "met in one trial", (trial["mean_variance"].max(), 0.02), ha="right", fontsize=7, color="0.4"
    )
    axis.set(
        xlabel="mean predicted variance of the steps to come, m²",
        ylabel="confidence $c_f$",
        ylim=(-0.05, 1.05),
    )
    axis.legend(frameon=False)
    return figure


def authority() -> Figure:
    """A driver whose route the learner was never taught, with and without authority."""
    scenario = load_scenario("two_obstacles")
    taught = teach(scenario)
    learner = train(dataclasses.replace(taught, items=taught.items[:1]))
    figure, (paths, weights) = plt.subplots(
        1, 2, figsize=(9, 2.8), layout="constrained", gridspec_kw={"width_ratios": (1.3, 1)}
    )
    draw_scene(paths, scenario)
    for path in learner.demonstrations:
        paths.plot(*path.T, color="0.8", linewidth=1, zorder=0)
    for name, on, style in (("with authority", True, "-"), ("without", False, "--")):
        config = SharedControlConfig(authority=Authority(enabled=on))
        simulation = Simulation(scenario, learner=learner, config=config)
        trial = simulation.run(TrialSettings(route="left_left", seed=2))
        paths.plot(trial["x"], trial["y"], style, color=HUMAN, label=name)
        touched = np.flatnonzero(trial["contact"])[:1]
        paths.plot(trial["x"][touched], trial["y"][touched], "x", color=HUMAN)
        weights.plot(trial["t"], trial["human_weight"], style, color=HUMAN)
    weights.set(xlabel="time, s", ylabel="human weight w", ylim=(0, 1.1))
    paths.plot([], [], "x", color=HUMAN, label="contact")
    paths.plot([], [], color="0.8", label="the only demonstration")
    paths.legend(fontsize=7, frameon=False, loc="lower left")
    return figure


def hall() -> Figure:
    """The figure of the tutorial: ten trials in a custom scenario."""
    file = HERE / "hall.yaml"
    file.write_text(HALL, encoding="utf-8")
    scenario = load_scenario(file)
    file.unlink()
    config = config_for("default", arbitration="blend")
    simulation = Simulation(scenario, learner=train(teach(scenario)), config=config)
    trials = [
        simulation.run(TrialSettings(route=scenario.routes[seed % 2].name, seed=seed)) for seed in range(10)
    ]
    figure, (paths, weights) = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
    for trial in trials:
        draw_trial(paths, weights, trial)
    paths.set(xlabel="x, m", ylabel="y, m", aspect="equal")
    weights.set(xlabel="time, s", ylabel="human weight w", ylim=(0, 1))
    return figure


def draw_trial(paths: Axes, weights: Axes, trial: Trial) -> None:
    """A trial in the colour of its route."""
    color = {"left": "tab:blue", "right": "tab:orange"}[trial.metadata["route"]]
    paths.plot(trial["x"], trial["y"], color=color)
    weights.plot(trial["t"], trial["human_weight"], color=color)


def draw_scene(axis: Axes, scenario: Scenario) -> None:
    """Obstacles, start and goal, from above."""
    for item in scenario.obstacles:
        if hasattr(item, "radius"):
            axis.add_patch(Disc((item.x, item.y), item.radius, color=OBSTACLE))
        else:
            corner = (item.x - item.length / 2, item.y - item.width / 2)
            turned = Affine2D().rotate_around(item.x, item.y, item.yaw) + axis.transData
            axis.add_patch(Rectangle(corner, item.length, item.width, color=OBSTACLE, transform=turned))
    goal, space = scenario.goal, dataclasses.asdict(scenario.workspace)
    axis.add_patch(Disc((goal.x, goal.y), goal.radius, color=GOAL, alpha=0.6))
    axis.annotate("goal", (goal.x, goal.y - 0.45), ha="center", fontsize=7)
    axis.set(xlim=(-0.4, space["x_max"]), ylim=(space["y_min"], space["y_max"]), aspect="equal")
    axis.set(xlabel="x, m", ylabel="y, m")
    axis.label_outer()


if __name__ == "__main__":
    main()
