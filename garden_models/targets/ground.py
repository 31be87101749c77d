"""Find targets by their names: look in several photos, take each name where it is seen best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from garden_models.progress import Progress, silent
from garden_models.scene import BadInput, Capture, Photo, Target, Verdict
from garden_models.targets.answered_targets import clean_name
from garden_models.targets.box_convention import Box
from garden_models.targets.config import GroundTargets
from garden_models.targets.grounding_model import GroundingAnswer, GroundingRequest, GroundLabels
from garden_models.targets.proposal import TargetProposal
from garden_models.targets.repeats import overlap, with_own_names
from garden_models.targets.shown_photos import choose_photos


@dataclass(frozen=True)
class _Detection:
    photo: Photo
    label: int
    box: Box
    score: float


def ground_targets(
    capture: Capture,
    leave_out: Sequence[str],
    config: GroundTargets,
    ground: GroundLabels,
    progress: Progress = silent,
) -> TargetProposal:
    """Return the things of the given names; photos in ``leave_out`` are not looked at.

    All of one name come from one photo, that in which they score most together, since from
    boxes alone nobody can tell which of two photos' boxes are the same thing.
    Degraded if a name is found nowhere; BadInput if none is found.
    """
    photos = choose_photos(capture, leave_out, config.max_photos)
    found: list[_Detection] = []
    for i, photo in enumerate(photos):
        progress(i / len(photos), photo.name)
        answer = ground(GroundingRequest(photo.rgb, config.labels, config.min_score))
        found += _without_overlaps(_detections(photo, answer), config.max_overlap)
    targets: list[Target] = []
    scores: list[float] = []
    missing: list[str] = []
    for index, label in enumerate(config.labels):
        best = _in_best_photo([d for d in found if d.label == index])[: config.max_per_label]
        missing += [] if best else [label]
        for detection in best:
            targets.append(Target(clean_name(label), detection.photo.name, _in_file(detection)))
            scores.append(detection.score)
    if not targets:
        raise BadInput(
            f"nothing called {' or '.join(config.labels)} was found in {len(photos)} photos: use "
            f"other words, or lower ground.min_score ({config.min_score:g})"
        )
    named = with_own_names(targets)
    reasons = tuple(f"nothing called {label} was found" for label in missing)
    return TargetProposal(
        model=config.model,
        goal="",
        targets=named,
        proposed=named,
        scores=tuple(scores),
        verdict=Verdict("degraded" if missing else "ok", reasons),
    )


def _detections(photo: Photo, answer: GroundingAnswer) -> list[_Detection]:
    return [
        _Detection(photo, int(label), (float(x0), float(y0), float(x1), float(y1)), float(score))
        for (x0, y0, x1, y1), score, label in zip(
            answer.boxes, answer.scores, answer.label, strict=True
        )
        if x1 - x0 >= 1 and y1 - y0 >= 1
    ]


def _without_overlaps(detections: Sequence[_Detection], most: float) -> list[_Detection]:
    """Return what is left when of boxes that mean the same thing only the best stays."""
    kept: list[_Detection] = []
    for one in sorted(detections, key=lambda d: -d.score):
        if all(overlap(one.box, other.box) <= most for other in kept):
            kept.append(one)
    return kept


def _in_best_photo(detections: Sequence[_Detection]) -> list[_Detection]:
    """Return the detections of the photo in which they score most together, the best first."""
    totals: dict[str, float] = {}
    for one in detections:
        totals[one.photo.name] = totals.get(one.photo.name, 0.0) + one.score
    if not totals:
        return []
    best = max(totals, key=lambda name: totals[name])
    return sorted((d for d in detections if d.photo.name == best), key=lambda d: -d.score)


def _in_file(detection: _Detection) -> Box:
    """Return the box in pixels of the photo's file."""
    height, width = detection.photo.rgb.shape[:2]
    fx, fy = detection.photo.original_size[0] / width, detection.photo.original_size[1] / height
    x0, y0, x1, y1 = detection.box
    return fx * x0, fy * y0, fx * x1, fy * y1
