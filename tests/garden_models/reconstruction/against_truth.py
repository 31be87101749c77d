"""Hold a prediction against the truth, up to what its model cannot know."""

from __future__ import annotations

import numpy as np

from garden_models.geometry.camera import resize_intrinsics
from garden_models.geometry.rigid import homogeneous, invert_rigid
from garden_models.reconstruction.geometry_model import GeometryPrediction
from tests.doubles.true_views import TrueViews


def assert_true(
    prediction: GeometryPrediction,
    truth: TrueViews,
    *,
    scale: float | None = None,
    same_world: bool = False,
    tolerance: float = 2e-3,
) -> float:
    """Assert that cameras, intrinsics and depths are true up to one similarity.

    The unit must be ``scale`` metres if given; it is returned. With ``same_world`` there is no
    similarity left.
    """
    assert len(prediction.views) == len(truth)
    poses = [homogeneous(view.camera_from_world) for view in prediction.views]
    true = [homogeneous(camera) for camera in truth.camera_from_world]
    units = []
    for i, view in enumerate(prediction.views):
        height, width = view.depth.shape
        photo = truth.photos[i].shape[1], truth.photos[i].shape[0]
        K = resize_intrinsics(truth.K[i], photo, (width, height))
        np.testing.assert_allclose(view.K, K, rtol=tolerance, atol=tolerance * width)
        exact = truth.depth_at(i, K, (width, height))
        known = view.depth > 0
        assert known.mean() > 0.5 and not (known & ~view.seen).any()
        assert view.confidence.min() >= 0 and view.confidence.max() <= 1
        units.append(np.median(exact[known] / view.depth[known]))
        off = np.abs(view.depth[known] * units[-1] / exact[known] - 1)
        assert np.quantile(off, 0.9) < tolerance, "depth is not true up to a factor"
    unit = float(np.median(units))
    np.testing.assert_allclose(units, unit, rtol=2 * tolerance)
    if scale is not None:
        assert abs(unit / scale - 1) < tolerance, f"one unit is {unit} m, not {scale}"
    for i in range(len(truth)):
        if same_world:
            np.testing.assert_allclose(poses[i], true[i], atol=tolerance)
            continue
        found = poses[i] @ invert_rigid(poses[0])
        wanted = true[i] @ invert_rigid(true[0])
        np.testing.assert_allclose(found[:3, :3], wanted[:3, :3], atol=tolerance)
        np.testing.assert_allclose(found[:3, 3] * unit, wanted[:3, 3], atol=2 * tolerance)
    return unit
