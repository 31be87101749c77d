"""Apply the augmentations that are switched on, in the order in which scans go wrong."""

from __future__ import annotations

import numpy as np

from garden_models.disentanglement.training.augmentations.config import NAMES, Augmentations
from garden_models.disentanglement.training.augmentations.ghosting import add_ghosts
from garden_models.disentanglement.training.augmentations.mesh_jitter import jitter_mesh
from garden_models.disentanglement.training.augmentations.stereo_noise import add_stereo_noise
from garden_models.disentanglement.training.augmentations.thin_parts import deform_thin_parts
from garden_models.disentanglement.training.augmentations.virtual_scan import Scan, keep_seen, scan
from garden_models.disentanglement.training.pair import Condition, LabelledCloud


def augment(
    cloud: LabelledCloud,
    condition: Condition,
    rng: np.random.Generator,
    config: Augmentations,
) -> tuple[LabelledCloud, Condition]:
    """Return cloud and condition with the artifacts of a real reconstruction."""
    unit = config.unit(condition.size)
    voxel = config.voxel_m * unit
    drawn = dict(zip(NAMES, rng.random(len(NAMES)) < config.each, strict=True))
    on = {name: drawn[name] and getattr(config, name).on for name in NAMES}
    if on["thin_parts"]:
        cloud = deform_thin_parts(cloud, rng, config.thin_parts, voxel)
    if on["virtual_scan"] or on["stereo_noise"]:
        seen = scan(cloud.points, rng, config.virtual_scan)
        if on["virtual_scan"]:
            kept = keep_seen(cloud, seen, rng, config.virtual_scan)
            cloud, seen = cloud.subset(kept), _subset(seen, kept)
        if on["stereo_noise"]:
            cloud = add_stereo_noise(cloud, seen, rng, config.stereo_noise)
    if on["ghosting"]:
        cloud = add_ghosts(cloud, rng, config.ghosting, voxel)
    if on["mesh_jitter"]:
        condition = jitter_mesh(condition, rng, config.mesh_jitter, unit)
    return cloud, condition


def _subset(seen: Scan, kept: np.ndarray) -> Scan:
    return Scan(
        seen.eye, seen.visible[:, kept], seen.depth[:, kept], seen.near[:, kept], seen.far[:, kept]
    )
