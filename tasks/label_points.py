"""Tell which scene points are the object's (paper, section 3.3). Seconds, CPU."""

from __future__ import annotations

from pathlib import Path

from garden_models.disentanglement.config import LabelPoints
from garden_models.disentanglement.network.shipped import DIGEST
from garden_models.disentanglement.protocol import TRAINED
from garden_models.progress import Progress, silent
from garden_models.scene import (
    BadInput,
    GravityView,
    ObjectMasks,
    ObjectMesh,
    Placement,
    PointLabels,
    Reconstruction,
)
from tasks.step import step


def _weights(config: LabelPoints, **_others: object) -> dict[str, str | Path]:
    """Return the checkpoint that the method reads: its content is part of the key."""
    if config.method not in TRAINED:
        return {}
    if config.weights:
        path = Path(config.weights)
        if not path.is_file():
            raise BadInput(f"no such checkpoint of a point classifier: {path}")
        return {"point_classifier": path}
    return {"point_classifier": DIGEST}


@step(
    version=1,
    packages=("numpy", "scipy", "trimesh", "torch", "safetensors"),
    weights=_weights,
    skip=("config.weights",),
)
def label_points(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    masks: ObjectMasks,
    mesh: ObjectMesh,
    placement: Placement,
    config: LabelPoints,
    progress: Progress = silent,
) -> PointLabels:
    """Return each scene point's probability of being part of the object."""
    from garden_models.disentanglement.label import label_points as run

    return run(reconstruction, gravity_view, masks, mesh, placement, config, progress)
