"""Imports the examples as modules."""

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def example(monkeypatch) -> Callable[[str], ModuleType]:
    """An example by the name of its file; one may import another, as when it is run as a program."""
    monkeypatch.syspath_prepend(str(EXAMPLES))

    def load(name: str) -> ModuleType:
        return importlib.import_module(name)

    yield load
    for file in EXAMPLES.glob("*.py"):
        sys.modules.pop(file.stem, None)
