"""GeoCalib: a photo and its focal length to gravity in its camera.

Its ``gravity.vec3d`` is the direction UP in the OpenCV camera; it is turned here, once. It loads
photos with torchvision, so that it lives in an environment of its own (``deploy/environments``).
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from garden_models.foundation.model_card import ModelCard, Terms, WeightFile
from garden_models.photo_gravity.photo_gravity import (
    PhotoGravity,
    PhotoGravityRequest,
    ReadPhotoGravity,
)
from garden_models.scene import BadInput

WEIGHTS = "geocalib-pinhole.tar"

CARD = ModelCard(
    name="geocalib",
    title="GeoCalib",
    source="https://github.com/cvg/GeoCalib",
    stage="gravity",
    terms=Terms(code="Apache-2.0", weights="CC BY 4.0", commercial=True),
    weights=(WeightFile(WEIGHTS, "of the release v1.0 of cvg/GeoCalib"),),
    imports=("geocalib",),
    install="an environment of its own: deploy/environments/geocalib",
    bfloat16=False,
)


def load(weights: Path, device: str) -> ReadPhotoGravity:
    """Return GeoCalib with the pinhole weights of a folder.

    Raises BadInput if the file or the package is not there.
    """
    file = weights / WEIGHTS
    if not file.is_file():
        raise BadInput(f"GeoCalib needs {file} ({CARD.weights[0].note})")
    try:
        package = importlib.import_module("geocalib")
    except ImportError as error:
        raise BadInput(f"GeoCalib is not installed here ({error}): {CARD.install}") from error
    net = package.GeoCalib(weights=str(file)).to(device).eval()
    return lambda request: read(net, request, device)


def read(net: Any, request: PhotoGravityRequest, device: str) -> PhotoGravity:
    """Return what the network says of every photo, one after the other."""
    import torch

    downs, sigmas = [], []
    for rgb, focal in zip(request.photos, request.focal_px, strict=True):
        image = torch.from_numpy(np.ascontiguousarray(rgb)).permute(2, 0, 1).float() / 255
        with torch.inference_mode():
            # One element: the priors of several are mistaken for a truth value.
            found = net.calibrate(
                image.to(device),
                camera_model="pinhole",
                priors={"focal": torch.tensor(float(focal), device=device)},
            )
        up = found["gravity"].vec3d.reshape(-1, 3)[0].cpu().numpy().astype(np.float64)
        downs.append(-up / np.linalg.norm(up))
        sigmas.append(float(torch.as_tensor(found["gravity_uncertainty"]).reshape(-1)[0]))
    return PhotoGravity(np.array(downs).reshape(-1, 3), np.array(sigmas, dtype=np.float64))
