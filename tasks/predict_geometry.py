"""Predict cameras and depth of all photos by a model (paper, section 3.1). Seconds, GPU.

Long captures are predicted in chunks that fit the stated memory; the verdict says what came
of it. The prediction stays in the store as it is: cameras, points and gravity are read of it.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from garden_models import foundation
from garden_models.progress import Progress, silent
from garden_models.reconstruction.geometry_model import GeometryPrediction, GeometryRequest
from garden_models.reconstruction.memory_need import MemoryNeed
from garden_models.reconstruction.photo_geometry_config import PhotoGeometry
from garden_models.scene import BadInput, Capture
from tasks.model import backend_of, predictor, weights_of
from tasks.model.settings import model_settings
from tasks.step import step


def _model(config: PhotoGeometry) -> str:
    """Return the model's name; raise BadInput if it is none that predicts geometry."""
    if foundation.card(config.method).stage != "reconstruct":
        raise BadInput(f"{config.method} does not predict geometry: choose another method")
    return config.method


def _backend(config: PhotoGeometry, **_others: object) -> str:
    return backend_of(_model(config))


def _weights(config: PhotoGeometry, **_others: object) -> dict[str, str | Path]:
    return dict(weights_of(_model(config)))


@step(
    version=1,
    packages=("torch", "numpy", "opencv-python-headless", "pillow"),
    backend=_backend,
    weights=_weights,
    memory_gb=4.0,
)
def predict_geometry(
    capture: Capture, config: PhotoGeometry, progress: Progress = silent
) -> GeometryPrediction:
    """Return the model's answer for the photos that can be used, in their order."""
    from garden_models.reconstruction.photo_geometry import predict_geometry as run

    adapter = import_module(foundation.ADAPTERS[_model(config)])
    folder = model_settings(config.method).weights

    def need(request: GeometryRequest) -> MemoryNeed:
        found: MemoryNeed = adapter.memory_need(folder, request)
        return found

    with predictor(config.method, progress) as predict:
        return run(capture, predict, need, config, progress)
