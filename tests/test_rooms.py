"""The structure of the package: rooms import downward only, and no imports form a circle."""

import ast
import graphlib
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "drake_shared"
# From top to bottom. A room imports rooms of lower floors only.
FLOORS = (
    ("cli",),
    ("study",),
    ("experiments", "cockpit"),
    ("analysis",),
    ("simulation",),
    ("systems",),
    ("arbitration", "operators", "learners"),
    ("demonstrations", "scenario"),
    ("robots",),
    ("common",),
)
FLOOR = {room: len(FLOORS) - index for index, rooms in enumerate(FLOORS) for room in rooms}


def name_of(file: Path) -> str:
    parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(file): file for file in PACKAGE.rglob("*.py")}


def imports(module: str) -> set[str]:
    """Modules of the package that a module imports, at its top or inside functions."""
    found = set()
    for node in ast.walk(ast.parse(MODULES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert not node.level, f"{module}: relative import"
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                found.add(whole if whole in MODULES else node.module)
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {name for name in found if name in MODULES and name != module}


def room_of(module: str) -> str:
    return module.split(".")[1]


INSIDE = sorted(module for module in MODULES if module.count("."))


def test_every_room_has_a_floor_and_says_what_it_is_for():
    rooms = {room_of(module) for module in INSIDE}
    assert rooms == set(FLOOR)
    for room in rooms:
        assert ast.get_docstring(ast.parse((PACKAGE / room / "__init__.py").read_text(encoding="utf-8")))


def test_the_package_has_at_most_sixteen_entries():
    assert len([entry for entry in PACKAGE.iterdir() if entry.name != "__pycache__"]) <= 16


@pytest.mark.parametrize("module", INSIDE)
def test_imports_run_down(module):
    own = room_of(module)
    others = {name for name in imports(module) if name.count(".") and room_of(name) != own}
    assert not {name for name in others if FLOOR[room_of(name)] >= FLOOR[own]}


def test_no_imports_form_a_circle():
    graph = {module: imports(module) for module in INSIDE}
    # A package's __init__ runs before any module in it, and gathers what they offer.
    for module, names in graph.items():
        graph[module] = {
            name for name in names if MODULES[name].name != "__init__.py" or not module.startswith(name)
        }
    tuple(graphlib.TopologicalSorter(graph).static_order())


@pytest.mark.parametrize(
    "module", ["drake_shared", "drake_shared.learners", "drake_shared.learners.cnmp.training"]
)
def test_learners_load_without_drake(module):
    code = f"import sys, {module}; print([name for name in sys.modules if name.split('.')[0] == 'pydrake'])"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"
