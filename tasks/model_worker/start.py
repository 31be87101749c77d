"""Start a worker with any Python: ``PYTHON start.py PARENT '{"garden_models": FOLDER, ...}'``.

A third word names another module whose ``main`` is called in place of the worker's. Only the
packages that are named are found outside of that Python's own environment, so that nothing
that lies beside them gets in.
"""

import importlib
import json
import os
import sys
from importlib.abc import MetaPathFinder
from importlib.machinery import PathFinder

OLDEST = (3, 10)


class NamedPackages(MetaPathFinder):
    """Find some packages, each in the folder that is named for it."""

    def __init__(self, folders):  # type: ignore[no-untyped-def]
        self._folders = folders

    def find_spec(self, name, path=None, target=None):  # type: ignore[no-untyped-def]
        """Return the spec of a named package; others are found as always."""
        if path is None and name in self._folders:
            return PathFinder.find_spec(name, [self._folders[name]], target)
        return None


def main():  # type: ignore[no-untyped-def]
    """Serve."""
    if sys.version_info < OLDEST:
        sys.exit("a model's worker needs Python {}.{} or newer".format(*OLDEST))
    here = os.path.dirname(os.path.abspath(__file__))  # noqa: PTH100, PTH120
    sys.path[:] = [folder for folder in sys.path if os.path.abspath(folder) != here]  # noqa: PTH100
    sys.meta_path.insert(0, NamedPackages(json.loads(sys.argv[2])))
    module = sys.argv[3] if len(sys.argv) > 3 else "tasks.model_worker.serve"
    importlib.import_module(module).main()


if __name__ == "__main__":
    main()
