"""Find a boxed object's pixels in every photo. Seconds a target, CPU or GPU.

Geometry first (what stands on its support inside the box), carried to all views and
refined in the image; or a model that is asked with boxes (SAM-3, SAM-2), its mask carried to
all views by geometry. What rivals' boxes hold too is divided between the targets.
Degraded when nothing carries the object, the evidence is weak, or model and geometry disagree.
"""

from __future__ import annotations

from garden_models.progress import Progress, silent
from garden_models.scene import GravityView, ObjectMasks, Reconstruction, Rivals, Target
from garden_models.segmentation.config import Segment
from tasks.model import backend_of, predictor, weights_of
from tasks.step import step

EMBEDDED = "geometric"


def _backend(config: Segment, **_others: object) -> str:
    return "embedded" if config.method == EMBEDDED else backend_of(config.method)


def _weights(config: Segment, **_others: object) -> dict[str, str]:
    return {} if config.method == EMBEDDED else weights_of(config.method)


@step(
    version=1,
    packages=("numpy", "opencv-python-headless", "scipy"),
    backend=_backend,
    weights=_weights,
)
def segment(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    target: Target,
    rivals: Rivals,
    config: Segment,
    progress: Progress = silent,
) -> ObjectMasks:
    """Return the target's masks, its points and what it stands on."""
    scene = reconstruction, gravity_view
    if config.method == EMBEDDED:
        from garden_models.segmentation.geometric import segment as run

        return run(*scene, target, rivals, config, progress)
    from garden_models.segmentation.promptable import segment_by_model

    with predictor(config.method, progress) as predict:
        return segment_by_model(*scene, target, predict, rivals, config, progress)
