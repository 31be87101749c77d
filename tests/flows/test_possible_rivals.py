"""Which targets compete for the same points decides which steps a changed box reruns."""

from __future__ import annotations

from flows.factorize import possible_rivals
from garden_models.scene import Target

MUG = Target("mug", "a.jpg", (0, 0, 10, 10))
TOUCHING = Target("jar", "a.jpg", (8, 0, 20, 10))
APART = Target("box", "a.jpg", (30, 0, 40, 10))
ELSEWHERE = Target("duck", "b.jpg", (30, 0, 40, 10))


def test_overlapping_boxes_of_one_photo_are_rivals() -> None:
    assert possible_rivals(MUG, (MUG, TOUCHING, APART)) == (TOUCHING,)


def test_boxes_apart_in_one_photo_do_not_depend_on_each_other() -> None:
    assert possible_rivals(APART, (MUG, TOUCHING, APART)) == ()


def test_boxes_in_different_photos_may_be_of_the_same_points() -> None:
    assert possible_rivals(MUG, (MUG, ELSEWHERE)) == (ELSEWHERE,)


def test_rivalry_is_mutual() -> None:
    targets = (MUG, TOUCHING, APART, ELSEWHERE)
    for a in targets:
        for b in targets:
            assert (b in possible_rivals(a, targets)) == (a in possible_rivals(b, targets))
