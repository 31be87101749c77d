"""Tell which scene points are the object's (paper, section 3.3). Seconds, CPU."""

from __future__ import annotations

from garden_models.disentanglement.config import LabelPoints
from garden_models.progress import Progress, silent
from garden_models.scene import (
    GravityView,
    ObjectMasks,
    ObjectMesh,
    Placement,
    PointLabels,
    Reconstruction,
)
from tasks.step import step


@step(version=1, packages=("numpy", "scipy", "trimesh"))
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
