"""Register photos: cameras and sparse points by structure from motion (COLMAP).

Settings escalate along a ladder until every photo has a camera or the ladder ends; each
attempt is recorded, and the photos that found no place are named.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pycolmap

from garden_models.progress import Progress, silent
from garden_models.reconstruction.focal_correction import (
    correct_focal,
    correction_remark,
    with_focal_factor,
)
from garden_models.reconstruction.known_cameras import (
    agreement,
    judge_agreement,
    opencv_camera,
    ray_matches,
    triangulate,
)
from garden_models.reconstruction.registration_config import FocalTrust, Registration
from garden_models.reconstruction.registration_database import first_guesses
from garden_models.reconstruction.registration_evidence import photo_evidence, supported_models
from garden_models.reconstruction.registration_mapping import map_photos
from garden_models.reconstruction.registration_matches import PhotoMatcher
from garden_models.reconstruction.registration_verdict import (
    judge,
    judge_without_camera,
)
from garden_models.reconstruction.sparse_model import sparse_model
from garden_models.scene import (
    BadInput,
    Capture,
    KnownCamera,
    RegistrationAttempt,
    Scale,
    SparseModel,
    Verdict,
)

WELL_CONNECTED = 50
"""Points shared with two other photos from which a photo needs no more matches."""

GIVEN_SCALE = Scale("known_cameras", 1.0, "the unit of the given cameras is taken as metres")


def register(
    capture: Capture,
    config: Registration,
    workspace: Path,
    progress: Progress = silent,
) -> SparseModel:
    """Return cameras and sparse points of a capture, in metres under the stated scale.

    With known cameras their poses are kept, their focal length too unless the photos
    contradict it (the verdict says so), and only points are found. ``workspace`` is an
    existing folder for COLMAP's database. What is too weak to go on with has a ``failed``
    verdict, and holds what was found. Raises BadInput for fewer than two photos.
    """
    if len(capture.photos) < 2:
        raise BadInput(
            f"a scene needs at least 2 overlapping photos, got {len(capture.photos)}: add photos"
        )
    if capture.cameras:
        return register_known(capture, config, workspace, progress)
    return register_unknown(capture, config, workspace, progress)


def register_unknown(
    capture: Capture, config: Registration, workspace: Path, progress: Progress = silent
) -> SparseModel:
    """Estimate the cameras: climb the ladder until all photos are placed, keep the best rung."""
    photos = capture.photos
    matcher = PhotoMatcher(photos, config.matching, config.threads, config.seed, workspace)
    cameras, camera_of_photo = first_guesses(photos, config.camera_model)
    attempts: list[RegistrationAttempt] = []
    best = pycolmap.Reconstruction()
    chosen = 0
    for index, rung in enumerate(config.ladder):
        started = time.monotonic()
        if matcher.match(rung.look, badly_connected(best, len(photos)), progress):
            matcher.write(cameras, camera_of_photo, progress)
        progress(0.9, f"placing cameras ({rung.name})")
        folder = workspace / f"rung{index}"
        found = map_photos(rung, matcher.database, folder, config.seed, config.mapper_threads)
        models = supported_models(found, config.fewest_confirmed)
        attempts.append(attempt(rung.name, models, time.monotonic() - started))
        if models and strength(models[0]) > strength(best):
            best, chosen = models[0], index
        if best.num_reg_images() == len(photos):
            break
    attempts[chosen] = replace(attempts[chosen], chosen=best.num_reg_images() > 0)
    result = sparse_model(best, photos)
    verdict = judge(
        [photo.name for photo in photos],
        [camera.photo for camera in result.cameras],
        [evidence.confirmed for evidence in photo_evidence(best).values()],
        matcher.verified(),
        config.expectation,
    )
    return replace(result, attempts=tuple(attempts), verdict=verdict)


def register_known(
    capture: Capture, config: Registration, workspace: Path, progress: Progress = silent
) -> SparseModel:
    """Keep the given cameras and triangulate points; photos without a camera stay out."""
    by_name = {camera.photo: camera for camera in capture.cameras}
    photos = [photo for photo in capture.photos if photo.name in by_name]
    without = tuple(photo.name for photo in capture.photos if photo.name not in by_name)
    if len(photos) < 2:
        raise BadInput(
            f"the given cameras name {len(photos)} of the capture's {len(capture.photos)} photos, "
            "at least 2 are needed: give the cameras of these photos"
        )
    known = [by_name[photo.name] for photo in photos]
    started = time.monotonic()
    matcher = PhotoMatcher(photos, config.matching, config.threads, config.seed, workspace)
    matcher.match(config.ladder[0].look, (), progress)
    write_known(matcher, known, progress)
    remarks: tuple[str, ...] = ()
    if config.correct_focal:
        known, remarks = corrected(matcher, known, config.focal, progress)
    progress(0.9, "triangulating points from the given cameras")
    folder = workspace / "known"
    model = triangulate(known, photos, matcher.database, folder, config.seed, config.mapper_threads)
    share, matches = agreement(ray_matches(known, photos, matcher.database))
    tried = attempt("given cameras", [model], time.monotonic() - started)
    note = f"{share:.0%} of {matches} matching points agree with the given cameras"
    verdict = judge_agreement(share, matches, config.trust).worst(judge_without_camera(without))
    return replace(
        sparse_model(model, photos, GIVEN_SCALE),
        unregistered=without,
        attempts=(replace(tried, chosen=True, note="; ".join((note, *remarks))),),
        cameras_source="known",
        verdict=verdict.worst(Verdict("ok", remarks)),
    )


def write_known(matcher: PhotoMatcher, known: Sequence[KnownCamera], progress: Progress) -> None:
    """Write the database of the matcher's photos with their given cameras."""
    cameras = [
        opencv_camera(camera, photo, i + 1)
        for i, (camera, photo) in enumerate(zip(known, matcher.photos, strict=True))
    ]
    matcher.write(cameras, range(len(known)), progress)


