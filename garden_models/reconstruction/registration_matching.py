"""Choose pairs of photos and match their descriptors (mutual best, ratio test)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations

import numpy as np
import torch
from jaxtyping import Int

from garden_models.progress import Progress, silent
from garden_models.reconstruction.registration_config import Matching
from garden_models.reconstruction.registration_features import DESCRIPTOR_UNIT, Features

Pair = tuple[int, int]


def choose_pairs(features: Sequence[Features], max_ratio: float, config: Matching) -> list[Pair]:
    """Return the pairs to match: all of them, or for many photos neighbours and look-alikes.

    Beyond ``exhaustive_up_to`` photos a pair is tried if the photos follow each other
    within ``sequential_window``, or if one is among the ``similar_photos`` with which the
    other shares most matches of its largest features.
    """
    count = len(features)
    everything = list(combinations(range(count), 2))
    if count <= config.exhaustive_up_to:
        return everything
    largest = [f.first(config.similarity_features) for f in features]
    shared = np.zeros((count, count), np.int64)
    for i, j in everything:
        shared[i, j] = shared[j, i] = len(
            match_descriptors(largest[i], largest[j], max_ratio, config)
        )
    chosen = {(i, j) for i, j in everything if j - i <= config.sequential_window}
    for i in range(count):
        for j in np.argsort(-shared[i], kind="stable")[: config.similar_photos]:
            if shared[i, j] > 0:
                chosen.add((min(i, int(j)), max(i, int(j))))
    return sorted(chosen)


def second_look(
    badly_connected: Iterable[int],
    matches: Mapping[Pair, Int[np.ndarray, "m 2"]],
    photos: int,
    partners: int,
) -> list[Pair]:
    """Return the pairs to match again with more features.

    Each badly connected photo is paired with the ``partners`` photos with which it shares
    most matches so far; among equals, those that are nearest in the order come first.
    """
    chosen: set[Pair] = set()
    for i in badly_connected:
        others = [j for j in range(photos) if j != i]
        shared = {j: len(matches.get((min(i, j), max(i, j)), ())) for j in others}
        others.sort(key=lambda j: (-shared[j], abs(j - i), j))
        chosen.update((min(i, j), max(i, j)) for j in others[:partners])
    return sorted(chosen)


def match_descriptors(
    a: Features, b: Features, max_ratio: float, config: Matching
) -> Int[np.ndarray, "m 2"]:
    """Return index pairs that are each other's best match and pass the ratio test both ways.

    Descriptors are integers, so that their products are exact in float32 and the result
    does not depend on threads.
    """
    if len(a) < 2 or len(b) < 2:
        return np.zeros((0, 2), np.uint32)
    first = torch.from_numpy(a.descriptors).float()
    second = torch.from_numpy(b.descriptors).float()
    index_b, distinct = best_two(first, second, max_ratio, config)
    rows = torch.nonzero(distinct)[:, 0]
    columns, back = torch.unique(index_b[rows], return_inverse=True)
    index_a, distinct_back = best_two(second[columns], first, max_ratio, config)
    mutual = (index_a[back] == rows) & distinct_back[back]
    pairs = torch.stack([rows[mutual], index_b[rows[mutual]]], dim=1)
    return pairs.numpy().astype(np.uint32)


def best_two(
    queries: torch.Tensor, stored: torch.Tensor, max_ratio: float, config: Matching
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return each query's best stored index, and whether it is close and distinct enough."""
    if len(queries) == 0:
        return torch.zeros(0, dtype=torch.int64), torch.zeros(0, dtype=torch.bool)
    similarity, index = (queries @ stored.T).topk(2, dim=1)
    angle = torch.arccos((similarity / DESCRIPTOR_UNIT**2).clamp(max=1.0))
    good = (angle[:, 0] < max_ratio * angle[:, 1]) & (angle[:, 0] < config.max_angle_rad)
    return index[:, 0], good


def match_pairs(
    features: Sequence[Features],
    pairs: Sequence[Pair],
    max_ratio: float,
    config: Matching,
    progress: Progress = silent,
) -> dict[Pair, Int[np.ndarray, "m 2"]]:
    """Match all pairs; pairs without any match are left out."""
    found: dict[Pair, Int[np.ndarray, "m 2"]] = {}
    for done, (i, j) in enumerate(pairs):
        matches = match_descriptors(features[i], features[j], max_ratio, config)
        if len(matches):
            found[i, j] = matches
        progress((done + 1) / len(pairs), f"matching photos ({done + 1} of {len(pairs)} pairs)")
    return found
