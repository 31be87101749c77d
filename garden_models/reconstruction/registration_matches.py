"""Keep the features and matches of a capture's photos while settings escalate."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pycolmap
from jaxtyping import Int

from garden_models.progress import Progress, silent
from garden_models.reconstruction.registration_config import Look, Matching
from garden_models.reconstruction.registration_database import verify_pairs, write_database
from garden_models.reconstruction.registration_features import (
    Features,
    detect_affine_features,
    detect_features,
)
from garden_models.reconstruction.registration_matching import (
    Pair,
    choose_pairs,
    match_pairs,
    second_look,
)
from garden_models.scene import Photo

NO_FEATURES = Features(np.zeros((0, 4), np.float32), np.zeros((0, 128), np.uint8))
NO_MATCHES = np.zeros((0, 2), np.uint32)


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
        self._look: Look | None = None
        self._features = [NO_FEATURES for _ in photos]
        self._matches: dict[Pair, Int[np.ndarray, "m 2"]] = {}

    def match(
        self, look: Look, badly_connected: Sequence[int], progress: Progress = silent
    ) -> bool:
        """Look for features and match them; return False if this look was the last one.

        The first look matches all pairs (or those that ``choose_pairs`` takes), another one
        those of badly connected photos; its features and matches join the earlier ones.
        """
        if look == self._look:
            return False
        found = self._detect(look, progress)
        if self._look is None:
            pairs = choose_pairs(found, look.max_ratio, self._config)
        else:
            partners = self._config.second_look_partners
            pairs = second_look(badly_connected, self._matches, len(self.photos), partners)

        def matching(share: float, doing: str) -> None:
            progress(0.3 + 0.5 * share, doing)

        matches = match_pairs(found, pairs, look.max_ratio, self._config, matching)
        for (i, j), indices in matches.items():
            offset = np.array([len(self._features[i]), len(self._features[j])], np.uint32)
            earlier = self._matches.get((i, j), NO_MATCHES)
            self._matches[i, j] = np.concatenate([earlier, indices + offset])
        self._features = [old.joined(new) for old, new in zip(self._features, found, strict=True)]
        self._look = look
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
        ratio = 0.0 if self._look is None else self._look.min_inlier_ratio
        verify_pairs(self.database, self._seed, self._threads, ratio)

    def verified(self) -> dict[Pair, int]:
        """Return the number of verified matches of each pair of photo indices."""
        with pycolmap.Database.open(self.database) as database:
            pair_ids, counts = database.read_two_view_geometry_num_inliers()
        found = {}
        for pair_id, count in zip(pair_ids, counts, strict=True):
            a, b = pycolmap.pair_id_to_image_pair(pair_id)
            found[min(a, b) - 1, max(a, b) - 1] = int(count)
        return found

    def _detect(self, look: Look, progress: Progress) -> list[Features]:
        detect = detect_affine_features if look.affine else detect_features
        with ThreadPoolExecutor(self._threads) as pool:
            jobs = [pool.submit(detect, photo.rgb, look.features) for photo in self.photos]
            features = []
            for done, (photo, job) in enumerate(zip(self.photos, jobs, strict=True)):
                progress(0.3 * done / len(self.photos), f"finding features in {photo.name}")
                features.append(job.result())
        return features
