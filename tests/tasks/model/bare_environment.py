"""Make a Python environment with numpy and jaxtyping only, from what is installed here."""

from __future__ import annotations

import importlib.util
import sys
import venv
from pathlib import Path

PACKAGES = ("numpy", "jaxtyping", "wadler_lindig")


def bare_environment(folder: Path) -> Path:
    """Return the interpreter of a new environment in ``folder``."""
    venv.create(folder, with_pip=False, symlinks=True)
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    site = folder / "lib" / version / "site-packages"
    for name in PACKAGES:
        spec = importlib.util.find_spec(name)
        assert spec is not None and spec.origin is not None
        package = Path(spec.origin).parent
        (site / name).symlink_to(package)
        libraries = package.parent / f"{name}.libs"
        if libraries.is_dir():
            (site / libraries.name).symlink_to(libraries)
        for info in package.parent.glob(f"{name}-*.dist-info"):
            (site / info.name).symlink_to(info)
    return folder / "bin" / "python"
