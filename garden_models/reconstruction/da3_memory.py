"""How much GPU memory Depth-Anything-3 needs.

Counted, in numbers of four bytes, from the tensors that are alive at the peak of a run of
da3-small and da3-base on CPU at two picture sizes and 1 to 32 photos, where the law holds to
2 % (``tests/garden_models/reconstruction/test_memory_need.py`` counts again):

- a photo of T tokens (with the class token) of width C and P pixels keeps ``16 T C + 7.5 P``;
- each of the first 8 photos, which the depth head works on at once, takes ``1.3 F P`` more,
  where F is the number of features of that head;
- Gaussians take ``143 P`` more for each photo.

Half precision stores the inside of a block smaller, so that a GPU stays below it.
"""

from __future__ import annotations

from pathlib import Path

from garden_models.reconstruction.da3_network import model_name
from garden_models.reconstruction.da3_photos import PATCH, target_size
from garden_models.reconstruction.geometry_model import GeometryRequest
from garden_models.reconstruction.memory_need import RUNTIME_GB, MemoryNeed, weights_gb

WIDTH_AND_FEATURES = {
    "da3-small": (384, 64),
    "da3-base": (768, 128),
    "da3-large": (1024, 256),
    "da3-giant": (1536, 256),
    "da3nested-giant-large": (1536, 256),
    "da3metric-large": (1024, 256),
    "da3mono-large": (1024, 256),
}
PER_TOKEN, PER_PIXEL, PER_PIXEL_EARLY, PER_PIXEL_GAUSSIANS = 16.0, 7.5, 1.3, 143.0
EARLY = 8


def memory_need(weights: Path, request: GeometryRequest) -> MemoryNeed:
    """Return what a weight folder's network needs for photos like those of the request."""
    sizes = [target_size((photo.shape[1], photo.shape[0])) for photo in request.photos]
    largest = max(sizes, key=lambda size: size[0] * size[1])
    per_photo, per_early = floats(model_name(weights), largest, request.want_gaussians)
    return MemoryNeed(RUNTIME_GB + weights_gb(weights), 4e-9 * per_photo, 4e-9 * per_early, EARLY)


def floats(kind: str, size: tuple[int, int], gaussians: bool) -> tuple[float, float]:
    """Return how many numbers a photo keeps alive, and how many more an early one takes."""
    width, features = WIDTH_AND_FEATURES[kind]
    pixels = size[0] * size[1]
    tokens = pixels // PATCH**2 + 1
    kept = PER_TOKEN * tokens * width + PER_PIXEL * pixels
    if gaussians:
        kept += PER_PIXEL_GAUSSIANS * pixels
    return kept, PER_PIXEL_EARLY * features * pixels
