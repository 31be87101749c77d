"""A model that sees a flat wall in every photo, and takes as long as it says."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path

import numpy as np

from garden_models.reconstruction.geometry_model import (
    GeometryPrediction,
    GeometryRequest,
    GeometryView,
    PredictGeometry,
)
from tests.tasks.model import doubler

CARD = dataclasses.replace(doubler.CARD, name="flat_wall", stage="reconstruct")
LOAD_S, PHOTO_S = 0.3, 0.05


def load(weights: Path, device: str) -> PredictGeometry:
    time.sleep(LOAD_S)
    kept = np.ones(25_000_000)

    def predict(request: GeometryRequest) -> GeometryPrediction:
        time.sleep(PHOTO_S * len(request.photos) * kept[0])
        views = []
        for photo in request.photos:
            depth = np.ones(photo.shape[:2])
            views.append(GeometryView(depth, depth, depth > 0, np.eye(3), np.eye(3, 4)))
        return GeometryPrediction(tuple(views), metric=True)

    return predict
