"""Find the targets whose boxes hold some of the same points. Seconds a target, CPU.

Segmenting a target depends on its rivals only, so a changed box reruns nothing else.
"""

from __future__ import annotations

from garden_models.progress import Progress, silent
from garden_models.scene import GravityView, Reconstruction, Rivals, Target
from garden_models.segmentation.config import Segment
from tasks.step import step


@step(version=1, packages=("numpy", "scipy", "opencv-python-headless"))
def find_rivals(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    target: Target,
    others: tuple[Target, ...],
    config: Segment,
    progress: Progress = silent,
) -> Rivals:
    """Return those of the other targets that may claim the same points."""
    from garden_models.segmentation.rivals import find_rivals as run

    return run(reconstruction, gravity_view, target, others, config, progress)
