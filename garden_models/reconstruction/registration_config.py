"""Hold the settings of registration."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True)
class Look:
    """How closely photos are looked at.

    ``features`` a photo, with affine shapes or without; ``max_ratio`` of the angles to the
    best and the second best descriptor; ``min_inlier_ratio`` of a pair's matches must agree
    with one geometry (0: their number alone counts).
    """

    features: int
    affine: bool = False
    max_ratio: float = 0.8
    min_inlier_ratio: float = 0.0


@dataclass(frozen=True)
class Rung:
    """One setting of features and mapper; later rungs accept weaker evidence.

    The first pair must have ``start_inliers`` matches and a triangulation angle of
    ``start_angle_deg``, and may move forward at most ``start_forward`` (1 = straight
    ahead); a further photo needs ``pose_inliers`` points that it sees again.
    """

    name: str
    look: Look
    mapper: Literal["incremental", "global"] = "incremental"
    start_inliers: int = 100
    start_angle_deg: float = 16.0
    start_forward: float = 0.95
    pose_inliers: int = 30


FIRST_LOOK = Look(features=4096)


SECOND_LOOK = Look(features=8192, affine=True, max_ratio=0.9, min_inlier_ratio=0.15)


LADDER = (
    Rung("4096 features", FIRST_LOOK),
    Rung("4096 features, wide start", FIRST_LOOK, "incremental", 50, 4.0, 1.0, 15),
    Rung("affine features", SECOND_LOOK),
    Rung("affine features, wide start", SECOND_LOOK, "incremental", 50, 4.0, 1.0, 15),
    Rung("affine features, global mapper", SECOND_LOOK, "global"),
)
"""A wide start costs a second with the matches at hand, another look a minute; so each look
is tried with both."""


@dataclass(frozen=True)
class Matching:
    """How descriptors are matched and which pairs are tried."""

    max_angle_rad: float = 0.7  # between matching descriptors
    exhaustive_up_to: int = 60  # photos; beyond it pairs are chosen
    sequential_window: int = 10  # following photos tried for each, beyond
    similar_photos: int = 20  # most similar photos tried for each, beyond
    similarity_features: int = 512  # largest features that tell similarity
    second_look_partners: int = 15  # photos that a badly connected one is matched with again


@dataclass(frozen=True)
class Expectation:
    """What a registration must reach."""

    fewest_photos: int = 3  # registered; fewer are no reconstruction
    share_above: float = 0.5  # of the photos must be registered together, more than this
    confirmed_points: int = 30  # that the median photo shares with two others, else degraded


@dataclass(frozen=True)
class CameraTrust:
    """When given cameras count as right: share of verified matches that agree with them."""

    failed_below: float = 0.2
    degraded_below: float = 0.5


@dataclass(frozen=True)
class FocalTrust:
    """When one factor on all given focal lengths is used, because the matches tell it.

    Calibrations that are right differ from the best factor by up to 1.5 %, which gains up
    to 4 % (measured on captures with a phone's, a Kinect's and rendered cameras).
    """

    least_change: float = 0.03  # of the focal length
    least_gain: float = 0.2  # share of the mean epipolar error that must vanish
    least_sigmas: float = 4.0  # of the change, over what leaving out photos changes
    pairs_that_gain: float = 0.75  # share of the pairs
    agreeing_share: float = 0.5  # of the matches must then agree with the poses
    fewest_pairs: int = 3  # with parallax
    fewest_matches: int = 200  # of these pairs
    parallax_deg: float = 2.0  # a pair's median from which it counts
    smallest: float = 0.5  # factor that is tried
    largest: float = 2.0


@dataclass(frozen=True)
class Registration:
    """How photos are registered."""

    ladder: tuple[Rung, ...] = LADDER
    matching: Matching = field(default_factory=Matching)
    expectation: Expectation = field(default_factory=Expectation)
    trust: CameraTrust = field(default_factory=CameraTrust)
    correct_focal: bool = True  # where given cameras contradict the photos
    focal: FocalTrust = field(default_factory=FocalTrust)
    camera_model: str = "SIMPLE_RADIAL"  # COLMAP's name; one radial coefficient
    fewest_confirmed: int = 15  # points that a photo must share with two others
    threads: int = 2  # for features and matches, whose results do not depend on them
    mapper_threads: int = 1  # with more, COLMAP's last bits differ from run to run
    seed: int = 0
