"""Keep the features and matches of a capture's photos while settings escalate."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pycolmap
from jaxtyping import Int

from garden_models.progress import Progress, silent
from garden_models.reconstruction.registration_database import verify_pairs, write_database
from garden_models.reconstruction.registration_features import Features, detect_features
from garden_models.reconstruction.registration_matching import (
    Matching,
    Pair,
    choose_pairs,
    match_pairs,
    second_look,
)
from garden_models.scene import Photo


class PhotoMatcher:
    """Features and matches of some photos, and COLMAP's database of them."""

    def __init__(
        self, photos: Sequence[Photo], config: Matching, threads: int, seed: int, workspace: Path
    ) -> None:
        self.photos = photos
        self.database = workspace / "matches.db"
        self._config = config
        self._threads = threads
        self._seed = seed
        self._count = 0
        self._features: list[Features] = []
        self._matches: dict[Pair, Int[np.ndarray, "m 2"]] = {}

    def match(
        self, count: int, badly_connected: Sequence[int], progress: Progress = silent
    ) -> bool:
        """Match ``count`` features a photo; return False if that is done already.

        The first time all pairs are matched (or those that ``choose_pairs`` takes); with
        more features only the badly connected photos are, since features are ranked and
        the earlier matches stay valid.
        """
        if count == self._count:
            return False
        first = self._count == 0
        self._count = count
        self._features = self._detect(count, progress)
        if first:
            pairs = choose_pairs(self._features, self._config)
        else:
            partners = self._config.second_look_partners
            pairs = second_look(badly_connected, self._matches, len(self.photos), partners)

        def matching(share: float, doing: str) -> None:
            progress(0.3 + 0.5 * share, doing)

        self._matches.update(match_pairs(self._features, pairs, self._config, matching))
        return True

    def write(
        self,
        cameras: Sequence[pycolmap.Camera],
        camera_of_photo: Sequence[int],
        progress: Progress = silent,
    ) -> None:
        """Write a new database and verify the matches of each pair in it."""
        progress(0.8, "checking matches against epipolar geometry")
        write_database(
            self.database, self.photos, cameras, camera_of_photo, self._features, self._matches
        )
        verify_pairs(self.database, self._seed, self._threads)

    def verified(self) -> dict[Pair, int]:
        """Return the number of verified matches of each pair of photo indices."""
        with pycolmap.Database.open(self.database) as database:
            pair_ids, counts = database.read_two_view_geometry_num_inliers()
        found = {}
        for pair_id, count in zip(pair_ids, counts, strict=True):
            a, b = pycolmap.pair_id_to_image_pair(pair_id)
            found[min(a, b) - 1, max(a, b) - 1] = int(count)
        return found

    def _detect(self, count: int, progress: Progress) -> list[Features]:
        with ThreadPoolExecutor(self._threads) as pool:
            jobs = [pool.submit(detect_features, photo.rgb, count) for photo in self.photos]
            features = []
            for done, (photo, job) in enumerate(zip(self.photos, jobs, strict=True)):
                progress(0.3 * done / len(self.photos), f"finding features in {photo.name}")
                features.append(job.result())
        return features
