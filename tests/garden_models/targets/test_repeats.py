"""Each physical thing is one target, under a name of its own."""

from __future__ import annotations

from garden_models.scene import Target
from garden_models.targets.answered_targets import AnsweredTarget
from garden_models.targets.repeats import overlap, without_repeats

BOX, MOVED, FAR = (0.0, 0.0, 100.0, 100.0), (2.0, 2.0, 101.0, 101.0), (300.0, 0.0, 350.0, 50.0)


def kept(*targets: Target) -> tuple[list[Target], list[str]]:
    found, notes = without_repeats([AnsweredTarget(target) for target in targets])
    return [one.target for one in found], notes


def test_overlap_is_intersection_over_union() -> None:
    assert overlap((0, 0, 2, 2), (1, 0, 3, 2)) == 1 / 3
    assert overlap(BOX, FAR) == 0.0
    assert overlap(BOX, BOX) == 1.0


def test_the_same_box_under_two_names_is_one_target() -> None:
    mug = Target("mug", "a.jpg", BOX)
    targets, notes = kept(mug, Target("cup", "a.jpg", MOVED))
    assert targets == [mug]
    assert notes == ["cup: the same box as mug, left out"]
    assert len(kept(mug, Target("cup", "b.jpg", MOVED))[0]) == 2


def test_one_name_in_two_photos_stays_where_it_is_largest() -> None:
    small, large = Target("mug", "a.jpg", FAR), Target("MUG", "b.jpg", BOX)
    assert kept(small, large)[0] == [large]
    assert kept(large, small)[0] == [large]


def test_one_name_twice_in_one_photo_is_two_targets() -> None:
    chairs = [Target("chair", "a.jpg", BOX), Target("chair", "a.jpg", FAR)]
    elsewhere = Target("chair", "b.jpg", FAR)
    targets, _notes = kept(*chairs, elsewhere)
    assert [(t.name, t.photo, t.box) for t in targets] == [
        ("chair", "a.jpg", BOX),
        ("chair_2", "a.jpg", FAR),
    ]
    named = [*chairs, Target("chair_2", "a.jpg", (500, 0, 600, 90))]
    assert [t.name for t in kept(*named)[0]] == ["chair", "chair_2", "chair_2_2"]
