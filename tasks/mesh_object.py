"""Build an object's closed mesh from its masked views. Seconds a target, CPU.

Degraded when little of the surface was seen.
"""

from __future__ import annotations

from garden_models.meshing.config import MeshObject
from garden_models.progress import Progress, silent
from garden_models.scene import GravityView, ObjectMasks, ObjectMesh, Reconstruction
from tasks.step import step


@step(
    version=1,
    packages=(
        "numpy",
        "scipy",
        "scikit-image",
        "torch",
        "opencv-python-headless",
        "embreex",
        "fast-simplification",
    ),
    cores="all",
    memory_gb=1.5,
)
def mesh_object(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    masks: ObjectMasks,
    config: MeshObject,
    progress: Progress = silent,
) -> ObjectMesh:
    """Return the mesh in the upright object frame."""
    from garden_models.meshing.reconstruct import mesh_object as run

    return run(reconstruction, gravity_view, masks, config, progress)
