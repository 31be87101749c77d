"""Copy the packages, edit the copy, and ask it what its steps' keys, plans and runs are."""

from __future__ import annotations

import ast
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
PACKAGES = ("flows", "tasks", "garden_models", "storage")


class CopiedPackages:
    """A copy of the sources in a folder of its own, and a process that runs from it."""

    def __init__(self, folder: Path, **environment: str) -> None:
        self.folder = folder
        for package in PACKAGES:
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / package, folder / package, ignore=ignored)
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.faults.stand_in"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=folder,
            env=os.environ | {"PYTHONPATH": f"{folder}:{ROOT}"} | environment,
            text=True,
        )

    def ask(self, do: str, **order: Any) -> Any:
        """Return the answer to one order of ``tests.faults.stand_in``."""
        assert self._process.stdin and self._process.stdout
        self._process.stdin.write(json.dumps({"do": do} | order) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        assert answer, f"the process ended with code {self._process.wait()}"
        return json.loads(answer)

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin
        self._process.stdin.close()
        self._process.wait(timeout=60)

    def modules(self) -> dict[str, Path]:
        """Return every module's source file in the copy, by dotted name."""
        found = {}
        for package in PACKAGES:
            for path in sorted((self.folder / package).rglob("*.py")):
                parts = path.relative_to(self.folder).with_suffix("").parts
                found[".".join(p for p in parts if p != "__init__")] = path
        return found

    @contextmanager
    def edited(self, edits: dict[Path, str]) -> Iterator[None]:
        """Put other texts into files of the copy for a while."""
        before = {path: path.read_text("utf-8") for path in edits}
        try:
            for path, text in edits.items():
                path.write_text(text, "utf-8")
            yield
        finally:
            for path, text in before.items():
                path.write_text(text, "utf-8")


def with_a_changed_function(text: str) -> str:
    """Return a module with one statement more in its last function (or below, if it has none)."""
    functions = [n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.FunctionDef)]
    if not functions:
        return f"{text}\n_CHANGED = 0\n"
    last = max(functions, key=lambda function: function.lineno)
    body = last.body[-1]
    lines = text.splitlines()
    if body.lineno == last.lineno:
        return f"{text}\n_CHANGED = 0\n"
    lines.insert(body.lineno - 1, f"{' ' * body.col_offset}_changed = 0")
    return "\n".join(lines) + "\n"


def with_other_words(text: str) -> str:
    """Return a module with all docstrings and comments changed, and more of both, same code."""
    lines = text.splitlines()
    for node in sorted(_documented(ast.parse(text)), key=lambda n: -n.lineno):
        assert node.end_lineno is not None
        indent = " " * node.col_offset
        lines[node.lineno - 1 : node.end_lineno] = [
            f'{indent}"""Something else altogether.',
            "",
            f'{indent}Over several lines."""',
        ]
    return "\n".join(["# a comment at the start", *lines, "", "", "# and one at the end", ""])


def _documented(tree: ast.Module) -> list[ast.Expr]:
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    ]
