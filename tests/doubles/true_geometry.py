"""A geometry model for whole runs: its weights are a scene's truth, its adapter is the real one.

``put_truth`` writes its weight folder; register it as
``ADAPTERS["depth_anything_3"] = "tests.doubles.true_geometry"``.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from garden_models.foundation.model_card import WeightFile
from garden_models.reconstruction import depth_anything_3
from garden_models.reconstruction.geometry_model import GeometryRequest, PredictGeometry
from garden_models.reconstruction.memory_need import RUNTIME_GB, MemoryNeed
from tests.doubles.depth_anything_3 import da3_double
from tests.doubles.true_views import TrueViews

CARD = replace(
    depth_anything_3.CARD,
    weights=(WeightFile("truth.npz"), WeightFile("options.json")),
    imports=("numpy",),
    variant_key="",
)


def load(weights: Path, device: str) -> PredictGeometry:
    """Answer through the real adapter, by a network that knows the truth."""
    network = da3_double(read_truth(weights), **json.loads((weights / "options.json").read_text()))
    return lambda request: depth_anything_3.predict(network, request)


def memory_need(weights: Path, request: GeometryRequest) -> MemoryNeed:
    """A tenth of a gigabyte a photo."""
    return MemoryNeed(RUNTIME_GB, 0.1)


def put_truth(folder: Path, truth: TrueViews, **options: object) -> None:
    """Write the weight folder; ``options`` are those of ``da3_double``."""
    folder.mkdir(parents=True, exist_ok=True)
    arrays = {f"photo{i}": p for i, p in enumerate(truth.photos)}
    arrays |= {f"depth{i}": d for i, d in enumerate(truth.depth)}
    np.savez(folder / "truth.npz", K=truth.K, camera_from_world=truth.camera_from_world, **arrays)
    (folder / "options.json").write_text(json.dumps(options))


def read_truth(folder: Path) -> TrueViews:
    """Read what ``put_truth`` wrote."""
    with np.load(folder / "truth.npz") as held:
        count = len(held["K"])
        return TrueViews(
            tuple(held[f"photo{i}"] for i in range(count)),
            tuple(held[f"depth{i}"] for i in range(count)),
            held["K"],
            held["camera_from_world"],
        )
