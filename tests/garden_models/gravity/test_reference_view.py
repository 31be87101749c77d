"""The reference view is the one that shares most."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from garden_models.geometry.camera import camera_centre, project
from garden_models.gravity.reference_view import reference_view, sees
from garden_models.scene import Reconstruction
from tests.garden_models.gravity.synthetic_room import SIZE, K, Room, cameras_only, make_room


def with_depth(reconstruction: Reconstruction) -> Reconstruction:
    """Give every view the depth of the nearest point in each pixel and its neighbours."""
    views = []
    for view in reconstruction.views:
        pixels, z = project(reconstruction.points_world.xyz, K, view.camera_from_world)
        depth = np.full((SIZE[1], SIZE[0]), np.inf)
        ok = (z > 0) & np.isfinite(pixels).all(1)
        column, row = np.floor(pixels[ok]).astype(int).T
        inside = (column >= 0) & (row >= 0) & (column < SIZE[0]) & (row < SIZE[1])
        np.minimum.at(depth, (row[inside], column[inside]), z[ok][inside])
        views.append(replace(view, depth=np.where(np.isfinite(depth), depth, 0)))
    return replace(reconstruction, views=tuple(views))


def test_the_view_that_shares_most_is_chosen() -> None:
    reconstruction = with_depth(make_room(Room(photos=7, orbit_deg=120))[0])
    # A view turned away from the room shares nothing.
    away = reconstruction.views[3]
    turned = replace(away, camera_from_world=np.diag([-1.0, 1, -1]) @ away.camera_from_world)
    views = (turned, *reconstruction.views)
    chosen = reference_view(replace(reconstruction, views=views))
    assert chosen != 0
    points = reconstruction.points_world.xyz
    seen = np.array([sees(view, points) for view in views])
    shared = (seen * (seen.sum(0) - 1)).sum(1)
    assert shared[chosen] >= 0.9 * shared.max()


def test_without_depth_it_is_the_middle_camera() -> None:
    reconstruction, _ = cameras_only(Room(photos=9))
    centres = np.array([camera_centre(v.camera_from_world) for v in reconstruction.views])
    distance = np.linalg.norm(centres - centres.mean(0), axis=1)
    assert reference_view(reconstruction) == int(np.argmin(distance))
