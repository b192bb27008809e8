"""Every code block of the README and of the documentation runs."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import pages  # noqa: E402

PAGES = pages.pages()
BLOCKS = [(page, block) for page in PAGES for block in pages.blocks(page)]


@pytest.fixture(scope="session")
def outcome(tmp_path_factory) -> Mapping[str, Any]:
    folder = tmp_path_factory.mktemp("pages")
    result = folder / "result.json"
    environment = {**os.environ, "MPLBACKEND": "Agg"}
    ran = subprocess.run(
        [sys.executable, HERE / "run_pages.py", folder, result],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    return json.loads(result.read_text())


@pytest.mark.parametrize("page", [str(page.relative_to(pages.ROOT)) for page in PAGES])
def test_blocks_of_page_run(page, outcome):
    assert not outcome[page]["failure"], outcome[page]["failure"]


def test_every_block_has_a_known_language():
    unknown = [(page.name, block.line) for page, block in BLOCKS if not block.language]
    assert not unknown
    assert {block.language for _, block in BLOCKS} <= {*pages.CODE, *pages.ILLUSTRATION}


def test_blocks_that_are_not_run_are_few_and_have_a_reason():
    left_out = [block for _, block in BLOCKS if block.action in ("skip", "parse")]
    assert all(len(block.detail.split()) >= 3 for block in left_out)
    assert len(left_out) <= 20
    assert {block.action for _, block in BLOCKS} <= {"", "file", "example", "extra", "parse", "skip"}


def test_examples_on_pages_are_those_of_the_checkout():
    shown = [block for _, block in BLOCKS if block.action == "example"]
    assert shown
    for block in shown:
        assert block.code == (pages.ROOT / "examples" / block.detail).read_text(encoding="utf-8")


def test_readme_is_short():
    text = (pages.ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.split()) <= 900
    assert sum(block.language == "python" for block in pages.blocks(pages.ROOT / "README.md")) == 3
