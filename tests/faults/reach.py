"""Find which modules each step reaches, by another way than the keys do.

Import statements are followed by grimp (import-linter's graph). To these come the packages
around each module, modules that a string names, and, where a module imports its
neighbours by names made at run time, all of these.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

import grimp

COUNTED = ("garden_models", "tasks", "storage")


class Reach:
    """The import graph of the sources in a folder that is on ``sys.path``."""

    def __init__(self, sources: dict[str, Path]) -> None:
        self._sources = sources
        self._graph = grimp.build_graph(*COUNTED, include_external_packages=True, cache_dir=None)

    def of(self, module: str) -> set[str]:
        """Return all first-party modules whose code can run in a step of ``module``."""
        reached: set[str] = set()
        waiting = [module]
        while waiting:
            name = waiting.pop()
            if name in reached or name not in self._sources or not counts(name):
                continue
            reached.add(name)
            waiting += self._graph.find_modules_directly_imported_by(name)
            waiting += self._named_by_texts(name)
            waiting.append(name.rpartition(".")[0])
        return reached

    def libraries(self, modules: set[str]) -> set[str]:
        """Return the third-party packages that any of the modules imports."""
        imported: set[str] = set()
        for name in modules:
            imported |= self._graph.find_modules_directly_imported_by(name)
        return {name.partition(".")[0] for name in imported} - set(COUNTED)

    def _named_by_texts(self, name: str) -> set[str]:
        text = self._sources[name].read_text("utf-8")
        dotted = set(re.findall(r"[\"']([a-z_]\w*(?:\.\w+)+)(?::\w+)?[\"']", text))
        if imports_by_made_up_names(text):
            dotted |= {m for m in self._sources if m.rpartition(".")[0] == name}
        return dotted & self._sources.keys()


def counts(module: str) -> bool:
    """Tell whether a module can change a result: the step shell and the store only keep it, and
    what runs models, with their registry, is counted with the model that a step names.
    """
    package, _, rest = module.partition(".")
    if module == "garden_models.foundation":
        return False
    if package == "tasks":
        return rest.partition(".")[0] not in ("step", "model", "model_worker")
    return package == "garden_models" or rest.startswith("formats")


def imports_by_made_up_names(text: str) -> bool:
    """Tell whether a module imports others whose names it puts together when it runs."""
    return any(
        isinstance(node, ast.Call)
        and ast.unparse(node.func).endswith("import_module")
        and isinstance(node.args[0], ast.JoinedStr | ast.BinOp)
        for node in ast.walk(ast.parse(text))
    )
