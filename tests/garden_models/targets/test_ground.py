"""Named things are taken from the photo that shows them best, in pixels of its file."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.scene import BadInput, Capture, Photo, Target
from garden_models.targets.config import GroundTargets, check_grounding
from garden_models.targets.ground import ground_targets
from garden_models.targets.grounding_model import GroundingAnswer, GroundingRequest

CAPTURE = Capture(
    tuple(
        Photo(f"{name}.jpg", np.full((50, 100, 3), grey, np.uint8), (400, 200))
        for grey, name in enumerate("abc")
    )
)
MUG, CHAIR = 0, 1
FOUND: dict[int, list[tuple[int, float, tuple[float, ...]]]] = {
    0: [(MUG, 0.9, (10, 10, 20, 20)), (CHAIR, 0.4, (50, 0, 90, 50))],
    1: [(CHAIR, 0.6, (0, 0, 40, 50)), (CHAIR, 0.5, (50, 0, 90, 50)),
        (CHAIR, 0.45, (51, 0, 91, 50)), (MUG, 0.8, (1, 1, 9, 9))],
    2: [(CHAIR, 0.95, (0, 0, 40, 50))],
}  # fmt: skip
CONFIG = GroundTargets(model="grounding_dino", labels=("red mug", "chair"))


def detector(request: GroundingRequest) -> GroundingAnswer:
    """Return what the photo's grey says is in it."""
    assert request.labels == CONFIG.labels
    assert request.min_score == CONFIG.min_score
    found = FOUND[int(request.rgb[0, 0, 0])]
    return GroundingAnswer(
        np.array([box for _, _, box in found], float).reshape(-1, 4),
        np.array([score for _, score, _ in found]),
        np.array([label for label, _, _ in found], int),
    )


def test_all_of_one_name_come_from_the_photo_where_they_score_most() -> None:
    found = ground_targets(CAPTURE, (), CONFIG, detector)
    assert found.targets == (
        Target("red_mug", "a.jpg", (40.0, 40.0, 80.0, 80.0)),
        Target("chair", "b.jpg", (0.0, 0.0, 160.0, 200.0)),
        Target("chair_2", "b.jpg", (200.0, 0.0, 360.0, 200.0)),
    )
    assert found.scores == (0.9, 0.6, 0.5)
    assert found.verdict.status == "ok"


def test_photos_that_are_not_registered_are_passed_over() -> None:
    found = ground_targets(CAPTURE, ("b.jpg",), CONFIG, detector)
    assert [t.photo for t in found.targets] == ["a.jpg", "c.jpg"]


def test_a_name_that_is_found_nowhere_is_said() -> None:
    only_c = ground_targets(CAPTURE, ("a.jpg", "b.jpg"), CONFIG, detector)
    assert (only_c.verdict.status, only_c.verdict.reasons) == (
        "degraded",
        ("nothing called red mug was found",),
    )


def test_nothing_at_all_is_one_sentence() -> None:
    def blind(request: GroundingRequest) -> GroundingAnswer:
        return GroundingAnswer(np.zeros((0, 4)), np.zeros(0), np.zeros(0, int))

    with pytest.raises(BadInput, match=r"nothing called red mug or chair was found in 3 photos"):
        ground_targets(CAPTURE, (), CONFIG, blind)


@pytest.mark.parametrize("labels", [(), ("",), ("a mug. a chair",), ("...",)])
def test_labels_that_name_nothing_are_refused(labels: tuple[str, ...]) -> None:
    with pytest.raises(BadInput):
        check_grounding(GroundTargets(model="grounding_dino", labels=labels))
