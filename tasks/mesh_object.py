"""Build an object's closed mesh: fused from its masked views, or completed by a model from
the best of them (SAM-3D Objects). Seconds a target on a CPU, the model a minute on a GPU.

Degraded when little of the surface was seen, or the model's own pose contradicts the photo.
"""

from __future__ import annotations

from garden_models.meshing.config import MeshObject
from garden_models.progress import Progress, silent
from garden_models.scene import GravityView, ObjectMasks, ObjectMesh, Reconstruction
from tasks.model import backend_of, predictor, weights_of
from tasks.step import step

EMBEDDED = "fusion"


def _backend(config: MeshObject, **_others: object) -> str:
    return "embedded" if config.method == EMBEDDED else backend_of(config.method)


def _weights(config: MeshObject, **_others: object) -> dict[str, str]:
    return {} if config.method == EMBEDDED else weights_of(config.method)


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
    backend=_backend,
    weights=_weights,
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
    if config.method == EMBEDDED:
        from garden_models.meshing.reconstruct import mesh_object as run

        return run(reconstruction, gravity_view, masks, config, progress)
    from garden_models.meshing.completed_mesh import complete_mesh

    with predictor(config.method, progress) as predict:
        return complete_mesh(reconstruction, gravity_view, masks, predict, config, progress)
