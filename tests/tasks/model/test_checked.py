"""What an answer must be, whoever gave it."""

from __future__ import annotations

import dataclasses
import re
from dataclasses import dataclass, field

import numpy as np
import pytest
from jaxtyping import Bool, Float, UInt8

from garden_models.foundation.failure import ModelFailed
from garden_models.reconstruction.geometry_model import (
    GeometryPrediction,
    GeometryRequest,
    GeometryView,
)
from garden_models.segmentation.mask_model import MaskAnswer, MaskRequest
from tasks.model.checked import check_answer

RGB = np.zeros((4, 6, 3), np.uint8)
REQUEST = MaskRequest(RGB, np.ones((2, 4)))


def wrong(request: object, answer: object, expected: type) -> str:
    with pytest.raises(ModelFailed) as caught:
        check_answer("m", request, answer, expected)
    return str(caught.value)


def test_a_right_answer_passes() -> None:
    answer = MaskAnswer(np.zeros((2, 4, 6), bool), np.ones(2, np.float32))
    check_answer("m", REQUEST, answer, MaskAnswer)


@pytest.mark.parametrize(
    ("masks", "scores", "said"),
    [
        ((2, 6, 4), 2, r"MaskAnswer.masks is bool \[2, 6, 4\]"),
        ((3, 4, 6), 3, r"MaskAnswer.masks is bool \[3, 4, 6\]"),
        ((2, 4, 6), 3, r"MaskAnswer.scores is float64 \[3\]"),
        ((2, 4, 6, 1), 2, r"MaskAnswer.masks is bool \[2, 4, 6, 1\]"),
    ],
)
def test_masks_are_as_many_as_boxes_and_as_large_as_the_photo(
    masks: tuple[int, ...], scores: int, said: str
) -> None:
    answer = MaskAnswer(np.zeros(masks, bool), np.ones(scores))
    assert re.search(said, wrong(REQUEST, answer, MaskAnswer))


def view(height: int, width: int, pose: float = 0.0) -> GeometryView:
    picture = np.ones((height, width))
    camera = np.eye(3, 4)
    camera[0, 3] = pose
    return GeometryView(picture, picture, picture > 0, np.eye(3), camera)


def test_each_view_has_a_size_of_its_own() -> None:
    request = GeometryRequest((RGB, RGB))
    answer = GeometryPrediction((view(3, 4), view(5, 6)), True)
    check_answer("m", request, answer, GeometryPrediction)
    odd = dataclasses.replace(view(3, 4), confidence=np.ones((3, 5)))
    said = wrong(request, GeometryPrediction((view(3, 4), odd), True), GeometryPrediction)
    assert "GeometryPrediction.views[1].confidence is float64 [3, 5]" in said


def test_a_pose_that_is_no_number_is_refused() -> None:
    answer = GeometryPrediction((view(3, 4), view(3, 4, np.nan)), True)
    said = wrong(GeometryRequest((RGB, RGB)), answer, GeometryPrediction)
    assert said == (
        "m gave an answer that cannot be: 1 of 12 numbers of"
        " GeometryPrediction.views[1].camera_from_world are not finite"
    )


@dataclass(frozen=True)
class Loose:
    values: np.ndarray
    maybe: Float[np.ndarray, " n"] | None = None
    named: dict[str, Bool[np.ndarray, " n"]] = field(default_factory=dict)
    either: Float[np.ndarray, "2 2"] | UInt8[np.ndarray, "3"] | None = None

    def fits(self, request: object) -> str:
        return "" if len(self.values) else f"nothing for {request}"


@dataclass(frozen=True)
class Asked:
    count: int = 1


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (Loose(np.ones(0)), "nothing for Asked"),
        (Loose(np.array([1.0, np.inf])), "1 of 2 numbers of Loose.values are not finite"),
        (Loose(np.ones(2), maybe=3.0), "Loose.maybe is a float"),  # type: ignore[arg-type]
        (Loose(np.ones(2), maybe=np.ones(2, int)), "Loose.maybe is int64"),
        (Loose(np.ones(2), named={"a": np.ones(2)}), r"Loose.named\['a'\] is float64"),
        (Loose(np.ones(2), either=np.ones((3, 3))), r"Loose.either is float64 \[3, 3\]"),
        (Loose("text"), "Loose.values is a str"),  # type: ignore[arg-type]
    ],
)
def test_unions_dicts_and_an_answers_own_check(answer: Loose, said: str) -> None:
    assert re.search(said, wrong(Asked(), answer, Loose))


def test_what_may_be_left_out_may_be_left_out() -> None:
    check_answer("m", Asked(), Loose(np.ones(2)), Loose)
    check_answer("m", Asked(), Loose(np.ones(2), either=np.zeros(3, np.uint8)), Loose)
    assert "answered a Asked where a Loose is due" in wrong(Asked(), Asked(), Loose)
