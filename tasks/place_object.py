"""Place a mesh upright in the scene by render-and-compare (paper, section 3.2). Seconds, CPU.

Degraded when even the best hypothesis explains the photos poorly.
"""

from __future__ import annotations

from garden_models.placement.config import PlaceObject
from garden_models.progress import Progress, silent
from garden_models.scene import GravityView, ObjectMasks, ObjectMesh, Placement, Reconstruction
from tasks.step import step


@step(
    version=1,
    packages=("numpy", "scipy", "torch", "opencv-python-headless", "embreex"),
    memory_gb=1.5,
)
def place_object(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    masks: ObjectMasks,
    mesh: ObjectMesh,
    config: PlaceObject,
    progress: Progress = silent,
) -> Placement:
    """Return every hypothesis with its scores, and the one the gate picked and why."""
    from garden_models.placement.place import place

    return place(reconstruction, gravity_view, masks, mesh, config, progress)
