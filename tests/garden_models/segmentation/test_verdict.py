"""A segmentation says itself where it is weak."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from garden_models.scene import SupportSurface, Target, View
from garden_models.segmentation.box import ViewBox
from garden_models.segmentation.occlusion import Outlined
from garden_models.segmentation.region import BoxView
from garden_models.segmentation.verdict import judge

SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])


TABLE = SupportSurface("table_1", "table", 0.0, SQUARE, 4.0, 99)


VIEW = View(
    "a.jpg",
    np.zeros((60, 80, 3), np.uint8),
    np.ones((60, 80)),
    np.ones((60, 80)),
    np.array([[80.0, 0, 40], [0, 80, 30], [0, 0, 1]]),
    np.eye(4)[:3],
    (80, 60),
)
"""Boxes of the size used here have a diagonal of half a metre at a metre's distance."""


def rectangle(x0, y0, x1, y1):
    mask = np.zeros((60, 80), bool)
    mask[y0:y1, x0:x1] = True
    return mask


@dataclass(frozen=True)
class Evidence:
    """Of a good segmentation, unless said otherwise."""

    box: tuple[float, float, float, float] = (18.0, 18.0, 52.0, 42.0)
    masks: tuple[np.ndarray, ...] = (rectangle(20, 20, 50, 40),) * 4
    points: int = 1000
    depth: float = 0.3
    outlined: list[Outlined] = field(default_factory=lambda: [Outlined(0.1, 0.9)] * 4)
    support: SupportSurface | None = TABLE
    probability: np.ndarray = field(default_factory=lambda: np.repeat([0.01, 0.99], 100))

    def judged(self):
        box = ViewBox(0, np.array(self.box[:2]), np.array(self.box[2:]), VIEW.size)
        target = Target("cup", "a.jpg", self.box)
        z = np.linspace(1.0, 1.0 + self.depth, self.points)
        return judge(
            BoxView(target, box, VIEW, np.eye(4)),
            self.masks,
            np.stack([0 * z, 0 * z, z], 1),
            self.outlined,
            self.support,
            self.probability,
        )


GOOD = Evidence()


def test_good_evidence_is_ok():
    verdict = GOOD.judged()
    assert verdict.status == "ok"
    assert verdict.reasons == ()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"support": None}, "Nothing carries 'cup'"),
        ({"points": 149}, "Only 149 reconstructed points"),
        ({"masks": (*GOOD.masks[:2], rectangle(0, 0, 0, 0))}, "visible in 2 of 3 photos only"),
        ({"masks": (rectangle(20, 20, 24, 24), *GOOD.masks)}, "fills only 2% of it"),
        (
            {"masks": (rectangle(0, 0, 0, 0), *GOOD.masks)},
            "Nothing was found that ends inside",
        ),
        ({"box": (25.0, 18.0, 52.0, 42.0)}, "may cut the object off: 18%"),
        ({"probability": np.repeat([0.45, 0.99], [30, 70])}, "uncertain for 30% of its points"),
        ({"depth": 3.0}, "diagonals of its box into the picture"),
        ({"outlined": [Outlined(0.1, 0.5)] * 4}, "agree with its points by only 50%"),
        ({"outlined": [Outlined(1.0, float("nan"))] * 4}, "agree with its points by only 0%"),
    ],
)
def test_each_weakness_is_named_alone(change, says):
    verdict = replace(GOOD, **change).judged()
    assert verdict.status == "degraded"
    (reason,) = verdict.reasons
    assert says in reason


def test_all_weaknesses_are_named_together():
    weak = replace(GOOD, support=None, points=3, outlined=[Outlined(0.0, 0.1)] * 4)
    assert len(weak.judged().reasons) == 3


def test_views_that_hardly_see_the_object_do_not_count_for_agreement():
    hidden = replace(GOOD, outlined=[*GOOD.outlined, *[Outlined(0.9, 0.0)] * 20])
    assert hidden.judged().status == "ok"


def test_what_the_pictures_border_cuts_is_not_cut_by_the_box():
    at_border = (rectangle(0, 0, 50, 40),) * 4
    assert replace(GOOD, box=(0.0, 0.0, 52.0, 42.0), masks=at_border).judged().status == "ok"
    whole = replace(GOOD, box=(0.0, 0.0, 80.0, 60.0), masks=(rectangle(0, 0, 80, 60),) * 4)
    assert whole.judged().status == "ok"


def test_a_target_without_any_point_is_degraded_and_not_an_error():
    nothing = replace(
        GOOD,
        masks=(rectangle(0, 0, 0, 0),) * 4,
        points=0,
        outlined=[Outlined(1.0, float("nan"))] * 4,
        probability=np.zeros(0),
    )
    assert nothing.judged().status == "degraded"
