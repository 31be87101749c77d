from __future__ import annotations

import numpy as np
import trimesh

from garden_models.meshing.evidence import gather_evidence
from garden_models.meshing.object_view import ObjectView, object_views
from tests.garden_models.meshing.staged import SUPPORT, Staged, orbit, stage, standing

RADIUS = 0.08
CENTRE = np.array([0.0, SUPPORT - RADIUS, 0.0])


def _ball(count: int = 10, **kwargs: float) -> tuple[Staged, list[ObjectView]]:
    ball = standing(trimesh.creation.icosphere(4, RADIUS))
    staged = stage([ball], orbit(count, 360, 30, 0.6), noise=0.0, holes=0.0, **kwargs)
    return staged, object_views(staged.reconstruction, staged.gravity_view, staged.masks)


def _shell(radius: float, count: int = 400) -> np.ndarray:
    rng = np.random.default_rng(0)
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    # The lower part of a ball is hidden from cameras above.
    direction[:, 1] = -np.abs(direction[:, 1])
    return (CENTRE + radius * direction).astype(np.float32)


def test_signs_and_distances_near_the_surface() -> None:
    _, views = _ball()
    for offset in (-0.006, 0.0, 0.006):
        evidence = gather_evidence(_shell(RADIUS + offset), views, 0.02, 0.0)
        seen = evidence.surface_weight > 1.0
        assert seen.mean() > 0.9
        assert abs(np.median(evidence.surface[seen]) - offset) < 0.002


def test_the_hull_holds_the_object_and_nothing_far_outside() -> None:
    _, views = _ball()
    inside = gather_evidence(_shell(0.9 * RADIUS), views, 0.02, 0.0)
    outside = gather_evidence(_shell(1.4 * RADIUS), views, 0.02, 0.0)
    assert (inside.hull < 0).all()
    assert (outside.hull > 0).mean() > 0.95


def test_the_middle_is_behind_every_surface_but_in_the_hull() -> None:
    _, views = _ball()
    evidence = gather_evidence(CENTRE[None].astype(np.float32), views, 0.02, 0.0)
    assert evidence.surface_weight[0] == 0.0
    assert evidence.hull[0] < -0.5 * RADIUS
    assert not evidence.foreign[0]


def test_a_point_outside_of_every_picture_is_unknown() -> None:
    _, views = _ball()
    evidence = gather_evidence(np.array([[0.0, -50.0, 0.0]], np.float32), views, 0.02, 0.0)
    assert evidence.voters[0] == 0.0


def test_outvoted_views_do_not_carve() -> None:
    _, views = _ball(12)
    inside = _shell(0.8 * RADIUS)
    broken = views[0]
    emptied = broken.__class__(
        **{
            **vars(broken),
            "outside_px": np.full_like(broken.outside_px, 30.0),
            "mask": np.zeros_like(broken.mask),
            "occluder_depth": np.full_like(broken.occluder_depth, np.inf),
        }
    )
    strict = gather_evidence(inside, [emptied, *views[1:]], 0.02, 0.0)
    robust = gather_evidence(inside, [emptied, *views[1:]], 0.02, 0.1)
    assert (strict.hull > 0).all()
    assert (robust.hull < 0).all()


def test_what_hides_the_object_makes_it_unknown_not_empty() -> None:
    ball = standing(trimesh.creation.icosphere(4, RADIUS))
    wall = standing(trimesh.creation.box([0.4, 0.4, 0.01]), 0.0, -0.2)
    staged = stage([ball, wall], orbit(8, 360, 30, 0.6), noise=0.0, holes=0.0)
    views = object_views(staged.reconstruction, staged.gravity_view, staged.masks)
    evidence = gather_evidence(_shell(0.9 * RADIUS), views, 0.02, 0.0)
    assert (evidence.hull < 0).all()


def test_chunks_do_not_show() -> None:
    _, views = _ball(4)
    points = np.concatenate([_shell(r, 30_000) for r in (0.07, 0.08, 0.1)])
    whole = gather_evidence(points, views, 0.02, 0.1)
    part = gather_evidence(points[50_000:], views, 0.02, 0.1)
    np.testing.assert_allclose(whole.hull[50_000:], part.hull)
    np.testing.assert_allclose(whole.surface[50_000:], part.surface)
