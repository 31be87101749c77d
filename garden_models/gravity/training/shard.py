"""Keep the evidence of many scenes in half precision, each with its true direction down."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float, Int

from garden_models.gravity.decoder.evidence import ViewEvidence
from garden_models.progress import Progress, silent

_HALF = ("place", "normal", "normal_weight", "line", "line_sigma", "line_weight")


@dataclass(frozen=True)
class EvidenceShard:
    """Evidence of scenes, their views one after the other; scene k owns the views
    ``start[k]:start[k + 1]``. See ``ViewEvidence``; ``down`` is the true direction.
    """

    SCHEMA: ClassVar[str] = "garden.EvidenceShard/1"
    rotation: Float[np.ndarray, "v 3 3"]
    centre: Float[np.ndarray, "v 3"]
    place: Float[np.ndarray, "v p 3"]
    normal: Float[np.ndarray, "v p 3"]
    normal_weight: Float[np.ndarray, "v p"]
    line: Float[np.ndarray, "v s 3"]
    line_sigma: Float[np.ndarray, "v s"]
    line_weight: Float[np.ndarray, "v s"]
    reference: Int[np.ndarray, " scenes"]
    start: Int[np.ndarray, " scenes_1"]
    down: Float[np.ndarray, "scenes 3"]

    def __len__(self) -> int:
        return len(self.down)

    @property
    def views(self) -> Int[np.ndarray, " scenes"]:
        """The number of views of each scene."""
        return np.diff(self.start)

    def scene(self, k: int) -> ViewEvidence:
        """Return one scene's evidence."""
        rows = slice(int(self.start[k]), int(self.start[k + 1]))
        parts = {name: getattr(self, name)[rows].astype(np.float64) for name in _HALF}
        return ViewEvidence(
            rotation=self.rotation[rows].astype(np.float64),
            centre=self.centre[rows].astype(np.float64),
            reference=int(self.reference[k]),
            **parts,
        )


def shard_of(scenes: list[tuple[ViewEvidence, Float[np.ndarray, "3"]]]) -> EvidenceShard:
    """Return scenes with their true directions down as one shard."""
    evidence = [scene for scene, _ in scenes]
    halves = {
        name: np.concatenate([getattr(e, name) for e in evidence]).astype(np.float16)
        for name in _HALF
    }
    return EvidenceShard(
        rotation=np.concatenate([e.rotation for e in evidence]).astype(np.float32),
        centre=np.concatenate([e.centre for e in evidence]).astype(np.float32),
        reference=np.array([e.reference for e in evidence]),
        start=np.concatenate([[0], np.cumsum([len(e) for e in evidence])]),
        down=np.stack([down for _, down in scenes]).astype(np.float64),
        **halves,
    )


def joined(shards: tuple[EvidenceShard, ...]) -> EvidenceShard:
    """Return shards as one."""
    parts = {
        name: np.concatenate([getattr(s, name) for s in shards])
        for name in ("rotation", "centre", "reference", "down", *_HALF)
    }
    views = np.concatenate([s.views for s in shards])
    return EvidenceShard(start=np.concatenate([[0], np.cumsum(views)]), **parts)


def make_shard(split: str, first: int, count: int, progress: Progress = silent) -> EvidenceShard:
    """Return the procedural scenes ``first`` and following of a split."""
    from garden_models.gravity.training.scenes.observe import training_scene
    from garden_models.gravity.training.splits import SPLITS

    known = next(name for name in SPLITS if name == split)
    scenes = []
    for k in range(count):
        progress(k / count, f"scene {k} of {count}")
        scenes.append(training_scene(known, first + k))
    return shard_of(scenes)
