"""Augmentations: the supplement's ranges, labels that follow, each with its own switch."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from garden_models.disentanglement.training.augmentations.augment import augment
from garden_models.disentanglement.training.augmentations.config import (
    NAMES,
    NONE,
    PAPER,
    Augmentations,
    Ghosting,
    MeshJitter,
    StereoNoise,
    ThinParts,
    VirtualScan,
    without,
)
from garden_models.disentanglement.training.augmentations.ghosting import add_ghosts
from garden_models.disentanglement.training.augmentations.mesh_jitter import jitter_mesh
from garden_models.disentanglement.training.augmentations.stereo_noise import add_stereo_noise
from garden_models.disentanglement.training.augmentations.thin_parts import (
    deform_thin_parts,
    slender,
)
from garden_models.disentanglement.training.augmentations.virtual_scan import keep_seen, scan
from garden_models.disentanglement.training.pair import Condition, LabelledCloud
from garden_models.scene import BadInput


def ball_on_a_plate(count: int = 6000) -> LabelledCloud:
    """Return a ball of radius 0.1 that stands on a square of 0.6, y down."""
    rng = np.random.default_rng(0)
    ball = rng.normal(0, 1, (count // 2, 3))
    ball = 0.1 * ball / np.linalg.norm(ball, axis=1, keepdims=True) - [0, 0.1, 0]
    plate = np.zeros((count // 2, 3))
    plate[:, [0, 2]] = rng.uniform(-0.3, 0.3, (count // 2, 2))
    return LabelledCloud(np.concatenate([ball, plate]), np.arange(count) < count // 2)


def condition() -> Condition:
    rng = np.random.default_rng(1)
    corners = rng.uniform(-0.1, 0.1, (200, 3, 3))
    return Condition(corners.mean(axis=1), np.arange(200), corners)


def test_the_defaults_are_the_supplements_numbers():
    config = Augmentations()
    assert config.voxel_m == 0.15
    assert config.ghosting.layers == (5, 12)
    assert config.ghosting.drift_voxels == (0.2, 0.5)
    assert config.thin_parts.probability == 0.5
    assert config.virtual_scan.views == (25, 45)
    assert config.mesh_jitter.scale == (0.65, 1.35)
    assert config.mesh_jitter.stretch == (0.85, 1.15)
    assert config.mesh_jitter.yaw_deg == 20
    assert config.mesh_jitter.translation_m == 0.36
    assert not PAPER.stereo_noise.on
    assert PAPER.unit(0.1) == 1.0
    assert config.unit(0.1) == pytest.approx(0.1)
    assert config.unit(2.0) == 1.0


def test_ghosts_are_five_to_twelve_layers_shifted_by_a_fifth_to_half_a_voxel():
    cloud = ball_on_a_plate()
    counts, drifts = [], []
    for seed in range(40):
        config = Ghosting(patch=(0.02, 0.02))
        ghost = add_ghosts(cloud, np.random.default_rng(seed), config, 0.15)
        n = len(cloud.points)
        layer = int(0.02 * n)
        np.testing.assert_array_equal(ghost.points[:n], cloud.points)
        counts.append((len(ghost.points) - n) / layer)
        for start in range(n, len(ghost.points), layer):
            copies = ghost.points[start : start + layer]
            centre = copies.mean(axis=0)
            offsets = cloud.points - centre
            assert np.linalg.norm(offsets, axis=1).min() < 0.2
            shift = min(
                (float(np.linalg.norm(copies[0] - p)) for p in cloud.points), default=np.inf
            )
            assert shift <= 0.5 * 0.15 + 1e-9
            drifts.append(shift)
    assert min(counts) == 5
    assert max(counts) == 12


def test_a_ghost_keeps_the_label_of_what_it_repeats():
    cloud = ball_on_a_plate()
    far = LabelledCloud(cloud.points + np.where(cloud.label, 10.0, 0.0)[:, None], cloud.label)
    ghost = add_ghosts(far, np.random.default_rng(3), Ghosting(), 0.15)
    assert ((ghost.points[:, 0] > 5) == ghost.label).all()


def test_slender_parts_are_found_and_only_they_move():
    rng = np.random.default_rng(0)
    pole = np.column_stack([rng.normal(0, 0.004, 1500), rng.uniform(-1, 0, 1500), np.zeros(1500)])
    plate = ball_on_a_plate().points[3000:]
    points = np.concatenate([pole, plate])
    thin = slender(points, 0.06, 0.55)
    assert thin[:1500].mean() > 0.9
    assert thin[1500:].mean() < 0.1
    cloud = LabelledCloud(points, np.arange(len(points)) < 1500)
    config = ThinParts(probability=1.0, broken=0.0)
    moved = deform_thin_parts(cloud, np.random.default_rng(1), config, 0.15)
    shift = np.linalg.norm(moved.points - cloud.points[: len(moved.points)], axis=1)
    kept = np.isin(np.arange(len(points)), np.flatnonzero(~thin))
    assert shift[kept[: len(shift)]].max() == 0
    assert 0.002 < np.median(shift[: int(thin.sum() * 0.9)]) < 0.15


def test_half_of_the_calls_leave_thin_parts_alone():
    rng = np.random.default_rng(0)
    pole = np.column_stack([np.zeros(300), rng.uniform(-1, 0, 300), np.zeros(300)])
    cloud = LabelledCloud(pole, np.ones(300, bool))
    changed = [deform_thin_parts(cloud, rng, ThinParts(), 0.15) is not cloud for _ in range(300)]
    assert np.mean(changed) == pytest.approx(0.5, abs=0.08)


def test_a_scan_loses_what_no_camera_sees():
    """The inside of a closed ball and the plate's underside have no viewpoint."""
    cloud = ball_on_a_plate()
    inner = LabelledCloud(cloud.points * 0.5 - [0, 0.05, 0], cloud.label).subset(cloud.label)
    both = LabelledCloud(
        np.concatenate([cloud.points, inner.points]),
        np.concatenate([cloud.label, inner.label]),
    )
    config = VirtualScan()
    seen = scan(both.points, np.random.default_rng(0), config)
    assert 25 <= len(seen.eye) <= 45
    kept = keep_seen(both, seen, np.random.default_rng(1), config)
    outer, hidden = kept < len(cloud.points), kept >= len(cloud.points)
    assert hidden.sum() < 0.05 * len(inner.points)
    assert outer.sum() > 0.25 * len(cloud.points)


