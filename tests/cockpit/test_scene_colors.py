"""The colours of the scene stay apart, also for the colour-blind."""

import itertools
import re
from pathlib import Path

import numpy as np
import pytest

import drake_shared.cockpit
from drake_shared.systems.intention_visualizer import AGENT_COLOR, HUMAN_COLOR, SHARED_COLOR

CSS = (Path(drake_shared.cockpit.__file__).parent / "page" / "scene.css").read_text(encoding="utf-8")
NAMES = ("human", "agent", "shared", "start", "goal", "contact", "obstacle", "floor")

# Machado, Oliveira and Fernandes 2009, severity 1, for linear RGB.
SIGHTS = {
    "normal": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
LEAST_DIFFERENCE = 25.0
"""In CIELAB (CIE 1976); 2.3 is just noticeable side by side."""


def palette(theme: str) -> dict[str, str]:
    block = re.search(rf'\[data-theme="{theme}"\] {{(.*?)}}', CSS, re.DOTALL)
    return dict(re.findall(r"--scene-([a-z-]+): (#[0-9a-f]{6});", block[1]))


def test_the_panel_draws_the_shared_command_in_the_colour_of_the_scene():
    panel = (Path(drake_shared.cockpit.__file__).parent / "page" / "cockpit.css").read_text(encoding="utf-8")
    dark, light = re.findall(r"--shared: (#[0-9a-f]{6});", panel)
    assert {"dark": dark, "light": light} == {theme: palette(theme)["shared"] for theme in ("dark", "light")}


def linear(color: str) -> np.ndarray:
    values = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    to_xyz = [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
    xyz = to_xyz @ np.clip(rgb, 0.0, 1.0) / [0.95047, 1.0, 1.08883]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("sight", SIGHTS)
@pytest.mark.parametrize("pair", list(itertools.combinations(NAMES, 2)), ids="-".join)
def test_every_two_colours_differ(theme, sight, pair):
    colors = palette(theme)
    first, second = (lab(SIGHTS[sight] @ linear(colors[name])) for name in pair)
    assert np.linalg.norm(first - second) > LEAST_DIFFERENCE


def test_the_difference_of_red_and_green_vanishes_for_a_deuteranope_as_it_should():
    """The simulation itself: this pair is told apart by normal sight only."""
    pair = [linear(color) for color in ("#c87850", "#a08850")]
    normal, blind = (
        np.linalg.norm(lab(SIGHTS[sight] @ pair[0]) - lab(SIGHTS[sight] @ pair[1]))
        for sight in ("normal", "deuteranopia")
    )
    assert blind < 0.35 * normal


def test_meshcat_has_the_same_colours():
    colors = palette("light")
    for name, values in (("human", HUMAN_COLOR), ("agent", AGENT_COLOR), ("shared", SHARED_COLOR)):
        np.testing.assert_allclose(
            values, [int(colors[name][i : i + 2], 16) / 255 for i in (1, 3, 5)], atol=0.01
        )
