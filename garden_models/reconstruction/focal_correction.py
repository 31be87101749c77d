"""Find the focal length that the photos' matches tell, where the given one contradicts them.

Published intrinsics are sometimes those of another camera of the rig, or of another size of
the photo: the poses are right, all focal lengths are off by one factor. With the poses held
fixed the matches tell the factor: rays that leave the camera too narrow or too wide miss
their epipolar lines (self-calibration with known motion; Hartley and Zisserman, chapter 19).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize_scalar

from garden_models.reconstruction.known_cameras import RayMatches, epipolar_error
from garden_models.reconstruction.registration_config import FocalTrust
from garden_models.scene import KnownCamera, Photo

STEPS = 41
"""Factors tried over the range before the best one is refined."""
GROUPS = 10
"""Groups of photos that are left out in turn, at most."""
AROUND = 1.25
"""Factor about the best one within which the best without a group is looked for."""
MOST_MATCHES = 300
"""Matches of a pair that are looked at, evenly chosen: more tell the same."""


@dataclass(frozen=True)
class FocalCorrection:
    """One factor on all given focal lengths, and the mean epipolar error in pixels of the
    ingested photos with the given ones and with the factor (each match's error capped).
    """

    factor: float
    given_error_px: float
    error_px: float


def correct_focal(pairs: Sequence[RayMatches], trust: FocalTrust) -> FocalCorrection | None:
    """Return the factor on the focal lengths that explains the matches much better than 1.

    ``pairs`` are verified matches as rays of the given cameras. None, and the given cameras
    stand, where the gain or the change is small, the factor hangs on single photos, too few
    pairs gain, too few matches have parallax (a camera that only turns), or most contradict
    any factor.
    """
    pairs = [_thinned(pair) for pair in pairs if len(pair.rays_a)]
    if not pairs:
        return None
    # A camera that turns on the spot seems to have parallax while the focal length is wrong.
    first = best_factor(pairs, trust)
    pairs = [pair for pair in pairs if parallax_deg(pair, first) >= trust.parallax_deg]
    matches = sum(len(pair.rays_a) for pair in pairs)
    if len(pairs) < trust.fewest_pairs or matches < trust.fewest_matches:
        return None
    factor = best_factor(pairs, trust)
    found = FocalCorrection(factor, mean_error_px(pairs, 1.0), mean_error_px(pairs, factor))
    return found if _is_significant(found, pairs, trust) else None


def best_factor(pairs: Sequence[RayMatches], trust: FocalTrust) -> float:
    """Return the factor within ``trust.smallest``..``trust.largest`` of least mean error."""
    tried = np.geomspace(trust.smallest, trust.largest, STEPS)
    best = int(np.argmin([mean_error_px(pairs, factor) for factor in tried]))
    return _refined(pairs, tried[max(best - 1, 0)], tried[min(best + 1, STEPS - 1)])


def factor_sigma(pairs: Sequence[RayMatches], factor: float) -> float:
    """Return the standard error of the best factor, by leaving out photos (jackknife).

    Poses err photo by photo, so that the matches of a photo are not independent.
    """
    photos = sorted({photo for pair in pairs for photo in pair.photos})
    count = min(GROUPS, len(photos))
    factors = []
    for group in range(count):
        left_out = set(photos[group::count])
        kept = [pair for pair in pairs if left_out.isdisjoint(pair.photos)]
        if not kept:
            return np.inf
        factors.append(_refined(kept, factor / AROUND, factor * AROUND))
    return float(np.sqrt((count - 1) * np.var(factors)))


def mean_error_px(pairs: Sequence[RayMatches], factor: float) -> float:
    """Return the mean capped epipolar error of all matches, in pixels."""
    return float(np.concatenate([errors_px(pair, factor) for pair in pairs]).mean())


def errors_px(pair: RayMatches, factor: float) -> Float[np.ndarray, " n"]:
    """Return each match's epipolar error in pixels with focal lengths times ``factor``.

    Errors are capped at the distance from which a match contradicts its cameras, so that
    wrong matches count alike whatever the factor.
    """
    error = epipolar_error(pair.rays_a / factor, pair.rays_b / factor, pair.b_from_a)
    return np.minimum(error * pair.focal_px * factor, pair.limit_px)


def parallax_deg(pair: RayMatches, factor: float) -> float:
    """Return the median angle under which the pair's matched points see its baseline."""
    a, b = (
        np.hstack([rays / factor, np.ones((len(rays), 1))]) for rays in (pair.rays_a, pair.rays_b)
    )
    lengths = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    cosines = ((a @ pair.b_from_a[:3, :3].T) * b).sum(1) / lengths
    return float(np.median(np.degrees(np.arccos(np.clip(cosines, -1, 1)))))


def with_focal_factor(camera: KnownCamera, factor: float) -> KnownCamera:
    """Return the camera with its focal lengths times ``factor``.

    Where the lens moves a pixel stays the same: the coefficients, which are for offsets over
    the focal length, are scaled against it.
    """
    K = np.array(camera.K, dtype=np.float64)
    K[:2, :2] *= factor
    powers = np.array([factor**2, factor**4, factor, factor])
    return replace(camera, K=K, distortion=camera.distortion * powers)


def correction_remark(
    correction: FocalCorrection, known: Sequence[KnownCamera], photos: Sequence[Photo]
) -> str:
    """Say in pixels of the photo files what was given, what is used and why.

    ``known[i]`` is the given camera of ``photos[i]``.
    """
    focal_px = [
        camera.K[0, 0] * photo.original_size[0] / photo.rgb.shape[1]
        for camera, photo in zip(known, photos, strict=True)
    ]
    given = float(np.median(focal_px))
    return (
        f"the given focal length {given:.0f} px disagrees with the photos; "
        f"{given * correction.factor:.0f} px used: with the given poses, matching points miss "
        f"their epipolar lines by {correction.error_px:.1f} instead of "
        f"{correction.given_error_px:.1f} px "
        "(--set register.correct_focal=false keeps the given one)"
    )


def _is_significant(found: FocalCorrection, pairs: Sequence[RayMatches], trust: FocalTrust) -> bool:
    if abs(found.factor - 1) < trust.least_change:
        return False
    if found.error_px > (1 - trust.least_gain) * found.given_error_px:
        return False
    # At the end of the range there is no best factor, only a direction.
    if not trust.smallest * 1.01 < found.factor < trust.largest / 1.01:
        return False
    gains = [errors_px(p, found.factor).mean() < errors_px(p, 1.0).mean() for p in pairs]
    agreeing = np.concatenate([errors_px(p, found.factor) < p.limit_px for p in pairs])
    return (
        float(np.mean(gains)) >= trust.pairs_that_gain
        and float(agreeing.mean()) >= trust.agreeing_share
        and abs(found.factor - 1) >= trust.least_sigmas * factor_sigma(pairs, found.factor)
    )


def _refined(pairs: Sequence[RayMatches], smallest: float, largest: float) -> float:
    found = minimize_scalar(
        lambda factor: mean_error_px(pairs, factor),
        bounds=(smallest, largest),
        options={"xatol": 1e-4},
    )
    return float(found.x)


def _thinned(pair: RayMatches) -> RayMatches:
    keep = slice(None, None, -(-len(pair.rays_a) // MOST_MATCHES))
    return replace(pair, rays_a=pair.rays_a[keep], rays_b=pair.rays_b[keep])
