"""Give our stereo's depth beside the truth on the sample capture, cameras given."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flows.benchmark.corner_truth import load_corner
from flows.capture import find_capture
from flows.preset import Preset
from garden_models.disentanglement.training.augmentations.config import StereoNoise
from garden_models.metrics.depth import truth_at_view
from garden_models.scene import Reconstruction
from storage import Store
from tasks.ingest import ingest
from tasks.reconstruct import reconstruct
from tasks.register import register
from tasks.step import RunContext, load, run_context


def fitted_stereo_noise(folder: Path, store: Store) -> StereoNoise:
    """Return the stereo-noise settings that fit the residuals on a capture like ``corner``."""
    from garden_models.disentanglement.training.augmentations.fit_stereo import fit_stereo_noise

    return fit_stereo_noise(depth_pairs(folder, store))


def reconstructed_with_cameras(folder: Path, store: Store) -> Reconstruction:
    """Return our reconstruction of a capture like ``corner`` from its true cameras."""
    capture = find_capture(folder, load_corner(folder).transforms)
    with run_context(RunContext(store=store, scene=capture.name)):
        photos = ingest(capture.source, Preset().ingest)
        cameras = register(photos, Preset().register)
        dense = reconstruct(photos, cameras, Preset().reconstruct)
        found: Reconstruction = load(dense, Reconstruction)
    return found


def depth_pairs(folder: Path, store: Store) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return estimated and true z-depth (metres) of every view that has a truth."""
    truth = load_corner(folder)
    pairs = []
    for view in reconstructed_with_cameras(folder, store).views:
        if view.photo in truth.depths:
            known = truth.depths[view.photo].depth
            pairs.append((view.depth, truth_at_view(known, view.K, view.size, view.distortion)))
    return pairs
