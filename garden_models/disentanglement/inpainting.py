"""Fill the unknown part of a small texture with what surrounds it, pattern and all.

Coarse to fine, every unknown patch looks for the known patch that is most like it, and the
overlapping finds are blended (Wexler et al. 2007, "Space-time completion of video"), so that
wood grain and weaves go on under the hole. It starts from the nearest known colour: a smooth
start would mix what lies on two sides of the hole into a third material.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

Texture = Float32[np.ndarray, "h w c"]


@dataclass(frozen=True)
class Inpainting:
    """Sizes in pixels of the texture."""

    patch: int = 7
    coarsest_px: int = 24
    """Shorter side of the coarsest level."""
    rounds: int = 4
    components: int = 16
    """Principal components in which patches are compared."""
    locality: float = 0.3
    """Price of looking far away: a patch across the texture is as unlike as one whose pixels
    differ by this share of the texture's contrast."""
    least_known: float = 0.6
    """Share of a source patch that was seen; the rest are gaps of the sampling."""
    most_sources: int = 20_000
    seed: int = 0


def inpaint(
    texture: Float[np.ndarray, "h w c"],
    known: Bool[np.ndarray, "h w"],
    hole: Bool[np.ndarray, "h w"],
    config: Inpainting = Inpainting(),
) -> Texture:
    """Return the texture with unknown pixels filled; known pixels are unchanged.

    ``hole`` marks the unknown pixels that are wanted: they continue the pattern. Other
    unknown ones (gaps of the sampling) get the nearest known colour, as does everything where
    too little is known for patches. Raises ValueError if nothing is known.
    """
    if not known.any():
        raise ValueError("nothing of the texture is known, so there is nothing to fill it from")
    levels = [_Level(nearest_fill(texture, known), known, hole & ~known)]
    while min(levels[-1].known.shape) >= 2 * config.coarsest_px:
        levels.append(_halved(levels[-1]))
    filled = levels[-1].texture
    for level in reversed(levels):
        height, width = level.known.shape
        grown = cv2.resize(filled, (width, height), interpolation=cv2.INTER_LINEAR)
        filled = np.where(level.hole[..., None], grown.reshape(level.texture.shape), level.texture)
        filled = _match_patches(filled, level, config)
    return np.where(known[..., None], texture, filled).astype(np.float32)


@dataclass(frozen=True)
class _Level:
    """A texture without gaps (nearest colours), what of it is known, and the hole."""

    texture: Texture
    known: Bool[np.ndarray, "h w"]
    hole: Bool[np.ndarray, "h w"]


def nearest_fill(texture: Float[np.ndarray, "h w c"], known: Bool[np.ndarray, "h w"]) -> Texture:
    """Return the texture with every unknown pixel coloured as the nearest known ones."""
    # Means of 3x3 known pixels: one odd pixel must not grow into a streak.
    weight = cv2.boxFilter(known.astype(np.float32), -1, (3, 3), normalize=False)
    total = cv2.boxFilter(
        np.where(known[..., None], texture, 0).astype(np.float32), -1, (3, 3), normalize=False
    ).reshape(texture.shape)
    mean = total / np.maximum(weight, 1)[..., None]
    row, column = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.where(known[..., None], texture, mean[row, column]).astype(np.float32)


def _halved(level: _Level) -> _Level:
    """Return a level at half the size; what is known weighs more than what was guessed."""
    size = ((level.known.shape[1] + 1) // 2, (level.known.shape[0] + 1) // 2)
    weight = np.where(level.known, 1.0, 0.01).astype(np.float32)
    share = cv2.resize(weight, size, interpolation=cv2.INTER_AREA)
    total = cv2.resize(level.texture * weight[..., None], size, interpolation=cv2.INTER_AREA)
    total = total.reshape(*share.shape, level.texture.shape[2])
    hole = cv2.resize(level.hole.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    return _Level((total / share[..., None]).astype(np.float32), share >= 0.25, hole > 0.5)


def _match_patches(filled: Texture, level: _Level, config: Inpainting) -> Texture:
    """Refine the hole at one level by the patches outside of it that are mostly known."""
    size = config.patch
    if min(level.known.shape) <= size or not level.hole.any():
        return filled
    touched = sliding_window_view(level.hole, (size, size)).any(axis=(2, 3))
    share = sliding_window_view(level.known, (size, size)).mean(axis=(2, 3))
    sources = np.argwhere(~touched & (share >= config.least_known))
    if len(sources) < 4 * config.components:
        return filled
    if len(sources) > config.most_sources:
        rng = np.random.default_rng(config.seed)
        sources = sources[np.sort(rng.permutation(len(sources))[: config.most_sources])]
    wanted = np.argwhere(touched)
    trust = _distance_weight(level.hole)
    patches = _patches(filled, sources, size)
    mean = patches.mean(axis=0)
    some = patches[:: max(1, len(patches) // 2000)] - mean
    axes = np.linalg.svd(some, full_matrices=False)[2][: config.components].T
    contrast = float(np.sqrt(((patches - mean) ** 2).sum(axis=1).mean()))
    per_pixel = config.locality * contrast / max(level.known.shape)
    tree = cKDTree(np.hstack([(patches - mean) @ axes, per_pixel * sources]))
    for _ in range(config.rounds):
        features = (_patches(filled, wanted, size) - mean) @ axes
        distance, best = tree.query(np.hstack([features, per_pixel * wanted]), workers=-1)
        filled = _voted(filled, level.hole, wanted, sources[best], distance, trust, size)
    return filled


def _patches(texture: Texture, corners: np.ndarray, size: int) -> Float32[np.ndarray, "n p"]:
    """Return flattened patches with the given top left corners."""
    windows = sliding_window_view(texture, (size, size), axis=(0, 1))
    return windows[corners[:, 0], corners[:, 1]].reshape(len(corners), -1)


def _distance_weight(hole: Bool[np.ndarray, "h w"]) -> Float32[np.ndarray, "h w"]:
    """Return how much a pixel is trusted: less the deeper it lies in the hole."""
    deep = cv2.distanceTransform(hole.astype(np.uint8), cv2.DIST_L2, 3)
    return np.asarray(1.3 ** -np.minimum(deep, 60.0), np.float32)


def _voted(
    filled: Texture,
    hole: Bool[np.ndarray, "h w"],
    wanted: np.ndarray,
    found: np.ndarray,
    distance: Float[np.ndarray, " n"],
    trust: Float32[np.ndarray, "h w"],
    size: int,
) -> Texture:
    """Blend what the found patches propose for every unknown pixel."""
    height, width, channels = filled.shape
    scale = max(float(np.percentile(distance, 75)), 1e-6)
    middle = size // 2
    vote = (
        np.exp(-((distance / scale) ** 2) / 2) * trust[wanted[:, 0] + middle, wanted[:, 1] + middle]
    )
    total = np.zeros((height * width, channels))
    weights = np.zeros(height * width)
    for dy in range(size):
        for dx in range(size):
            target = (wanted[:, 0] + dy) * width + wanted[:, 1] + dx
            proposal = filled[found[:, 0] + dy, found[:, 1] + dx]
            weights += np.bincount(target, vote, height * width)
            for c in range(channels):
                total[:, c] += np.bincount(target, vote * proposal[:, c], height * width)
    blended = (total / np.maximum(weights, 1e-12)[:, None]).reshape(filled.shape)
    use = hole & (weights.reshape(height, width) > 0)
    return np.where(use[..., None], blended, filled).astype(np.float32)
