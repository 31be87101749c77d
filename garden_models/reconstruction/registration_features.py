"""Detect SIFT features, the largest first; with affine shapes for wide baselines."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import pycolmap
from jaxtyping import Float, UInt8

DESCRIPTOR_UNIT = 512
"""Length of a quantised descriptor: integers this large keep matching exact in float32."""


SMALL_PHOTO_PX = 1000
"""Photos whose longer side is below this are doubled first: they have too few features."""


@dataclass(frozen=True)
class Features:
    """Ranked features of one photo.

    ``keypoints`` are x, y (pixel centres at +0.5), scale (pixels) and orientation
    (radians); ``descriptors`` are RootSIFT quantised to length ``DESCRIPTOR_UNIT``.
    """

    keypoints: Float[np.ndarray, "n 4"]
    descriptors: UInt8[np.ndarray, "n 128"]

    def __len__(self) -> int:
        return len(self.keypoints)

    def joined(self, more: Features) -> Features:
        """Return these features followed by ``more``."""
        return Features(
            np.concatenate([self.keypoints, more.keypoints]),
            np.concatenate([self.descriptors, more.descriptors]),
        )

    def first(self, count: int) -> Features:
        """Return the ``count`` best-ranked features."""
        return Features(self.keypoints[:count], self.descriptors[:count])


def detect_features(
    rgb: UInt8[np.ndarray, "h w 3"], count: int, contrast: float = 0.01
) -> Features:
    """Return at most ``count`` SIFT features, the largest first.

    Large features are found again from further away, and more often than those of high
    contrast (measured on wide baselines: about twice the verified matches), so a shorter
    list is a prefix of a longer one. ``contrast`` is OpenCV's threshold on the difference
    of Gaussians for grey values in 0..1, half of what COLMAP uses: dark corners and plain
    walls count.
    """
    grey, enlarged = large_grey(rgb)
    sift = cv2.SIFT.create(contrastThreshold=contrast, enable_precise_upscale=True)
    found = sift.detect(grey, None)
    size = np.array([k.size for k in found])
    xy = np.array([k.pt for k in found]).reshape(-1, 2)
    order = np.lexsort((xy[:, 0], xy[:, 1], -size))[:count]
    kept, descriptors = sift.compute(grey, [found[i] for i in order])
    if descriptors is None:
        return Features(np.zeros((0, 4), np.float32), np.zeros((0, 128), np.uint8))
    keypoints = np.array(
        [(k.pt[0] + 0.5, k.pt[1] + 0.5, k.size / 2, np.radians(k.angle)) for k in kept],
        np.float32,
    )
    keypoints[:, :3] /= enlarged
    return Features(keypoints, root_sift(descriptors))


def detect_affine_features(
    rgb: UInt8[np.ndarray, "h w 3"], count: int, contrast: float = 0.01
) -> Features:
    """Return at most ``count`` SIFT features of affine shape, the largest first.

    Each is brought to a round shape before it is described, so surfaces seen at a slant
    still match: several times the verified matches of ``detect_features`` on neighbours of
    a wide orbit, for three times its time (COLMAP's extractor).
    """
    grey, enlarged = large_grey(rgb)
    options = pycolmap.FeatureExtractionOptions(num_threads=1)
    options.sift.max_num_features = count
    options.sift.estimate_affine_shape = True
    options.sift.peak_threshold = contrast / 3  # per layer of an octave, as OpenCV divides
    found, descriptors = pycolmap.FeatureExtractor.create(options).extract_from_uint8_array(grey)
    if len(found) == 0:
        return Features(np.zeros((0, 4), np.float32), np.zeros((0, 128), np.uint8))
    keypoints = np.array(
        [(k.x, k.y, k.compute_scale(), k.compute_orientation()) for k in found], np.float32
    )
    keypoints[:, :3] /= enlarged
    order = np.lexsort((keypoints[:, 0], keypoints[:, 1], -keypoints[:, 2]))[:count]
    return Features(keypoints[order], np.asarray(descriptors.data)[order])


def large_grey(rgb: UInt8[np.ndarray, "h w 3"]) -> tuple[UInt8[np.ndarray, "h2 w2"], float]:
    """Return the grey photo, doubled if it is small, and the factor."""
    grey = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
    if max(grey.shape) >= SMALL_PHOTO_PX:
        return grey, 1.0
    return cv2.resize(grey, None, fx=2.0, fy=2.0, interpolation=cv2.INTER_CUBIC), 2.0


def root_sift(descriptors: Float[np.ndarray, "n 128"]) -> UInt8[np.ndarray, "n 128"]:
    """Return Hellinger-normalised descriptors (Arandjelovic 2012) as integers."""
    total = np.maximum(descriptors.sum(1, keepdims=True), 1e-9)
    root = np.sqrt(descriptors / total)
    return np.minimum(np.rint(root * DESCRIPTOR_UNIT), 255).astype(np.uint8)
