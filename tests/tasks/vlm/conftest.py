from __future__ import annotations

import numpy as np
import pytest

from garden_models.scene import Capture, Photo
from garden_models.targets.config import ProposeTargets

SIZE = (2000, 1000)
"""(width, height) of the photos' files; they are taken in at half of it."""


@pytest.fixture
def config(vlm_config: ProposeTargets) -> ProposeTargets:
    return vlm_config


@pytest.fixture
def capture() -> Capture:
    rng = np.random.default_rng(0)
    names = ("IMG_1.jpg", "IMG_2.jpg", "IMG_3.jpg")
    return Capture(
        tuple(
            Photo(name, rng.integers(0, 256, (500, 1000, 3)).astype(np.uint8), SIZE)
            for name in names
        )
    )
