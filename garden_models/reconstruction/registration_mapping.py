"""Run COLMAP's mappers on verified matches: one rung of the ladder of settings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pycolmap

from garden_models.reconstruction.registration_matching import Look

# COLMAP reports a rung that finds nothing as an error on standard error; the ladder's
# attempts say it better.
pycolmap.logging.minloglevel = pycolmap.logging.Level.FATAL.value


@dataclass(frozen=True)
class Rung:
    """One setting of features and mapper; later rungs accept weaker evidence.

    The first pair must have ``start_inliers`` matches and a triangulation angle of
    ``start_angle_deg``, and may move forward at most ``start_forward`` (1 = straight
    ahead); a further photo needs ``pose_inliers`` points that it sees again.
    """

    name: str
    look: Look
    mapper: Literal["incremental", "global"] = "incremental"
    start_inliers: int = 100
    start_angle_deg: float = 16.0
    start_forward: float = 0.95
    pose_inliers: int = 30


FIRST_LOOK = Look(features=4096)
SECOND_LOOK = Look(features=8192, affine=True, max_ratio=0.9, min_inlier_ratio=0.15)

LADDER = (
    Rung("4096 features", FIRST_LOOK),
    Rung("4096 features, wide start", FIRST_LOOK, "incremental", 50, 4.0, 1.0, 15),
    Rung("affine features", SECOND_LOOK),
    Rung("affine features, wide start", SECOND_LOOK, "incremental", 50, 4.0, 1.0, 15),
    Rung("affine features, global mapper", SECOND_LOOK, "global"),
)
"""A wide start costs a second with the matches at hand, another look a minute; so each look
is tried with both."""


def map_photos(
    rung: Rung, database: Path, folder: Path, seed: int, threads: int
) -> list[pycolmap.Reconstruction]:
    """Return the separate models that the rung's mapper finds."""
    folder.mkdir(parents=True, exist_ok=True)
    if rung.mapper == "global":
        options = global_options(seed, threads)
        return list(pycolmap.global_mapping(database, folder, folder, options).values())
    settings = incremental_options(rung, seed, threads)
    return list(pycolmap.incremental_mapping(database, folder, folder, settings).values())


def incremental_options(rung: Rung, seed: int, threads: int) -> pycolmap.IncrementalPipelineOptions:
    """Return COLMAP's incremental settings of a rung."""
    options = pycolmap.IncrementalPipelineOptions()
    options.extract_colors = False  # the photos are not files; colours are ours
    options.random_seed = seed
    options.num_threads = threads
    options.min_model_size = 3
    options.mapper.init_min_num_inliers = rung.start_inliers
    options.mapper.init_min_tri_angle = rung.start_angle_deg
    options.mapper.init_max_forward_motion = rung.start_forward
    options.mapper.abs_pose_min_num_inliers = rung.pose_inliers
    return options


def global_options(seed: int, threads: int) -> pycolmap.GlobalPipelineOptions:
    """Return COLMAP's global settings (rotation averaging, global positioning)."""
    options = pycolmap.GlobalPipelineOptions()
    options.random_seed = seed
    options.num_threads = threads
    return options
