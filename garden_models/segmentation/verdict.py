"""Judge a segmentation by its own evidence."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from garden_models.scene import SupportSurface, Verdict
from garden_models.segmentation.box import ViewBox
from garden_models.segmentation.occlusion import Outlined
from garden_models.segmentation.region import BoxView

FEW_POINTS = 150
"""Fewer points than this do not make a mesh."""
FEW_VIEWS = 3
EMPTY_BOX = 0.05
"""A mask that fills less of its box than this is not what the box was drawn around."""
CUT_BORDER = 0.1
"""A mask that covers more of the box's border than this is cut off by it."""
MARGIN = 0.03
"""Looked at outside of the box by this share of its half: a box may be drawn tightly."""
UNSURE = 0.25
"""Share of the object's points with a probability near one half that makes it doubtful."""
DEEP = 2.0
"""A target that reaches this many diagonals of its box back may hold what lies behind it."""
AGREEMENT = 0.6
"""Mean overlap of masks and projected points under which the views disagree."""

Masks = tuple[Bool[np.ndarray, "h w"], ...]


def judge(
    one: BoxView,
    masks: Masks,
    points_gv: Float[np.ndarray, "p 3"],
    outlined: list[Outlined],
    support: SupportSurface | None,
    probability: Float[np.ndarray, " n"],
) -> Verdict:
    """Return ok, or degraded with every reason that holds.

    ``one`` is the target's box on its view, ``points_gv`` are the object's points,
    ``probability`` that of all nodes near it.
    """
    reasons = []
    name, box, points = one.target.name, one.box, len(points_gv)
    if support is None:
        reasons.append(
            f"Nothing carries {name!r}: no level surface touches it from below, so it may hang "
            "or be mounted, and it will not stay where it is when simulated."
        )
    if points < FEW_POINTS:
        reasons.append(
            f"Only {points} reconstructed points belong to {name!r}; take more photos of it "
            "from nearby viewpoints, or photos of higher resolution."
        )
    shown = sum(bool(mask.any()) for mask in masks)
    if shown < FEW_VIEWS:
        reasons.append(f"{name!r} is visible in {shown} of {len(masks)} photos only.")
    mask = masks[box.view]
    area = float(np.prod(box.size))
    if not mask.any():
        reasons.append(
            f"Nothing was found that ends inside the box of {name!r}: what fills it probably goes "
            "on outside of it; draw a box that holds all of it."
        )
    elif mask.sum() < EMPTY_BOX * area:
        reasons.append(
            f"The object found in the box of {name!r} fills only {mask.sum() / area:.0%} of it."
        )
    cut = _border_share(mask, box.grown(MARGIN))
    if cut > CUT_BORDER:
        reasons.append(
            f"The box of {name!r} may cut the object off: {cut:.0%} of the box's border lies on "
            "it; draw a box that holds all of it."
        )
    depth = _depth(points_gv, one)
    if depth > DEEP:
        reasons.append(
            f"{name!r} reaches {depth:.1f} diagonals of its box into the picture: some of what "
            "lies behind it may have been taken for it; a box on a photo from the side would tell."
        )
    near = probability[probability > 0.3]
    unsure = float(np.mean(near < 0.6)) if len(near) else 0.0
    if unsure > UNSURE:
        reasons.append(
            f"Where {name!r} ends is uncertain for {unsure:.0%} of its points: it touches things "
            "that look alike; boxes around those would tell them apart."
        )
    scores = [one.overlap for one in outlined if one.occluded <= 0.5 and np.isfinite(one.overlap)]
    agreement = float(np.mean(scores)) if scores else 0.0
    if agreement < AGREEMENT:
        reasons.append(
            f"The masks of {name!r} agree with its points by only {agreement:.0%} on average."
        )
    return Verdict("degraded" if reasons else "ok", tuple(reasons))


def _depth(points_gv: Float[np.ndarray, "p 3"], one: BoxView) -> float:
    """Return the points' extent along the view in diagonals of the box at their depth."""
    if len(points_gv) == 0:
        return 0.0
    near, middle, far = np.percentile(one.project(points_gv).z, [2, 50, 98])
    diagonal = float(np.linalg.norm(one.box.size)) * middle / float(one.view.K[0, 0])
    return float(far - near) / max(diagonal, 1e-12)


def _border_share(mask: Bool[np.ndarray, "h w"], box: ViewBox) -> float:
    """Return the share of the box's border (off the picture's own border) on the mask."""
    height, width = mask.shape
    x0, y0 = np.maximum(np.floor(box.low), 0).astype(int)
    x1, y1 = np.minimum(np.ceil(box.high), [width, height]).astype(int) - 1
    sides = []
    if x0 > 1:
        sides.append(mask[y0 : y1 + 1, x0])
    if x1 < width - 2:
        sides.append(mask[y0 : y1 + 1, x1])
    if y0 > 1:
        sides.append(mask[y0, x0 : x1 + 1])
    if y1 < height - 2:
        sides.append(mask[y1, x0 : x1 + 1])
    return float(np.mean(np.concatenate(sides))) if sides else 0.0
