"""An answer that cannot be one to its request is told apart, from whatever process it comes."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.targets.grounding_model import GroundingAnswer, GroundingRequest

REQUEST = GroundingRequest(np.zeros((10, 20, 3), np.uint8), ("mug", "jar"), 0.3)


@pytest.mark.parametrize(
    ("box", "score", "label", "words"),
    [
        ((1, 2, 3, 4), 0.5, 1, ""),
        ((1, 2, 3, 4), 0.5, 2, "none of the 2"),
        ((1, 2, 3, 4), 0.5, -1, "none of the 2"),
        ((1, 2, 3, 4), 1.5, 0, "score"),
        ((3, 2, 1, 4), 0.5, 0, "ends before it begins"),
    ],
)
def test_labels_scores_and_corners_are_checked(
    box: tuple[float, ...], score: float, label: int, words: str
) -> None:
    answer = GroundingAnswer(np.array([box], float), np.array([score]), np.array([label]))
    wrong = answer.fits(REQUEST)
    assert (words in wrong) if words else (wrong == "")
