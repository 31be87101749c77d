"""Prepare what each view says of the object: where its silhouette is, how deep it is."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from garden_models.geometry.camera import backproject_depth, project
from garden_models.geometry.rigid import invert_rigid
from garden_models.scene import GravityView, ObjectMasks, Reconstruction, View

RIM_PX = 2.5
"""Depth within this distance of the silhouette counts less: stereo blends across outlines."""

LEAST_COSINE = 0.15
"""Surfaces seen flatter than this (81 degrees) count as seen so flat."""

FLUSH = 0.01
"""Depths that differ by less than this share of the object's size are of one surface."""

LEAST_MASK_PX = 30
"""Views with a smaller mask say nothing that can be relied on."""


@dataclass(frozen=True)
class ObjectView:
    """One view that sees the object.

    ``outside_px`` is the signed distance to the mask's outline in pixels (negative inside);
    ``depth`` holds metres inside the mask (0: none), ``filled_depth`` the same with holes
    filled from their nearest neighbour; ``occluder_depth`` the depth of what is seen outside
    the mask, holes filled likewise (infinite: nothing);
    ``weight`` (0..1) is the trust in ``depth``; ``cosine`` the angle to the seen surface;
    ``unknown`` marks pixels outside the mask at which the object was proved to be visible.
    """

    index: int
    K: Float[np.ndarray, "3 3"]
    camera_from_gv: Float[np.ndarray, "4 4"]
    mask: Bool[np.ndarray, "h w"]
    outside_px: Float[np.ndarray, "h w"]
    depth: Float[np.ndarray, "h w"]
    filled_depth: Float[np.ndarray, "h w"]
    occluder_depth: Float[np.ndarray, "h w"]
    weight: Float[np.ndarray, "h w"]
    cosine: Float[np.ndarray, "h w"]
    unknown: Bool[np.ndarray, "h w"]

    @property
    def centre_gv(self) -> Float[np.ndarray, "3"]:
        """Position of the camera."""
        return invert_rigid(self.camera_from_gv)[:3, 3]

    @property
    def focal_px(self) -> float:
        """Geometric mean of the two focal lengths."""
        return float(np.sqrt(self.K[0, 0] * self.K[1, 1]))


MOST_POINTS = 60_000
"""More of the object's points add nothing to the tests made with them."""


