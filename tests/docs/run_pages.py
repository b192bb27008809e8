"""Runs the code blocks of pages, all in one process, each page in a folder and a namespace of its own.

Usage: run_pages.py FOLDER RESULT.json [PAGE...]. See `pages` for what is run. A block that fails ends its
page; the result names page, line and traceback.
"""

from __future__ import annotations

import contextlib
import json
import runpy
import shlex
import sys
import time
import tomllib
import traceback
from pathlib import Path
from typing import Any

import pages
import yaml


def main() -> None:
    folder, result = Path(sys.argv[1]), Path(sys.argv[2])
    chosen = [Path(name) for name in sys.argv[3:]] or pages.pages()
    outcome = {}
    for page in chosen:
        name = str(page.relative_to(pages.ROOT))
        own = folder / name.replace("/", "_").removesuffix(".md")
        own.mkdir(parents=True)
        begun = time.perf_counter()
        failure = run_page(page, own)
        outcome[name] = {"failure": failure, "seconds": round(time.perf_counter() - begun, 1)}
    result.write_text(json.dumps(outcome, indent=1))


def run_page(page: Path, folder: Path) -> str | None:
    """Returns what failed, or None."""
    # Spawned processes import the main module by this name, and so must not run the pages again.
    names: dict[str, Any] = {"__name__": "__page__"}
    modules = set(sys.modules)
    sys.path.insert(0, str(folder))
    try:
        with contextlib.chdir(folder):
            for block in pages.blocks(page):
                try:
                    run_block(block, names, page)
                except BaseException:  # A page must not end the others, not even by SystemExit.
                    return f"{page}:{block.line}\n{traceback.format_exc()}"
    finally:
        sys.path.remove(str(folder))
        for name in set(sys.modules) - modules:
            file = getattr(sys.modules[name], "__file__", None) or ""
            if file.startswith(str(folder)):
                del sys.modules[name]
    return None


def run_block(block: pages.Block, names: dict[str, Any], page: Path) -> None:
    if block.action == "skip" or block.language not in pages.CODE:
        return
    if block.action in ("file", "example"):
        Path(block.detail).write_text(block.code, encoding="utf-8")
    if block.language == "yaml":
        yaml.compose(block.code)
    elif block.language == "toml":
        install_entry_points(tomllib.loads(block.code))
    elif block.language == "sh":
        for command in shell_commands(block.code):
            run_command(command, block)
    elif not block.action:
        # Blank lines keep the line numbers of the page in tracebacks.
        exec(compile("\n" * block.line + block.code, str(page), "exec"), names)


def shell_commands(code: str) -> list[list[str]]:
    """The words of each command, without comments."""
    lines = code.replace("\\\n", " ").splitlines()
    return [words for line in lines if (words := shlex.split(line, comments=True))]


def run_command(words: list[str], block: pages.Block) -> None:
    from drake_shared.cli.main import main, parse

    extra = shlex.split(block.detail) if block.action == "extra" else []
    program, *arguments = words
    if program == "drake-shared" and block.action == "parse":
        parse(arguments)
    elif program == "drake-shared":
        try:
            status = main([*expand(arguments), *extra])
        except SystemExit as stopped:
            status = stopped.code or 0
        if status:
            raise RuntimeError(f"{shlex.join(words)} ended with status {status}")
    elif program == "python":
        run_program([*arguments, *extra])
    else:
        raise RuntimeError(f"{program}: not run by the tests; mark the block with a reason")


def run_program(arguments: list[str]) -> None:
    """Runs a Python file as a program in this process, in which the package is already imported."""
    given = sys.argv
    sys.argv = arguments
    try:
        runpy.run_path(arguments[0], run_name="__main__")
    finally:
        sys.argv = given


def expand(arguments: list[str]) -> list[str]:
    """Replaces patterns by the files that they match, as a shell does."""
    expanded = []
    for argument in arguments:
        found = sorted(map(str, Path().glob(argument))) if "*" in argument else []
        expanded += found or [argument]
    return expanded


def install_entry_points(project: dict[str, Any]) -> None:
    """Makes the entry points of a pyproject.toml visible in this process, as installing its package would."""
    groups = project["project"].get("entry-points", {})
    folder = Path(f"{project['project']['name'].replace('-', '_')}-1.0.dist-info")
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: page\nVersion: 1.0\n")
    lines = []
    for group, points in groups.items():
        lines += [f"[{group}]", *(f"{name} = {place}" for name, place in points.items())]
    (folder / "entry_points.txt").write_text("\n".join(lines))


if __name__ == "__main__":
    main()
