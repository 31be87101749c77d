"""Give a cloud the errors of our stereo: noise along the ray, holes, smeared edges."""

from __future__ import annotations

import numpy as np

from garden_models.disentanglement.training.augmentations.config import StereoNoise
from garden_models.disentanglement.training.augmentations.thin_parts import smooth_field
from garden_models.disentanglement.training.augmentations.virtual_scan import Scan
from garden_models.disentanglement.training.pair import LabelledCloud

EDGE = 0.05
"""Two surfaces within a pixel whose depths differ by more than this share make an edge."""


def add_stereo_noise(
    cloud: LabelledCloud, seen: Scan, rng: np.random.Generator, config: StereoNoise
) -> LabelledCloud:
    """Return the cloud as our stereo would give it from the cameras of a scan.

    Each point is given by one of the cameras that see it (the nearest, where none does) and
    moves along that camera's ray; some are missing.
    """
    points = cloud.points
    camera = _giver(seen, rng)
    rows = np.arange(len(points))
    depth, near, far = (values[camera, rows] for values in (seen.depth, seen.near, seen.far))
    known = np.isfinite(near) & np.isfinite(far)
    far = np.where(known, far, near)
    at_edge = known & (far > (1 + EDGE) * near)
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    sigma = config.sigma + config.growth * np.maximum(depth / diagonal - 1, -0.5)
    common = smooth_field(points, 0.1 * diagonal, 1, rng)[:, 0]
    own = rng.normal(0, 1, len(points))
    share = config.correlated
    error = sigma * (np.sqrt(share) * common + np.sqrt(1 - share) * own)
    smeared = at_edge & (rng.random(len(points)) < config.smeared)
    span = np.subtract(far, near, out=np.zeros_like(far), where=at_edge)
    between = np.where(at_edge, near, depth) + rng.random(len(points)) * span
    factor = np.where(smeared, between / np.maximum(depth, 1e-9), 1 + error)
    eye = seen.eye[camera]
    moved = eye + (points - eye) * factor[:, None]
    patchy = smooth_field(points, 0.25 * diagonal, 1, rng)[:, 0]
    hole = patchy > np.quantile(patchy, 1 - config.holes)
    hole |= at_edge & (rng.random(len(points)) < config.edge_holes)
    return LabelledCloud(moved, cloud.label).subset(~hole)


def _giver(seen: Scan, rng: np.random.Generator) -> np.ndarray:
    """Return for each point a camera that sees it, at random; the nearest if none does."""
    chance = rng.random(seen.visible.shape) + seen.visible
    return np.where(seen.visible.any(axis=0), chance.argmax(axis=0), seen.depth.argmin(axis=0))
