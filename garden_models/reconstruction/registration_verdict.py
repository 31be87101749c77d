"""Say how good a registration is, and what to do about what is missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from garden_models.reconstruction.registration_config import Expectation
from garden_models.reconstruction.registration_matching import Pair
from garden_models.scene import Verdict

REMEDY = "take more photos between them and the others, each overlapping the next by half or more"


def judge(
    photos: Sequence[str],
    registered: Sequence[str],
    confirmed: Sequence[int],
    verified: Mapping[Pair, int],
    expectation: Expectation,
) -> Verdict:
    """Return the verdict on placed photos.

    ``confirmed`` are the confirmed points of each registered photo, ``verified`` the
    matches that hold between two photos (by index).
    """
    missing = [name for name in photos if name not in set(registered)]
    if not registered:
        reason = (
            f"no two of the {len(photos)} photos overlap enough to place cameras "
            f"({best_pair(photos, verified)}; unregistered: {', '.join(missing)}); take photos "
            "of textured surroundings, each overlapping the next by half or more, moving "
            "sideways between them"
        )
        return Verdict("failed", (reason,))
    share = len(registered) / len(photos)
    if len(registered) < expectation.fewest_photos or share <= expectation.share_above:
        reason = (
            f"only {len(registered)} of {len(photos)} photos overlap enough to be placed "
            f"together (unregistered: {', '.join(missing)}); {REMEDY}"
        )
        return Verdict("failed", (reason,))
    verdict = Verdict()
    if missing:
        reason = (
            f"{len(missing)} of {len(photos)} photos could not be registered "
            f"({', '.join(missing)}); {REMEDY}"
        )
        verdict = verdict.worst(Verdict("degraded", (reason,)))
    median = sorted(confirmed)[len(confirmed) // 2]
    if median < expectation.confirmed_points:
        reason = (
            f"the cameras rest on few points (the median photo shares {median} with two "
            "others) and may be wrong; take more photos of textured surroundings, closer together"
        )
        verdict = verdict.worst(Verdict("degraded", (reason,)))
    return verdict


def judge_without_camera(photos: Sequence[str]) -> Verdict:
    """Return the verdict on photos that the given cameras leave out."""
    if not photos:
        return Verdict()
    reason = (
        f"the given cameras name no camera for {', '.join(photos)}; these photos are left out: "
        "add them to the file of cameras, or remove them"
    )
    return Verdict("degraded", (reason,))


def best_pair(photos: Sequence[str], verified: Mapping[Pair, int]) -> str:
    """Say how much the best pair of photos shares."""
    if not verified or max(verified.values()) == 0:
        return "no pair shares matching points"
    i, j = max(verified, key=lambda pair: (verified[pair], pair))
    return f"the best pair, {photos[i]} and {photos[j]}, shares {verified[i, j]} matching points"
