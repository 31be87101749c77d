"""Matching against a plain float64 implementation; which pairs are tried."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from garden_models.reconstruction.registration_features import Features, root_sift
from garden_models.reconstruction.registration_matching import (
    Matching,
    choose_pairs,
    match_descriptors,
    second_look,
)


def random_features(rng: np.random.Generator, count: int) -> Features:
    raw = rng.random((count, 128)).astype(np.float32) ** 4
    return Features(rng.random((count, 4)).astype(np.float32), root_sift(raw))


def noisy_copy(rng: np.random.Generator, features: Features, shared: int, extra: int) -> Features:
    raw = (features.descriptors[:shared].astype(np.float32) / 512) ** 2
    raw = raw + 0.002 * rng.random(raw.shape).astype(np.float32)
    other = random_features(rng, extra)
    descriptors = np.concatenate([root_sift(raw), other.descriptors])
    keypoints = np.concatenate([features.keypoints[:shared], other.keypoints])
    order = rng.permutation(len(descriptors))
    return Features(keypoints[order], descriptors[order])


def plain_matches(a: Features, b: Features, ratio: float) -> set[tuple[int, int]]:
    cosine = a.descriptors.astype(float) @ b.descriptors.astype(float).T / 512**2
    angle = np.arccos(np.minimum(cosine, 1))

    def best(angles: np.ndarray) -> dict[int, int]:
        found = {}
        for i, row in enumerate(angles):
            first, second = np.argsort(row, kind="stable")[:2]
            if row[first] < ratio * row[second] and row[first] < Matching().max_angle_rad:
                found[i] = int(first)
        return found

    forth, back = best(angle), best(angle.T)
    return {(i, j) for i, j in forth.items() if back.get(j) == i}


def test_matches_are_those_of_the_plain_implementation() -> None:
    rng = np.random.default_rng(0)
    a = random_features(rng, 200)
    b = noisy_copy(rng, a, 120, 60)
    found = {(int(i), int(j)) for i, j in match_descriptors(a, b, 0.8, Matching())}
    assert found == plain_matches(a, b, 0.8)
    assert len(found) > 50


def test_matching_is_symmetric() -> None:
    rng = np.random.default_rng(1)
    a = random_features(rng, 150)
    b = noisy_copy(rng, a, 80, 50)
    forth, back = match_descriptors(a, b, 0.8, Matching()), match_descriptors(b, a, 0.8, Matching())
    assert {tuple(m) for m in forth} == {tuple(m[::-1]) for m in back}


def test_empty_photos_match_nothing() -> None:
    rng = np.random.default_rng(2)
    none = random_features(rng, 0)
    assert match_descriptors(none, random_features(rng, 9), 0.8, Matching()).shape == (0, 2)


def test_few_photos_are_matched_exhaustively() -> None:
    rng = np.random.default_rng(3)
    features = [random_features(rng, 5) for _ in range(6)]
    assert choose_pairs(features, 0.8, Matching()) == list(combinations(range(6), 2))


def test_many_photos_are_matched_with_neighbours_and_look_alikes() -> None:
    rng = np.random.default_rng(4)
    features = [random_features(rng, 30) for _ in range(12)]
    features[11] = noisy_copy(rng, features[0], 25, 5)  # the path closes its loop
    config = Matching(exhaustive_up_to=10, sequential_window=2, similar_photos=1)
    pairs = choose_pairs(features, 0.8, config)
    assert (0, 11) in pairs
    assert all((i, i + 1) in pairs for i in range(11))
    assert len(pairs) < 30


def test_second_look_pairs_each_bad_photo_with_its_best_partners() -> None:
    matches = {(0, 3): np.zeros((9, 2), np.uint32), (1, 3): np.zeros((4, 2), np.uint32)}
    assert second_look([3], matches, 6, 3) == [(0, 3), (1, 3), (2, 3)]