def test_jitter_keeps_to_its_ranges_and_moves_samples_with_their_triangles():
    given = condition()
    extents, shifts = [], []
    for seed in range(300):
        moved = jitter_mesh(given, np.random.default_rng(seed), MeshJitter(yaw_deg=0), 1.0)
        extents.append(np.ptp(moved.box, axis=0) / np.ptp(given.box, axis=0))
        shifts.append(moved.box.mean(axis=0) - given.box.mean(axis=0))
        np.testing.assert_allclose(moved.triangles.mean(axis=1), moved.points, atol=1e-12)
    extents, shifts = np.array(extents), np.array(shifts)
    assert extents.min() >= 0.65 * 0.85
    assert extents.max() <= 1.35 * 1.15
    assert np.abs(shifts).max() <= 0.36
    assert np.abs(shifts).max() > 0.33
    ratio = extents.max(axis=1) / extents.min(axis=1)
    assert ratio.max() > 1.2


def test_jitter_turns_about_gravity_by_up_to_twenty_degrees():
    given = condition()
    only = MeshJitter(scale=(1, 1), stretch=(1, 1), translation_m=0)
    angles = []
    for seed in range(200):
        moved = jitter_mesh(given, np.random.default_rng(seed), only, 1.0)
        np.testing.assert_allclose(moved.points[:, 1], given.points[:, 1], atol=1e-12)
        centre = given.box.mean(axis=0)[[0, 2]]
        a, b = (c.points[0, [0, 2]] - centre for c in (given, moved))
        angles.append(np.degrees(np.arccos(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)))))
    assert 18 < max(angles) <= 20 + 1e-6