def corrected(
    matcher: PhotoMatcher, known: Sequence[KnownCamera], trust: FocalTrust, progress: Progress
) -> tuple[list[KnownCamera], tuple[str, ...]]:
    """Return the cameras with a focal length that fits the matches, and remarks on it.

    Cameras that fit are returned as they are, without a remark. The others' matches are
    verified again, for wrong rays had rejected right matches.
    """
    correction = correct_focal(ray_matches(known, matcher.photos, matcher.database), trust)
    if correction is None:
        return list(known), ()
    fitting = [with_focal_factor(camera, correction.factor) for camera in known]
    write_known(matcher, fitting, progress)
    return fitting, (correction_remark(correction, known, matcher.photos),)


def strength(model: pycolmap.Reconstruction) -> tuple[int, int]:
    """Return what makes a model better: photos, then points."""
    return model.num_reg_images(), model.num_points3D()


def badly_connected(model: pycolmap.Reconstruction, photos: int) -> list[int]:
    """Return the indices of photos that are not placed, or held by few points."""
    evidence = photo_evidence(model)
    return [
        i
        for i in range(photos)
        if i + 1 not in evidence or evidence[i + 1].confirmed < WELL_CONNECTED
    ]


def attempt(
    name: str, models: Sequence[pycolmap.Reconstruction], seconds: float
) -> RegistrationAttempt:
    """Return what came of a rung."""
    if not models:
        note = "found no group of photos that points hold together"
        return RegistrationAttempt(name, 0, 0, 0.0, seconds, False, note)
    note = ""
    if len(models) > 1:
        note = f"separate groups of {', '.join(str(m.num_reg_images()) for m in models)} photos"
    return RegistrationAttempt(
        name,
        models[0].num_reg_images(),
        models[0].num_points3D(),
        float(models[0].compute_mean_reprojection_error()),
        seconds,
        False,
        note,
    )
