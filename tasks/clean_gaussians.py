"""Take the objects' Gaussians out of the predicted ones. Seconds, CPU."""

from __future__ import annotations

from garden_models.disentanglement.clean_gaussians_config import CleanGaussians
from garden_models.progress import Progress, silent
from garden_models.reconstruction.geometry_model import Gaussians, GeometryPrediction
from garden_models.scene import GravityView, PointLabels, Reconstruction
from tasks.step import step


@step(version=1, packages=("numpy", "scipy"), memory_gb=3.0)
def clean_gaussians(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    prediction: GeometryPrediction,
    labels: tuple[PointLabels, ...],
    config: CleanGaussians,
    progress: Progress = silent,
) -> Gaussians:
    """Return the Gaussians of the background in Gravity-View."""
    from garden_models.disentanglement.clean_gaussians import clean_gaussians as run

    return run(reconstruction, gravity_view, prediction, labels, config)
