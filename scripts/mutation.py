"""Mutation testing with Cosmic Ray's operators, on a sample of the mutants, in copies of the checkout.

    scripts/mutate drake_shared/arbitration --tests tests/arbitration tests/systems/test_confidence_blender.py

Each mutant changes one place of a module. It is killed if a test fails or takes much too long, and survives
otherwise. Every given test file runs once without a mutation, to find out which functions it calls. Of a
mutant those files run, quick ones first, that call the changed function or, if the place is outside of
functions, any function of its module. Results are appended to a file of JSON lines, so that a run that was
stopped continues.
"""

from __future__ import annotations

import argparse
import ast
import concurrent.futures
import contextlib
import difflib
import functools
import hashlib
import itertools
import json
import math
import multiprocessing
import os
import queue
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import CodeType, FrameType
from typing import NamedTuple

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.operator import Operator
from cosmic_ray.plugins import get_operator
from parso.tree import NodeOrLeaf

ROOT = Path(__file__).resolve().parents[1]
# Loaded once, in a process that forks one process for each mutant.
_LIBRARIES = (
    "__main__",
    "pydrake.all",
    "torch._dynamo",
    "pytest",
    "hypothesis",
    "scipy.optimize",
    "pyarrow.parquet",
)
# One replacement for each operator; all pairs would be ten times as many, and as easily killed.
_PAIRS = {
    "BinaryOperator": "Add_Sub Sub_Add Mul_Div Div_Mul Pow_Mul FloorDiv_Mul Mod_Mul",
    "ComparisonOperator": "Lt_LtE LtE_Lt Gt_GtE GtE_Gt Lt_Gt Gt_Lt Eq_NotEq NotEq_Eq Is_IsNot IsNot_Is",
    "UnaryOperator": "USub_UAdd Delete_Not",
}
OPERATORS = (
    *(f"core/Replace{kind}_{pair}" for kind, pairs in _PAIRS.items() for pair in pairs.split()),
    *("core/ReplaceAndWithOr", "core/ReplaceOrWithAnd", "core/ReplaceTrueWithFalse"),
    *("core/ReplaceFalseWithTrue", "core/ReplaceBreakWithContinue", "core/ReplaceContinueWithBreak"),
    *("core/AddNot", "core/NumberReplacer", "core/ZeroIterationForLoop"),
)


class TakeFirstArgument(Operator):
    """Replaces max(a, b, ...), min, clip, maximum, minimum by ``a``."""

    _FUNCTIONS = ("max", "min", "clip", "maximum", "minimum")

    def mutation_positions(self, node: NodeOrLeaf) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
        """The whole call, if it has several positional arguments."""
        children = getattr(node, "children", ())
        if node.type in ("power", "atom_expr") and len(children) in (2, 3):
            *_, name, call = children
            last = name.get_last_leaf().value
            inner = call.children[1] if call.type == "trailer" and len(call.children) == 3 else None
            if last in self._FUNCTIONS and inner is not None and inner.type == "arglist":
                yield node.start_pos, node.end_pos

    def mutate(self, node: NodeOrLeaf, index: int) -> NodeOrLeaf:
        """The first argument in place of the call."""
        first = node.children[-1].children[1].children[0]
        first.get_first_leaf().prefix = node.get_first_leaf().prefix
        return first

    @classmethod
    def examples(cls) -> tuple[()]:
        """None."""
        return ()


class Mutant(NamedTuple):
    """A mutated module."""

    module: str
    operator: str
    difference: str
    code: str

    @property
    def key(self) -> str:
        """Identifies the mutant, as long as its module does not change."""
        return hashlib.sha256(f"{self.module}\n{self.code}".encode()).hexdigest()[:16]


class Place(NamedTuple):
    """An occurrence in a module of what an operator replaces."""

    module: str
    operator: str
    occurrence: int


def places_in(module: str) -> list[Place]:
    """All places of a module that an operator replaces."""
    nodes = list(ast_nodes(get_ast((ROOT / module).read_text(encoding="utf-8"))))
    counts = {
        name: sum(1 for node in nodes for _ in operator.mutation_positions(node))
        for name, operator in _operators().items()
    }
    return [Place(module, name, index) for name, count in counts.items() for index in range(count)]


def mutant_at(place: Place) -> Mutant | None:
    """The mutant; None if it is invalid or changes only declarations."""
    module, name, occurrence = place
    source = (ROOT / module).read_text(encoding="utf-8")
    code = mutate_code(source, _operators()[name], occurrence)
    if code is None or _structure(code) in (None, _structure(source)):
        return None
    # Of one element [0] and [-1] are the same, and of two [1] and [-1]: [0] becomes [1] alone.
    if code.count("[ -1]") > source.count("[ -1]"):
        return None
    lines = difflib.unified_diff(source.splitlines(), code.splitlines(), module, module, n=0, lineterm="")
    return Mutant(module, name.rpartition("/")[2], "\n".join(list(lines)[2:]), code)