def test_stereo_noise_moves_points_along_the_ray_of_a_camera_that_sees_them():
    cloud = ball_on_a_plate()
    seen = scan(cloud.points, np.random.default_rng(0), VirtualScan())
    config = StereoNoise(holes=0.0, edge_holes=0.0, smeared=0.0, sigma=0.01)
    noisy = add_stereo_noise(cloud, seen, np.random.default_rng(1), config)
    shift = noisy.points - cloud.points
    length = np.linalg.norm(shift, axis=1)
    towards = cloud.points[None] - seen.eye[:, None]
    along = np.abs(np.einsum("nj,cnj->cn", shift, towards))
    along /= np.maximum(length * np.linalg.norm(towards, axis=2), 1e-12)
    assert (along.max(axis=0)[length > 1e-6] > 1 - 1e-6).all()
    relative = length / np.linalg.norm(towards, axis=2).mean(axis=0)
    assert 0.3 * 0.01 < np.median(relative) < 3 * 0.01


def test_stereo_noise_grows_with_depth_and_leaves_holes():
    cloud = ball_on_a_plate()
    seen = scan(cloud.points, np.random.default_rng(0), VirtualScan())
    near, far = (
        dataclasses.replace(seen, eye=seen.eye * factor, depth=seen.depth * factor)
        for factor in (1.0, 6.0)
    )
    config = StereoNoise(holes=0.0, edge_holes=0.0, smeared=0.0, sigma=0.001, growth=0.002)
    moved = [
        np.linalg.norm(
            add_stereo_noise(cloud, s, np.random.default_rng(1), config).points - cloud.points,
            axis=1,
        ).mean()
        for s in (near, far)
    ]
    assert moved[1] > 8 * moved[0]
    holed = add_stereo_noise(
        cloud, seen, np.random.default_rng(1), StereoNoise(holes=0.1, edge_holes=0)
    )
    assert len(holed.points) == pytest.approx(len(cloud.points) * 0.9, rel=0.03)


@pytest.mark.parametrize("name", NAMES)
def test_each_can_be_switched_off_alone(name):
    cloud, given = ball_on_a_plate(), condition()
    config = without(Augmentations(thin_parts=ThinParts(probability=1.0)), name)
    assert not getattr(config, name).on
    assert sum(getattr(config, other).on for other in NAMES) == len(NAMES) - 1
    only = without(Augmentations(), *(other for other in NAMES if other != name))
    after, moved = augment(cloud, given, np.random.default_rng(0), only)
    changed_cloud = after.points.shape != cloud.points.shape or not np.allclose(
        after.points, cloud.points
    )
    assert (moved is not given) == (name == "mesh_jitter")
    assert changed_cloud == (name in ("ghosting", "virtual_scan", "stereo_noise"))


def test_none_changes_nothing_and_unknown_names_are_refused():
    cloud, given = ball_on_a_plate(), condition()
    after, moved = augment(cloud, given, np.random.default_rng(0), NONE)
    np.testing.assert_array_equal(after.points, cloud.points)
    assert moved is given
    with pytest.raises(BadInput, match="ghosting"):
        without(Augmentations(), "fog")


def test_the_same_generator_gives_the_same_artifacts():
    cloud, given = ball_on_a_plate(), condition()
    one, again = (
        augment(cloud, given, np.random.default_rng(9), Augmentations()) for _ in range(2)
    )
    np.testing.assert_array_equal(one[0].points, again[0].points)
    np.testing.assert_array_equal(one[1].triangles, again[1].triangles)
