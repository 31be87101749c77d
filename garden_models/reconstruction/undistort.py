"""Bring registered photos to the working size: lens distortion removed, small, linear K."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from garden_models.geometry.camera import resize_intrinsics
from garden_models.scene import BadInput, Camera, Capture, SparseModel


@dataclass(frozen=True)
class WorkingView:
    """An undistorted photo at the working size with its pinhole camera (K at that size)."""

    photo: str
    rgb: UInt8[np.ndarray, "h w 3"]
    K: Float[np.ndarray, "3 3"]
    camera_from_world: Float[np.ndarray, "3 4"]
    original_size: tuple[int, int]
    distortion: Float[np.ndarray, "4"]

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.rgb.shape[1], self.rgb.shape[0]


def working_size(size: tuple[int, int], long_side: int) -> tuple[int, int]:
    """Return (width, height) with the long side at most ``long_side``, aspect kept."""
    scale = min(1.0, long_side / max(size))
    return max(1, round(size[0] * scale)), max(1, round(size[1] * scale))


def undistort(
    rgb: UInt8[np.ndarray, "h w 3"],
    K: Float[np.ndarray, "3 3"],
    distortion: Float[np.ndarray, " d"],
    size: tuple[int, int],
) -> UInt8[np.ndarray, "h2 w2 3"]:
    """Resample a photo to a pinhole of ``size`` with ``K`` scaled to it.

    ``K`` is for the photo as given. Border pixels that the photo does not cover repeat its
    edge. Shrinking averages areas first, so that nothing aliases.
    """
    height, width = rgb.shape[:2]
    small = rgb if (width, height) == size else cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
    if not np.any(distortion):
        return np.ascontiguousarray(small)
    K_cv = resize_intrinsics(K, (width, height), size)
    K_cv[:2, 2] -= 0.5  # OpenCV puts pixel centres at integers
    map_x, map_y = cv2.initUndistortRectifyMap(K_cv, distortion, None, K_cv, size, cv2.CV_32FC1)
    return cv2.remap(small, map_x, map_y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def working_views(capture: Capture, sparse: SparseModel, long_side: int) -> tuple[WorkingView, ...]:
    """Return the registered photos, in the order of ``sparse.cameras``, at the working size.

    Raises BadInput if a camera names a photo that the capture lacks.
    """
    photos = {photo.name: photo for photo in capture.photos}
    views = []
    for camera in sparse.cameras:
        if camera.photo not in photos:
            raise BadInput(
                f"The camera of {camera.photo!r} has no photo in the capture: "
                "register and densify the same capture."
            )
        photo = photos[camera.photo]
        views.append(_working_view(photo.rgb, photo.original_size, camera, long_side))
    return tuple(views)


def _working_view(
    rgb: UInt8[np.ndarray, "h w 3"],
    original_size: tuple[int, int],
    camera: Camera,
    long_side: int,
) -> WorkingView:
    stored_size = (rgb.shape[1], rgb.shape[0])
    size = working_size(stored_size, long_side)
    K_stored = resize_intrinsics(camera.K, camera.size, stored_size)
    distortion = np.zeros(4)
    distortion[: min(4, len(camera.distortion))] = camera.distortion[:4]
    return WorkingView(
        photo=camera.photo,
        rgb=undistort(rgb, K_stored, distortion, size),
        K=resize_intrinsics(K_stored, stored_size, size),
        camera_from_world=np.asarray(camera.camera_from_world[:3], dtype=np.float64),
        original_size=original_size,
        distortion=distortion,
    )
