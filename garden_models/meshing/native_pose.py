"""Judge the pose that a model gave with its mesh: does it lean, does it explain the photo?

A model's convention is read wrongly in silence: a quaternion's order, an up axis, a camera's
axes, a unit. The mesh then leans, misses its mask, fits better lying on a side, or has another
size than the object's points. Placement may still find where it belongs; it is said all the
same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from garden_models.geometry.camera import pixel_rays
from garden_models.geometry.rotation import axis_angle
from garden_models.geometry.upright import tilt_deg
from garden_models.meshing.extent import robust_bounds
from garden_models.meshing.mesh_model import MeshRequest
from garden_models.meshing.ray_casting import Hits, RayCaster

RAYS = 20_000
"""About how many pixels are compared."""

MOST_TILT_DEG = 10.0
"""A model's poses are some degrees off; what leans more does not stand as it was generated."""

LEAST_IOU = 0.6
"""A right shape whose pose is 20 degrees off overlaps its mask by more than this."""

BETTER_LYING = 0.1
"""Gain in IoU from which a mesh that is laid on a side fits better."""

MOST_DEPTH = 0.25
"""Share of the size by which measured and rendered depth may differ at the median."""

SIZE_RATIO = (0.5, 2.0)
"""Size of the mesh against that of the object's points, of which some sides are missing."""


@dataclass(frozen=True)
class NativePose:
    """How a model's own pose fits: its lean in degrees, the overlap of silhouette and mask
    (``lying_iou``: the best with the mesh on a side or its head), the median depth difference
    and the size, both against the object's own size.
    """

    tilt_deg: float
    mask_iou: float
    lying_iou: float
    depth_difference: float
    size_ratio: float

    def problems(self, name: str) -> tuple[str, ...]:
        """Return what is wrong with it, in sentences."""
        found = []
        if self.tilt_deg > MOST_TILT_DEG:
            found.append(
                f"{name!r} leans by {self.tilt_deg:.0f} degrees in the model's own pose: it does "
                "not stand as it was generated, or the pose is not in the expected convention"
            )
        if self.mask_iou < LEAST_IOU:
            found.append(
                f"in the model's own pose {name!r} covers its mask badly (IoU {self.mask_iou:.2f})"
            )
        if self.lying_iou > self.mask_iou + BETTER_LYING:
            found.append(
                f"the model's {name!r} covers its mask better when laid on a side (IoU "
                f"{self.lying_iou:.2f}): its up axis is not the expected one"
            )
        if self.depth_difference > MOST_DEPTH:
            found.append(
                f"in the model's own pose {name!r} is {self.depth_difference:.0%} of its size away "
                "from the measured depth"
            )
        if not SIZE_RATIO[0] <= self.size_ratio <= SIZE_RATIO[1]:
            found.append(
                f"the model's {name!r} is {self.size_ratio:.2g} times as large as its points"
            )
        return tuple(found)


@dataclass(frozen=True)
class _Photo:
    """Pixels of the photo: rays in the camera, mask and measured depth (NaN: none)."""

    rays: Float[np.ndarray, "n 3"]
    mask: Bool[np.ndarray, " n"]
    depth: Float[np.ndarray, " n"]


def judge_native_pose(
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    camera_from_mesh: Float[np.ndarray, "4 4"],
    gv_from_camera: Float[np.ndarray, "3 3"],
    request: MeshRequest,
    K: Float[np.ndarray, "3 3"],
    points_gv: Float[np.ndarray, "n 3"],
) -> NativePose:
    """Compare a mesh where the model put it with the photo's mask, depth and points."""
    scale = float(np.cbrt(abs(np.linalg.det(camera_from_mesh[:3, :3]))))
    size = scale * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    low, high = robust_bounds(points_gv)
    photo = _photo(request, K)
    caster = RayCaster(vertices, faces)
    hits = _cast(caster, photo, camera_from_mesh)
    both = (hits.face >= 0) & photo.mask & np.isfinite(photo.depth)
    away = np.abs(hits.distance[both] - photo.depth[both])
    lying = [_cast(caster, photo, camera_from_mesh @ turn) for turn in _laid_down()]
    return NativePose(
        tilt_deg=tilt_deg(gv_from_camera @ camera_from_mesh[:3, :3] / scale),
        mask_iou=_overlap(hits, photo, size),
        lying_iou=max(_overlap(one, photo, size) for one in lying),
        depth_difference=float(np.median(away)) / size if both.any() else float("inf"),
        size_ratio=size / max(float(np.linalg.norm(high - low)), 1e-12),
    )


def _photo(request: MeshRequest, K: Float[np.ndarray, "3 3"]) -> _Photo:
    height, width = request.mask.shape
    stride = max(1, int(np.sqrt(height * width / RAYS)))
    lattice = np.mgrid[0:height:stride, 0:width:stride]
    row, column = lattice[0].ravel(), lattice[1].ravel()
    return _Photo(
        pixel_rays(np.stack([column + 0.5, row + 0.5], 1), K),
        request.mask[row, column],
        request.points_camera[row, column, 2],
    )


def _cast(caster: RayCaster, photo: _Photo, camera_from_mesh: Float[np.ndarray, "4 4"]) -> Hits:
    """Return what the photo's rays hit of the mesh; distances are z-depths."""
    inverse = np.linalg.inv(camera_from_mesh)
    origins = np.tile(inverse[:3, 3], (len(photo.rays), 1))
    return caster.cast(origins, photo.rays @ inverse[:3, :3].T)


def _overlap(hits: Hits, photo: _Photo, size: float) -> float:
    """Return the IoU of silhouette and mask; what something nearer hides does not count."""
    hit = hits.face >= 0
    with np.errstate(invalid="ignore"):
        hidden = hit & ~photo.mask & (photo.depth < hits.distance - 0.02 * size)
    union = float(np.count_nonzero(photo.mask | (hit & ~hidden)))
    return float(np.count_nonzero(photo.mask & hit)) / max(union, 1.0)


def _laid_down() -> list[Float[np.ndarray, "4 4"]]:
    """Return the turns (4x4) that put another axis of the mesh upward."""
    out = []
    for axis, angles in ((0, (0.5, 1.0, 1.5)), (2, (0.5, 1.5))):
        for angle in angles:
            turn = np.eye(4)
            turn[:3, :3] = axis_angle(np.eye(3)[axis], angle * np.pi)
            out.append(turn)
    return out