@functools.cache
def _operators() -> dict[str, Operator]:
    """The operators by name."""
    return {**{name: get_operator(name)() for name in OPERATORS}, "TakeFirstArgument": TakeFirstArgument()}


def _structure(code: str) -> str | None:
    """The code without the options of dataclasses, of arguments and of zip; None if it is invalid."""
    try:
        tree = ast.parse(code)
    except SyntaxError:
        return None
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func) in (
            "dataclass",
            "dataclasses.dataclass",
            "zip",
        ):
            node.keywords = []
        if isinstance(node, ast.arguments):
            names = [*node.posonlyargs, *node.args, *node.kwonlyargs]
            node.posonlyargs, node.args, node.kwonlyargs = [], names, []
            node.defaults = [*node.defaults, *filter(None, node.kw_defaults)]
            node.kw_defaults = []
    return ast.dump(tree)


def copy_checkout(folder: Path) -> Path:
    """A copy of the files that git knows, without compiled files."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout
    for name in filter(None, listed.decode().split("\0")):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    return folder


class Calls(NamedTuple):
    """What a test file calls.

    Attributes:
        seconds: It takes, with the calls recorded.
        functions: Modules and qualified names.
    """

    seconds: float
    functions: frozenset[tuple[str, str]]


def run_tests(folder: Path, tests: Sequence[str], timeout: float | None, calls: Path | None = None) -> str:
    """Runs the tests in a copy: "survived", "killed" or "timeout"; writes the functions called to a file."""
    context = multiprocessing.get_context("forkserver")
    process = context.Process(target=_pytest, args=(folder, tests, calls))
    process.start()
    process.join(timeout)
    outcome = "timeout" if process.exitcode is None else "survived" if process.exitcode == 0 else "killed"
    try:
        os.killpg(process.pid, signal.SIGKILL)  # Also what the tests have started.
    except ProcessLookupError:
        process.kill()
    process.join()
    return outcome


def _pytest(folder: Path, tests: Sequence[str], calls: Path | None) -> None:
    """Runs pytest in this process, which becomes the leader of a process group."""
    os.setpgid(0, 0)
    os.chdir(folder)
    os.environ["PYTHONPATH"] = str(folder)
    sys.path.insert(0, str(folder))
    with open(os.devnull, "r+b", buffering=0) as null:
        for stream in range(3):
            os.dup2(null.fileno(), stream)
    import pytest

    quiet = ["-q", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning"]
    codes: set[CodeType] = set()
    if calls is not None:

        def record(frame: FrameType, event: str, _argument: object) -> None:
            if event == "call":
                codes.add(frame.f_code)

        threading.setprofile(record)
        sys.setprofile(record)
    status = pytest.main(["-x", *quiet, *tests])
    sys.setprofile(None)
    if calls is not None:
        called = {
            (code.co_filename.removeprefix(f"{folder}/"), code.co_qualname)
            for code in codes
            if code.co_filename.startswith(f"{folder}/drake_shared/")
        }
        calls.write_text(json.dumps(sorted(called)), encoding="utf-8")
    os._exit(status)


def tests_of(mutant: Mutant, calls: Mapping[str, Calls]) -> list[str]:
    """The test files that call the changed function, else any function of the module; quick ones first."""
    line = int(re.match(r"@@ -(\d+)", mutant.difference)[1])  # type: ignore[index]
    function = function_at((ROOT / mutant.module).read_text(encoding="utf-8"), line)
    found = [file for file, called in calls.items() if (mutant.module, function) in called.functions]
    if not found:
        found = [
            file for file, called in calls.items() if mutant.module in {name for name, _ in called.functions}
        ]
    return sorted(found or calls, key=lambda file: calls[file].seconds)


def function_at(source: str, line: int) -> str | None:
    """The qualified name of the innermost function whose body has the line."""
    found = None

    def visit(parent: ast.AST, prefix: str) -> None:
        nonlocal found
        for node in ast.iter_child_nodes(parent):
            inner = prefix
            if isinstance(node, ast.FunctionDef):
                if node.body[0].lineno <= line <= (node.end_lineno or 0):
                    found = prefix + node.name
                inner = f"{prefix}{node.name}.<locals>."
            elif isinstance(node, ast.ClassDef):
                inner = f"{prefix}{node.name}."
            visit(node, inner)

    visit(ast.parse(source), "")
    return found


def test_files(tests: Sequence[str]) -> list[str]:
    """The given test files, and those in the given folders."""
    return [
        str(file.relative_to(ROOT))
        for path in map(Path, tests)
        for file in (sorted((ROOT / path).rglob("test_*.py")) if path.is_dir() else [ROOT / path])
    ]


def wilson_interval(killed: int, total: int) -> tuple[float, float]:
    """The 95% interval of Wilson (1927) of the share of killed mutants."""
    z = 1.96
    centre = (killed + z**2 / 2) / (total + z**2)
    half = z * math.sqrt(killed * (total - killed) / total + z**2 / 4) / (total + z**2)
    return centre - half, centre + half


def draw(paths: list[Path], sample: int, seed: int) -> tuple[list[Mutant], int]:
    """Mutants of the modules in the folders, drawn at random, and the number of all."""
    modules = [
        str(file.resolve().relative_to(ROOT))
        for path in paths
        for file in (sorted(path.rglob("*.py")) if path.is_dir() else [path])
    ]
    places = [place for module in modules for place in places_in(module)]
    random.Random(seed).shuffle(places)
    # Only those drawn are made: making one means parsing its module.
    return list(itertools.islice(filter(None, map(mutant_at, places)), sample or None)), len(places)


class Judge:
    """Runs the tests on mutants, several at a time, each in a copy of the checkout.

    Args:
        folder: For the copies.
        tests: Test files and folders.
        jobs: Number of copies.
    """

    def __init__(self, folder: Path, tests: list[str], jobs: int) -> None:
        self._copies: queue.Queue[Path] = queue.Queue()
        for job in range(jobs):
            self._copies.put(copy_checkout(folder / str(job)))
        files = test_files(tests)
        with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
            self._calls = dict(zip(files, pool.map(self._record, files), strict=True))

    def _record(self, file: str) -> Calls:
        """Runs a test file without a mutation."""
        with self._copy() as copy:
            begun, path = time.monotonic(), copy / "calls.json"
            if run_tests(copy, [file], 3600.0, path) != "survived":
                sys.exit(f"without a mutation a test of {file} fails")
            called = json.loads(path.read_text(encoding="utf-8"))
            return Calls(time.monotonic() - begun, frozenset((module, name) for module, name in called))

    def __call__(self, mutant: Mutant) -> str:
        """Returns "survived", "killed" or "timeout"."""
        tests = tests_of(mutant, self._calls)
        with self._copy() as copy:
            (copy / mutant.module).write_text(mutant.code, encoding="utf-8")
            outcome = run_tests(copy, tests, 4.0 * sum(self._calls[file].seconds for file in tests) + 20.0)
            shutil.copy2(ROOT / mutant.module, copy / mutant.module)
        return outcome

    @contextlib.contextmanager
    def _copy(self) -> Iterator[Path]:
        copy = self._copies.get()
        try:
            yield copy
        finally:
            self._copies.put(copy)


def report(results: list[dict[str, str]], total: int) -> None:
    """Prints the survivors and the share of killed mutants."""
    survivors = [result for result in results if result["outcome"] == "survived"]
    for result in sorted(survivors, key=lambda item: item["module"]):
        print(f"{result['module']} ({result['operator']})\n{result['difference']}\n")
    killed = len(results) - len(survivors)
    if results:
        low, high = wilson_interval(killed, len(results))
        print(f"{killed} of {len(results)} mutants killed ({low:.0%} to {high:.0%}); {total} in all")


def main() -> int:
    """Runs the mutants and reports the survivors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("paths", nargs="+", type=Path, help="modules or folders to mutate")
    parser.add_argument("--tests", nargs="+", required=True, help="tests that must notice")
    parser.add_argument("--sample", type=int, default=100, help="number of mutants, drawn at random; 0: all")
    parser.add_argument("--seed", type=int, default=0, help="for the sample")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="mutants at a time")
    parser.add_argument("--minutes", type=float, default=30.0, help="no mutant is started later than this")
    parser.add_argument("--results", type=Path, default=Path("mutation.jsonl"), help="file of JSON lines")
    options = parser.parse_args()

    mutants, total = draw(options.paths, options.sample, options.seed)
    known = {}
    if options.results.is_file():
        lines = options.results.read_text(encoding="utf-8").splitlines()
        known = {item["key"]: item for item in map(json.loads, lines)}
    results = [known[mutant.key] for mutant in mutants if mutant.key in known]
    end = time.monotonic() + 60.0 * options.minutes
    multiprocessing.get_context("forkserver").set_forkserver_preload(list(_LIBRARIES))
    with (
        tempfile.TemporaryDirectory() as temporary,
        concurrent.futures.ThreadPoolExecutor(options.jobs) as pool,
        options.results.open("a", encoding="utf-8") as file,
    ):
        judge = Judge(Path(temporary), options.tests, options.jobs)

        def result_of(mutant: Mutant) -> dict[str, str] | None:
            if time.monotonic() > end:
                return None
            return {"key": mutant.key, "outcome": judge(mutant), **mutant._replace(code="")._asdict()}

        unknown = [mutant for mutant in mutants if mutant.key not in known]
        try:
            for result in filter(None, pool.map(result_of, unknown)):
                results.append(result)
                print(json.dumps(result), file=file, flush=True)
        finally:
            pool.shutdown(cancel_futures=True)
    report(results, total)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
