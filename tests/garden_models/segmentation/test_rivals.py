"""Boxes compete only where they show the same things."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from garden_models.scene import BadGeometry, GravityView, Reconstruction, Target
from garden_models.segmentation.rivals import find_rivals
from tests.garden_models.segmentation.ray_scene import (
    RayScene,
    Solid,
    orbit,
    render,
    table_with,
    target_box,
)

Room = tuple[Reconstruction, GravityView, dict[str, Target]]


@pytest.fixture(scope="module")
def room() -> Room:
    """Two boxes that touch, and a ball far from both, each boxed on another photo."""
    solids = table_with(
        (
            Solid("box", (-0.1, -0.1, 0), (0.1, 0.1, 0.1), (200, 60, 60), 1),
            Solid("box", (0.07, -0.05, 0), (0.07, 0.05, 0.08), (60, 60, 200), 2),
            Solid("ellipsoid", (0.42, -0.06, 0.25), (0.06, 0.06, 0.06), (60, 200, 60), 3),
        )
    )
    reconstruction, gravity, labels = render(RayScene(solids, orbit(8, 1.6, 0.9)))
    boxes = [("left", 1, 0), ("right", 2, 1), ("ball", 3, 4)]
    targets = {name: target_box(name, label, labels, view) for name, label, view in boxes}
    return reconstruction, gravity, targets


def rivals(room: Room, name: str) -> set[str]:
    reconstruction, gravity, targets = room
    others = tuple(target for target in targets.values() if target.name != name)
    found = find_rivals(reconstruction, gravity, targets[name], others)
    return {target.name for target in found.targets}


def test_touching_objects_boxed_on_different_photos_are_rivals(room: Room) -> None:
    assert rivals(room, "left") == {"right"}
    assert rivals(room, "right") == {"left"}


def test_an_object_far_from_the_others_has_no_rivals(room: Room) -> None:
    assert rivals(room, "ball") == set()


def test_a_thing_within_a_large_box_is_a_rival_of_what_the_box_is_around(room: Room) -> None:
    reconstruction, gravity, targets = room
    width, height = reconstruction.views[0].original_size
    table = Target("table", targets["ball"].photo, (0.0, 0.0, float(width), float(height)))
    both = {
        found.name
        for one, other in [(table, targets["ball"]), (targets["ball"], table)]
        for found in find_rivals(reconstruction, gravity, one, (other,)).targets
    }
    assert both == {"table", "ball"}


def test_a_rival_without_geometry_or_photo_has_no_say(room: Room) -> None:
    reconstruction, gravity, targets = room
    lost = dataclasses.replace(targets["right"], photo="unregistered.jpg")
    assert find_rivals(reconstruction, gravity, targets["left"], (lost,)).targets == ()


def test_an_own_box_without_geometry_is_an_error(room: Room) -> None:
    reconstruction, gravity, targets = room
    points = reconstruction.points_world
    empty = dataclasses.replace(reconstruction, points_world=points.subset(np.zeros(0, np.int64)))
    with pytest.raises(BadGeometry, match="left"):
        find_rivals(empty, gravity, targets["left"], (targets["right"],))
