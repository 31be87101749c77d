"""Turn a reconstruction upright (paper, section 3.1). Seconds, CPU.

Degraded when the cues disagree or only a weak one stands.
"""

from __future__ import annotations

from garden_models.gravity.config import AlignGravity
from garden_models.progress import Progress, silent
from garden_models.scene import GravityView, Reconstruction
from tasks.step import step


@step(
    version=1,
    packages=("numpy", "opencv-python-headless", "scipy"),
    modules=("garden_models.gravity",),  # methods are imported by their names
)
def align_gravity(
    reconstruction: Reconstruction, config: AlignGravity, progress: Progress = silent
) -> GravityView:
    """Return the Gravity-View frame with every cue's evidence."""
    from garden_models.gravity.align import align_gravity as run

    return run(reconstruction, config, progress)
