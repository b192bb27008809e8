"""The documentation site builds without warnings, and describes what there is."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def site(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    ran = subprocess.run(
        [
            *(sys.executable, "-m", "sphinx", "--fail-on-warning", "--keep-going", "--quiet"),
            *("--doctree-dir", folder / "doctrees", ROOT / "docs", folder / "html"),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    return folder / "html"


def test_systems_are_drawn_with_their_ports(site):
    pages = "".join(page.read_text(encoding="utf-8") for page in (site / "reference").rglob("*.html"))
    assert 'aria-label="ConfidenceBlender: inputs human_command, autonomous_command, confidence' in pages


def test_every_command_is_described(site):
    from drake_shared.cli.main import main  # noqa: F401

    page = (site / "reference" / "command-line.html").read_text(encoding="utf-8")
    for command in ("drive", "teach", "train", "simulate", "evaluate", "replay", "fit-operator", "lineage"):
        assert f'id="command-{command}"' in page