def object_views(
    reconstruction: Reconstruction, gravity_view: GravityView, masks: ObjectMasks
) -> list[ObjectView]:
    """Return the views that see the object (GV frame, metres)."""
    world_from_gv = invert_rigid(gravity_view.gv_from_world)
    points = masks.points_gv.xyz[:: len(masks.points_gv) // MOST_POINTS + 1].astype(float)
    out = []
    for index, (view, mask) in enumerate(zip(reconstruction.views, masks.masks, strict=True)):
        if mask.sum() >= LEAST_MASK_PX:
            out.append(_object_view(index, view, mask, world_from_gv, points))
    return out


def depth_noise(views: list[ObjectView], points_gv: Float[np.ndarray, "n 3"]) -> float:
    """Return the robust spread (metres) of masked depths about the fused points.

    Only the nearer half of the deviations is used, so points behind the seen surface, which
    a view does not see, do not count as noise. 0 where nothing can be compared.
    """
    points = points_gv[:: len(points_gv) // MOST_POINTS + 1]
    deviations = []
    for view in views:
        pixels, z = project(points, view.K, view.camera_from_gv)
        row, column, inside = _pixel_index(pixels, view.depth.shape)
        depth = view.depth[row, column]
        seen = inside & (depth > 0)
        deviations.append((depth - z)[seen])
    gap = np.concatenate(deviations) if deviations else np.zeros(0)
    in_front = gap[gap >= 0]
    return float(np.median(in_front)) * 1.4826 if len(in_front) else 0.0


def _object_view(
    index: int,
    view: View,
    mask: Bool[np.ndarray, "h w"],
    world_from_gv: Float[np.ndarray, "4 4"],
    points_gv: Float[np.ndarray, "n 3"],
) -> ObjectView:
    size = float(np.linalg.norm(np.ptp(points_gv, axis=0))) if len(points_gv) else 0.0
    mask = _without_flush_holes(mask, np.asarray(view.depth, np.float32), FLUSH * size)
    camera_from_gv = np.eye(4)
    camera_from_gv[:3] = view.camera_from_world[:3] @ world_from_gv
    raw = np.asarray(view.depth, np.float32)
    outside = signed_outline_distance(mask)
    cosine = _viewing_cosine(raw, view.K, mask)
    rim = np.clip(-outside / RIM_PX, 0.1, 1.0)
    weight = np.clip(view.confidence, 0.05, 1.0) * cosine * rim
    depth = np.where(mask, raw, 0.0).astype(np.float32)
    return ObjectView(
        index=index,
        K=view.K,
        camera_from_gv=camera_from_gv,
        mask=mask,
        outside_px=outside,
        depth=depth,
        filled_depth=_fill_nearest(depth),
        occluder_depth=_fill_nearest(np.where(mask, 0.0, raw).astype(np.float32)),
        weight=weight.astype(np.float32),
        cosine=cosine,
        unknown=_missed_by_mask(points_gv, view, camera_from_gv, mask, FLUSH * size),
    )


def _without_flush_holes(
    mask: Bool[np.ndarray, "h w"], depth: Float[np.ndarray, "h w"], tolerance: float
) -> Bool[np.ndarray, "h w"]:
    """Fill holes of the mask that are as deep as the object around them, such as print on it.

    Holes that show something further away, or of which nothing is known, stay.
    """
    pieces, count = ndimage.label(~mask)
    if count < 2:
        return mask
    around = _fill_nearest(np.where(mask, depth, 0.0).astype(np.float32))
    with np.errstate(invalid="ignore"):
        flush = (depth > 0) & (np.abs(depth - around) < tolerance)
    border = np.unique(np.concatenate([pieces[[0, -1]].ravel(), pieces[:, [0, -1]].ravel()]))
    measured = np.bincount(pieces.ravel(), weights=(depth > 0).ravel(), minlength=count + 1)
    agreeing = np.bincount(pieces.ravel(), weights=flush.ravel(), minlength=count + 1)
    fill = (agreeing > 0.5 * measured) & (measured > 0)
    fill[border] = False
    fill[0] = False
    return mask | fill[pieces]


def signed_outline_distance(mask: Bool[np.ndarray, "h w"]) -> Float[np.ndarray, "h w"]:
    """Return the distance of pixel centres to the mask's outline, negative inside (pixels).

    The picture's border is no outline: the object may go on beyond it.
    """
    inside = np.ascontiguousarray(mask, np.uint8)
    to_outside = _distance_to_zero(inside)
    to_inside = _distance_to_zero(1 - inside)
    return np.where(mask, 0.5 - to_outside, to_inside - 0.5).astype(np.float32)


def _distance_to_zero(image: np.ndarray) -> Float[np.ndarray, "h w"]:
    if image.all():
        return np.full(image.shape, float(sum(image.shape)), np.float32)
    return cv2.distanceTransform(image, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)


def _viewing_cosine(
    depth: Float[np.ndarray, "h w"], K: Float[np.ndarray, "3 3"], mask: Bool[np.ndarray, "h w"]
) -> Float[np.ndarray, "h w"]:
    """Return |cos| between viewing ray and surface, from depth differences inside the mask.

    It is ``LEAST_COSINE`` where depth is missing or the surface is seen flatter than that.
    """
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    top, left = max(int(rows[0]) - 3, 0), max(int(columns[0]) - 3, 0)
    window = (slice(top, int(rows[-1]) + 4), slice(left, int(columns[-1]) + 4))
    shifted = K - np.array([[0, 0, left], [0, 0, top], [0, 0, 0]])
    smooth = cv2.medianBlur(np.ascontiguousarray(depth[window]), 3)
    points = backproject_depth(smooth, shifted, np.eye(4)[:3])
    normal = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0))
    length = np.linalg.norm(normal, axis=2) * np.linalg.norm(points, axis=2)
    cosine = np.abs((normal * points).sum(axis=2)) / np.maximum(length, 1e-12)
    hole = cv2.dilate((smooth <= 0).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    out = np.full(depth.shape, LEAST_COSINE, np.float32)
    out[window] = np.where(hole, LEAST_COSINE, np.clip(cosine, LEAST_COSINE, 1.0))
    return out


def _fill_nearest(depth: Float[np.ndarray, "h w"]) -> Float[np.ndarray, "h w"]:
    """Give pixels without depth that of the nearest pixel that has one."""
    if not (depth > 0).any():
        return np.full(depth.shape, np.inf, np.float32)
    labels = cv2.distanceTransformWithLabels(
        (depth <= 0).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )[1]
    of_label = np.zeros(int(labels.max()) + 1, np.float32)
    valid = depth > 0
    of_label[labels[valid]] = depth[valid]
    return of_label[labels]


def _missed_by_mask(
    points_gv: Float[np.ndarray, "n 3"],
    view: View,
    camera_from_gv: Float[np.ndarray, "4 4"],
    mask: Bool[np.ndarray, "h w"],
    tolerance: float,
) -> Bool[np.ndarray, "h w"]:
    """Mark pixels outside the mask at which the view's own depth agrees with object points.

    Such a pixel shows the object: the mask has an error there and must not carve it.
    """
    missed = np.zeros(mask.shape, np.uint8)
    pixels, z = project(points_gv, view.K, camera_from_gv)
    row, column, inside = _pixel_index(pixels, mask.shape)
    depth = view.depth[row, column]
    same = inside & (depth > 0) & (np.abs(depth - z) < tolerance) & ~mask[row, column]
    missed[row[same], column[same]] = 1
    # A single stray point proves nothing: two more must lie in the 5x5 pixels around it.
    count = cv2.boxFilter(missed.astype(np.float32), -1, (5, 5), normalize=False)
    missed[count < 3] = 0
    return (cv2.dilate(missed, np.ones((3, 3), np.uint8)) > 0) & ~mask


def _pixel_index(
    pixels: Float[np.ndarray, "n 2"], shape: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray, Bool[np.ndarray, " n"]]:
    """Return rows, columns (clamped) and which pixels lie inside the picture."""
    finite = np.nan_to_num(pixels, nan=-1.0, posinf=-1.0, neginf=-1.0)
    inside = (finite >= 0).all(axis=1) & (finite[:, 0] < shape[1]) & (finite[:, 1] < shape[0])
    column = np.clip(finite[:, 0], 0, shape[1] - 1).astype(int)
    row = np.clip(finite[:, 1], 0, shape[0] - 1).astype(int)
    return row, column, inside
