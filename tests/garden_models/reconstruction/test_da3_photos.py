"""Photos are prepared as Depth-Anything-3's own code prepares them."""

from __future__ import annotations

import importlib
import sys
from types import ModuleType

import numpy as np
import pytest
import torch

from garden_models.reconstruction.da3_photos import MEAN, STD, prepare


def test_long_side_504_both_multiples_of_14_imagenet_statistics():
    grey = np.full((300, 400, 3), 255, np.uint8)
    found, _ = prepare([grey, np.full((600, 800, 3), 255, np.uint8)])
    assert found.shape == (2, 3, 378, 504) and found.dtype == np.float32
    np.testing.assert_allclose(found[1, :, 5, 5], (1 - MEAN) / STD, rtol=1e-5)
    tall, _ = prepare([np.zeros((400, 300, 3), np.uint8), grey])
    assert tall.shape == (2, 3, 378, 378)


class ToTensor:
    def __call__(self, image):
        return torch.from_numpy(np.array(image)).permute(2, 0, 1).float() / 255


class Normalize:
    def __init__(self, mean, std):
        self.mean, self.std = (torch.tensor(v)[:, None, None] for v in (mean, std))

    def __call__(self, image):
        return (image - self.mean) / self.std


class CenterCrop:
    def __init__(self, size):
        self.size = size

    def __call__(self, image):
        height, width = image.shape[-2:]
        top, left = round((height - self.size[0]) / 2), round((width - self.size[1]) / 2)
        return image[..., top : top + self.size[0], left : left + self.size[1]]


@pytest.fixture
def own_processor(monkeypatch):
    """The model's own code, with the three transforms that it takes from torchvision."""
    pytest.importorskip("depth_anything_3")
    transforms = ModuleType("torchvision.transforms")
    for transform in (ToTensor, Normalize, CenterCrop):
        setattr(transforms, transform.__name__, transform)
    package = ModuleType("torchvision")
    package.transforms = transforms
    monkeypatch.setitem(sys.modules, "torchvision", package)
    monkeypatch.setitem(sys.modules, "torchvision.transforms", transforms)
    name = "depth_anything_3.utils.io.input_processor"
    yield importlib.import_module(name).InputProcessor()
    sys.modules.pop(name)


@pytest.mark.parametrize(
    "sizes",
    [[(400, 300)], [(300, 400), (1000, 700)], [(1037, 611)], [(505, 497), (503, 210)], [(90, 70)]],
)
def test_they_are_the_same_pixels(sizes, own_processor):
    rng = np.random.default_rng(0)
    photos = [rng.integers(0, 255, (h, w, 3), dtype=np.uint8) for w, h in sizes]
    K = np.stack([np.array([[300.0, 0, w / 3], [0, 310, h / 2], [0, 0, 1]]) for w, h in sizes])
    own, _, own_K = own_processor(photos, None, K, 504, "upper_bound_resize", num_workers=1)
    ours, framings = prepare(photos)
    np.testing.assert_allclose(own.numpy(), ours, atol=2e-6)
    found = [framing.model_intrinsics(k) for framing, k in zip(framings, K, strict=True)]
    np.testing.assert_allclose(np.stack(found), own_K.numpy(), rtol=1e-6)
