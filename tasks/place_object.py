"""Place a mesh in the scene (paper, section 3.2): by render-and-compare alone, or with
FoundationPose's poses in the same gate. Seconds a target, CPU or GPU.

Degraded when even the best hypothesis explains the photos poorly or leans, or when the
model's poses do not fit.
"""

from __future__ import annotations

from garden_models.placement.config import PlaceObject
from garden_models.progress import Progress, silent
from garden_models.scene import GravityView, ObjectMasks, ObjectMesh, Placement, Reconstruction
from tasks.model import backend_of, predictor, weights_of
from tasks.step import step

EMBEDDED = "render_and_compare"


def _backend(config: PlaceObject, **_others: object) -> str:
    return "embedded" if config.method == EMBEDDED else backend_of(config.method)


def _weights(config: PlaceObject, **_others: object) -> dict[str, str]:
    return {} if config.method == EMBEDDED else weights_of(config.method)


@step(
    version=1,
    packages=("numpy", "scipy", "torch", "opencv-python-headless", "embreex"),
    backend=_backend,
    weights=_weights,
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

    scene = reconstruction, gravity_view
    if config.method == EMBEDDED:
        return place(*scene, masks, mesh, config, progress)
    with predictor(config.method, progress) as estimate:
        return place(*scene, masks, mesh, config, progress, estimate)
