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
from jaxtyping import Bool, Float, Float32, Int
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

from garden_models.disentanglement.config import Inpainting

Texture = Float32[np.ndarray, "h w c"]
Origin = Int[np.ndarray, "h w 2"]


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
    out = nearest_fill(texture, known)
    hole = hole & ~known
    if hole.any():
        window = _around(hole, config)
        out[window] = _continued(_Level(out[window], known[window], hole[window]), config)
    return out


def _around(hole: Bool[np.ndarray, "h w"], config: Inpainting) -> tuple[slice, slice]:
    """Return rows and columns of the hole and what lies about its own size around it."""
    ranges = []
    for index, length in zip(np.nonzero(hole), hole.shape, strict=True):
        margin = max(int(config.context * np.ptp(index)), 4 * config.patch)
        ranges.append(slice(max(0, index.min() - margin), min(length, index.max() + margin + 1)))
    return ranges[0], ranges[1]


@dataclass(frozen=True)
class _Level:
    """A texture without gaps (nearest colours), what of it is known, and the hole."""

    texture: Texture
    known: Bool[np.ndarray, "h w"]
    hole: Bool[np.ndarray, "h w"]


def _continued(level: _Level, config: Inpainting) -> Texture:
    """Return the texture with the hole filled coarse to fine."""
    levels = [level]
    while min(levels[-1].known.shape) >= 2 * config.coarsest_px:
        levels.append(_halved(levels[-1]))
    levels[-1] = _started(levels[-1], config)
    origin = _identity(levels[-1].known.shape)
    for fineness, one in enumerate(reversed(levels)):
        if fineness:
            origin = _refined(origin, one)
        # Votes find the layout at the coarsest level; finer ones only look for better grain.
        origin = _match_patches(origin, one, 1 if fineness else config.rounds, config)
    return level.texture[origin[..., 0], origin[..., 1]]


def _started(level: _Level, config: Inpainting) -> _Level:
    """Colour the hole by the nearest pixels that do not lie at its very rim.

    The rim is darker than the rest where it was in the shadow of what stood there.
    """
    distance = distance_transform_edt(~level.hole)
    away = level.known & (distance > config.rim_px)
    if not away.any():
        return level
    start = nearest_fill(level.texture, away)
    return _Level(np.where(level.hole[..., None], start, level.texture), level.known, level.hole)


def _identity(shape: tuple[int, ...]) -> Origin:
    """Return every pixel's own (row, column)."""
    return np.moveaxis(np.indices(shape[:2]), 0, -1)


def _refined(origin: Origin, level: _Level) -> Origin:
    """Return where each pixel of a level comes from, given that for the level half its size.

    Copies keep the grain that enlarged colours would lose.
    """
    row, column = np.indices(level.known.shape)
    fine = 2 * origin[row // 2, column // 2] + np.stack([row % 2, column % 2], axis=-1)
    fine = np.minimum(fine, np.array(level.known.shape) - 1)
    usable = level.hole & ~level.hole[fine[..., 0], fine[..., 1]]
    return np.where(usable[..., None], fine, np.stack([row, column], axis=-1))


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


def _match_patches(origin: Origin, level: _Level, rounds: int, config: Inpainting) -> Origin:
    """Improve where the hole's pixels come from, by patches outside of it that are mostly known."""
    size = config.patch
    if min(level.known.shape) <= size or not level.hole.any():
        return origin
    touched = sliding_window_view(level.hole, (size, size)).any(axis=(2, 3))
    share = sliding_window_view(level.known, (size, size)).mean(axis=(2, 3))
    sources = np.argwhere(~touched & (share >= config.least_known))
    if len(sources) < 4 * config.components:
        return origin
    if len(sources) > config.most_sources:
        rng = np.random.default_rng(config.seed)
        sources = sources[np.sort(rng.permutation(len(sources))[: config.most_sources])]
    wanted = np.argwhere(touched)
    trust = _distance_weight(level.hole)
    filled = level.texture[origin[..., 0], origin[..., 1]]
    patches = _patches(filled, sources, size)
    mean = patches.mean(axis=0)
    some = patches[:: max(1, len(patches) // 1000)] - mean
    axes = np.linalg.eigh(some.T @ some)[1][:, -config.components :]
    contrast = float(np.sqrt(((patches - mean) ** 2).sum(axis=1).mean()))
    per_pixel = config.locality * contrast / max(level.known.shape)
    tree = cKDTree(np.hstack([(patches - mean) @ axes, per_pixel * sources]))
    found = sources[:1]
    for turn in range(rounds):
        features = (_patches(filled, wanted, size) - mean) @ axes
        distance, best = tree.query(
            np.hstack([features, per_pixel * wanted]), eps=config.approximation
        )
        found = sources[best]
        if turn < rounds - 1:
            filled = _voted(filled, level.hole, wanted, found, distance, trust, size)
    middle = size // 2
    own = level.hole[wanted[:, 0] + middle, wanted[:, 1] + middle]
    out = origin.copy()
    out[wanted[own, 0] + middle, wanted[own, 1] + middle] = found[own] + middle
    return out


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
