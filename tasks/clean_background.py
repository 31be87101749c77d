"""Take the objects' points out of the scene and fill the holes they leave. Seconds, CPU."""

from __future__ import annotations

from garden_models.disentanglement.config import CleanBackground
from garden_models.progress import Progress, silent
from garden_models.scene import (
    Background,
    GravityView,
    ObjectMasks,
    PointLabels,
    Reconstruction,
)
from tasks.step import step


@step(version=1, packages=("numpy", "scipy", "opencv-python-headless", "trimesh"))
def clean_background(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    labels: tuple[PointLabels, ...],
    masks: tuple[ObjectMasks, ...],
    config: CleanBackground,
    progress: Progress = silent,
) -> Background:
    """Return the background points in Gravity-View."""
    from garden_models.disentanglement.fill import clean_background as run

    return run(reconstruction, gravity_view, labels, masks, config, progress)
