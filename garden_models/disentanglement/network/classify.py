"""Label a crop with the trained network: what it is given is place and mesh alone."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np
from jaxtyping import Float

from garden_models.disentanglement.network.checkpoint import Checkpoint, load_checkpoint
from garden_models.disentanglement.network.predict import predict
from garden_models.disentanglement.network.shipped import DIGEST, checkpoint_file
from garden_models.disentanglement.protocol import Crop, PlacedMesh
from garden_models.disentanglement.training.pair import Condition
from garden_models.disentanglement.triangles import sample_triangles
from garden_models.progress import Progress, silent
from garden_models.scene import BadInput

SAMPLES = 2048
SIZES_M = (0.01, 10.0)
"""Longest extents of objects that can be meant in metres; the network saw 0.03 to 3 m."""


def classify(crop: Crop, progress: Progress = silent, weights: str = "") -> Float[np.ndarray, " n"]:
    """Return each point's probability of being part of the object.

    ``weights`` is a checkpoint's path; the shipped one if empty. Raises BadInput if there is
    none, or it does not fit, for input that is not finite and for sizes that cannot be metres.
    """
    checkpoint = load(weights)
    condition = condition_of(crop.mesh)
    return predict(checkpoint.model, crop.points_gv.xyz, condition, progress=progress)


def load(weights: str = "") -> Checkpoint:
    """Return a checkpoint by path, or the shipped one, verified by its digest."""
    if weights:
        path = Path(weights)
        return _loaded(path, path.stat().st_mtime_ns if path.is_file() else 0, "")
    shipped = checkpoint_file()
    if shipped is None:
        raise BadInput(
            "no point classifier is shipped: train one (`garden train point-classifier`) and "
            "give it with --set disentangle.weights=FILE"
        )
    return _loaded(shipped, shipped.stat().st_mtime_ns if shipped.is_file() else 0, DIGEST)


@functools.lru_cache(maxsize=2)
def _loaded(path: Path, changed: int, digest: str) -> Checkpoint:
    """Read a checkpoint once for each time that its file changed."""
    return load_checkpoint(path, digest)


def condition_of(mesh: PlacedMesh) -> Condition:
    """Return samples of a placed mesh, the same for the same mesh.

    Raises BadInput for a mesh that has no surface, is not finite, or is of a size that is not
    in metres.
    """
    if not np.isfinite(mesh.vertices_gv).all():
        raise BadInput("the object mesh has coordinates that are not finite: mesh it again")
    corners = np.asarray(mesh.vertices_gv, np.float64)[mesh.faces]
    if not len(corners) or not np.ptp(corners, axis=(0, 1)).max() > 0:
        raise BadInput("the object mesh has no surface: mesh it again")
    size = float(np.ptp(corners, axis=(0, 1)).max())
    if not SIZES_M[0] <= size <= SIZES_M[1]:
        raise BadInput(
            f"the object is {size:g} m long, which the point classifier never saw (0.03 to 3 m): "
            "is the scene in metres? Give cameras or a length with the right scale"
        )
    points, which = sample_triangles(corners, SAMPLES, np.random.default_rng(0))
    return Condition(points, which, corners)
