"""Run COLMAP's mappers on verified matches: one rung of the ladder of settings."""

from __future__ import annotations

from pathlib import Path

import pycolmap

from garden_models.reconstruction.registration_config import Rung

# COLMAP reports a rung that finds nothing as an error on standard error; the ladder's
# attempts say it better.
pycolmap.logging.minloglevel = pycolmap.logging.Level.FATAL.value


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
