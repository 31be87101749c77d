"""Find a boxed object's pixels in every photo. Seconds a target, CPU.

Geometry first (what stands on its support inside the box), carried to all views and
refined in the image. What rivals' boxes hold too is divided between the targets.
Degraded when nothing carries the object or the evidence is weak.
"""

from __future__ import annotations

from garden_models.progress import Progress, silent
from garden_models.scene import GravityView, ObjectMasks, Reconstruction, Rivals, Target
from garden_models.segmentation.config import Segment
from tasks.step import step


@step(version=1, packages=("numpy", "opencv-python-headless", "scipy"))
def segment(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    target: Target,
    rivals: Rivals,
    config: Segment,
    progress: Progress = silent,
) -> ObjectMasks:
    """Return the target's masks, its points and what it stands on."""
    from garden_models.segmentation.geometric import segment as run

    return run(reconstruction, gravity_view, target, rivals, config, progress)
