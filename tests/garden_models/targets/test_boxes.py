"""Boxes are checked before any work starts; every refusal names the target and the remedy."""

from __future__ import annotations

import pytest

from garden_models.scene import BadInput, Target
from garden_models.targets.boxes import check_name, parse_boxes, parse_targets, validate

SIZES = {"a.jpg": (100, 80), "b.jpg": (80, 100)}
MUG = Target("mug", "a.jpg", (10, 10, 60, 60))


def test_both_forms_give_the_same_target() -> None:
    document = {"targets": [{"name": "mug", "image": "a.jpg", "box": [10, 10, 60, 60]}]}
    assert parse_targets(document) == (MUG,)
    assert parse_boxes([["mug", "a.jpg", "10", "10", "60", "60"]]) == (MUG,)


def test_a_box_may_touch_the_border_of_its_photo() -> None:
    validate([Target("all", "a.jpg", (0, 0, 100, 80))], SIZES)


@pytest.mark.parametrize(
    ("target", "message"),
    [
        (Target("mug", "a.jpg", (10, 10, 120, 60)), "mug lies outside its photo a.jpg"),
        (Target("mug", "a.jpg", (-5, 10, 60, 60)), "outside"),
        (Target("mug", "a.jpg", (10, 10, 10, 60)), "mug has no area"),
        (Target("mug", "a.jpg", (60, 10, 10, 60)), "no area"),
        (Target("mug", "c.jpg", (10, 10, 60, 60)), "c.jpg, which is not in the capture"),
        (Target("../mug", "a.jpg", (10, 10, 60, 60)), "cannot be the name of a target"),
    ],
)
def test_a_target_that_cannot_be_is_refused(target: Target, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        validate([target], SIZES)


def test_two_targets_of_one_name_are_refused() -> None:
    with pytest.raises(BadInput, match="two targets are called mug"):
        validate([MUG, Target("mug", "b.jpg", (0, 0, 5, 5))], SIZES)


@pytest.mark.parametrize(
    "name", ["../x", "a/b", "", ".", "..", ".hidden", "-rf", "a\0b", "x" * 200]
)
def test_names_that_could_leave_their_folder_are_refused(name: str) -> None:
    with pytest.raises(BadInput):
        check_name(name, "scene")


@pytest.mark.parametrize("name", ["mug", "Tasse 2", "a.b-c_d", "größe", "红色"])
def test_ordinary_names_are_kept(name: str) -> None:
    assert check_name(name, "scene") == name


@pytest.mark.parametrize(
    "document",
    [[], {}, {"targets": 3}, {"targets": [{"name": "mug"}]}, {"targets": [None]},
     {"targets": [{"name": "m", "image": "a", "box": [1, 2, 3]}]},
     {"targets": [{"name": "m", "image": "a", "box": [1, 2, 3, "nan"]}]}],
)  # fmt: skip
def test_documents_of_another_form_are_refused(document: object) -> None:
    with pytest.raises(BadInput):
        parse_targets(document)
