"""Long captures: chunks in worlds of their own come back as one, within the stated memory."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from garden_models.foundation.failure import ModelOutOfMemory
from garden_models.geometry.camera import camera_centre
from garden_models.geometry.rotation import axis_angle
from garden_models.reconstruction.chunk_limits import ChunkLimits
from garden_models.reconstruction.chunk_merging import merge_chunks
from garden_models.reconstruction.geometry_model import (
    CameraTokens,
    Gaussians,
    GeometryPrediction,
    GeometryRequest,
    GeometryView,
)
from garden_models.reconstruction.long_capture import part_of, predict_long
from garden_models.reconstruction.memory_need import RUNTIME_GB, MemoryNeed
from garden_models.reconstruction.photo_chunks import owners, photo_chunks
from garden_models.reconstruction.similarity import Similarity
from garden_models.scene import BadInput
from tests.doubles.true_views import TrueViews, box_room
from tests.garden_models.reconstruction.against_truth import assert_true

NEED = MemoryNeed(RUNTIME_GB, 1.0)
PHOTOS = 30


def room_for(photos: int) -> ChunkLimits:
    return ChunkLimits(gpu_memory_gb=(RUNTIME_GB + photos + 0.5) / 0.9, overlap=4)


@pytest.fixture(scope="module")
def truth() -> TrueViews:
    return box_room(PHOTOS, size=(56, 42), focal=45.0)


class InWorldsOfItsOwn:
    """A model that answers each call in another world and unit, with noise and outliers."""

    def __init__(self, truth: TrueViews, noise: float = 0.0, metric: bool = False, seed: int = 0):
        self.truth, self.noise, self.metric = truth, noise, metric
        self.rng = np.random.default_rng(seed)
        self.calls: list[int] = []
        self.most: int | None = None
        self.known = {photo.tobytes(): i for i, photo in enumerate(truth.photos)}

    def __call__(self, request: GeometryRequest) -> GeometryPrediction:
        self.calls.append(len(request.photos))
        if self.most is not None and len(request.photos) > self.most:
            raise ModelOutOfMemory("no room")
        found = [self.known[photo.tobytes()] for photo in request.photos]
        move = self._world() if request.camera_from_world is None else None
        views = tuple(self._view(i, move) for i in found)
        means = np.stack([self._point(i, move) for i in found])
        n = len(found)
        return GeometryPrediction(
            views,
            self.metric,
            (CameraTokens("toy", np.arange(n), np.array(found, float)[:, None], n // 2),),
            Gaussians(
                means,
                np.full((n, 3), 0.1 * (move.scale if move else 1.0)),
                np.tile([1.0, 0, 0, 0], (n, 1)),
                np.full(n, 0.5),
                np.full((n, 3), 0.5),
                np.arange(n),
            ),
        )

    def _world(self) -> Similarity:
        rng = self.rng
        scale = np.exp(rng.normal() * (0.02 if self.metric else 1.0))
        return Similarity(
            float(scale), axis_angle(rng.normal(size=3), rng.uniform(0, 3)), rng.normal(size=3) * 5
        )

    def _view(self, i: int, move: Similarity | None) -> GeometryView:
        depth = self.truth.depth[i].copy()
        height, width = depth.shape
        if self.noise:
            depth *= np.exp(self.rng.normal(size=depth.shape) * self.noise).astype(np.float32)
            wild = self.rng.random(depth.shape) < 0.15
            depth[wild] *= self.rng.uniform(0.2, 4, int(wild.sum()))
        view = GeometryView(
            depth.astype(np.float32),
            np.full((height, width), 0.7, np.float32),
            np.ones((height, width), bool),
            self.truth.K[i],
            self.truth.camera_from_world[i],
        )
        return view if move is None else move.view(view)

    def _point(self, i: int, move: Similarity | None) -> np.ndarray:
        camera = self.truth.camera_from_world[i]
        point = -camera[:, :3].T @ camera[:, 3]
        return point if move is None else move.points(point[None])[0]


def test_chunks_of_one_world_come_back_as_one_world(truth):
    predict = InWorldsOfItsOwn(truth)
    found = predict_long(truth.request(), predict, NEED, room_for(10))
    assert len(predict.calls) == 5 and max(predict.calls) == 10
    assert_true(found, truth, tolerance=1e-3)
    assert found.verdict.status == "ok" and not found.verdict.reasons


@pytest.mark.parametrize("seed", range(3))
def test_noise_and_outliers_do_not_bend_it(truth, seed):
    predict = InWorldsOfItsOwn(truth, noise=0.02, seed=seed)
    found = predict_long(truth.request(), predict, NEED, room_for(10))
    first, last = found.views[0].camera_from_world, found.views[-1].camera_from_world
    true_first, true_last = truth.camera_from_world[0], truth.camera_from_world[-1]
    turn = last[:, :3] @ first[:, :3].T @ (true_last[:, :3] @ true_first[:, :3].T).T
    assert np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))) < 0.3
    scales = [float(np.median(v.depth / d)) for v, d in zip(found.views, truth.depth, strict=True)]
    assert max(scales) / min(scales) < 1.01


@pytest.mark.slow
def test_errors_of_joints_stay_small_over_hundreds_of_photos():
    truth = box_room(240, size=(56, 42), focal=45.0)
    predict = InWorldsOfItsOwn(truth, noise=0.02)
    found = predict_long(truth.request(), predict, NEED, room_for(24))
    assert len(predict.calls) == 12
    units = [float(np.median(d / v.depth)) for d, v in zip(truth.depth, found.views, strict=True)]
    assert max(units) / min(units) < 1.02
    move = Similarity(1 / units[0], np.eye(3), np.zeros(3))
    first = np.vstack([move.camera(truth.camera_from_world[0]), [0, 0, 0, 1]])
    world = np.linalg.inv(first) @ np.vstack([found.views[0].camera_from_world, [0, 0, 0, 1]])
    for view, camera in zip(found.views[::20], truth.camera_from_world[::20], strict=True):
        true = move.camera(camera) @ world
        turn = view.camera_from_world[:, :3] @ true[:, :3].T
        assert np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))) < 1.0
        off = camera_centre(view.camera_from_world) - camera_centre(true)
        assert np.linalg.norm(off) * units[0] < 0.05


def test_metric_chunks_agree_on_the_middle_of_their_metres(truth):
    found = predict_long(truth.request(), InWorldsOfItsOwn(truth, metric=True), NEED, room_for(10))
    assert found.metric
    unit = assert_true(found, truth, tolerance=1e-3)
    assert abs(unit - 1) < 0.03


def test_tokens_and_gaussians_follow_their_photos(truth):
    found = predict_long(truth.request(), InWorldsOfItsOwn(truth), NEED, room_for(10))
    for tokens in found.camera_tokens:
        np.testing.assert_array_equal(tokens.tokens[:, 0], tokens.views)
        assert tokens.reference == tokens.views[len(tokens.views) // 2]
    assert found.gaussians is not None
    np.testing.assert_array_equal(np.sort(found.gaussians.view), np.arange(PHOTOS))
    unit = np.median(truth.depth[0] / found.views[0].depth)
    for mean, scale, view in zip(
        found.gaussians.mean, found.gaussians.scale, found.gaussians.view, strict=True
    ):
        camera = found.views[view].camera_from_world
        np.testing.assert_allclose(camera[:, :3] @ mean + camera[:, 3], 0, atol=1e-3)
        np.testing.assert_allclose(scale * unit, 0.1, rtol=1e-3)


def test_given_cameras_need_no_alignment(truth):
    found = predict_long(truth.with_cameras(), InWorldsOfItsOwn(truth), NEED, room_for(10))
    assert_true(found, truth, scale=1.0, same_world=True, tolerance=1e-9)


def test_what_fits_is_predicted_at_once(truth):
    predict = InWorldsOfItsOwn(truth)
    predict_long(truth.request(), predict, NEED, room_for(PHOTOS))
    assert predict.calls == [PHOTOS]


def test_out_of_memory_halves_the_chunks_and_is_told(truth):
    predict = InWorldsOfItsOwn(truth)
    predict.most = 9
    found = predict_long(truth.request(), predict, NEED, room_for(PHOTOS))
    assert predict.calls[:3] == [30, 15, 8] and set(predict.calls[2:]) == {8}
    assert_true(found, truth, tolerance=1e-3)
    assert found.verdict.status == "ok"
    assert "ran out with 30 photos at once; predicted 15" in found.verdict.reasons[0]
    assert "ran out with 15" in found.verdict.reasons[1]


def test_too_little_memory_is_told_before_anything_runs(truth):
    predict = InWorldsOfItsOwn(truth)
    with pytest.raises(BadInput, match=r"6 photos at once need about 7\.0 GB"):
        predict_long(truth.request(), predict, NEED, room_for(5))
    assert not predict.calls
    predict.most = 5
    with pytest.raises(ModelOutOfMemory, match="with 6 photos at once, the fewest"):
        predict_long(truth.request(), predict, NEED, room_for(6))


def test_chunks_that_do_not_fit_each_other_degrade_the_result(truth):
    request = truth.request()
    chunks = photo_chunks(PHOTOS, 18, 6)
    good, bad = (InWorldsOfItsOwn(truth)(part_of(request, chunk)) for chunk in chunks)
    rng = np.random.default_rng(0)
    bent = replace(
        bad,
        views=tuple(
            replace(
                view,
                camera_from_world=np.column_stack(
                    [
                        axis_angle(rng.normal(size=3), 0.4) @ view.camera_from_world[:, :3],
                        view.camera_from_world[:, 3],
                    ]
                ),
            )
            for view in bad.views
        ),
    )
    assert merge_chunks((good, bad), chunks, False).verdict.status == "ok"
    merged = merge_chunks((good, bent), chunks, False)
    assert merged.verdict.status == "degraded"
    assert "photos 13 to 30 join those before them with an error" in merged.verdict.reasons[0]


@given(st.integers(1, 400), st.integers(2, 60), st.integers(1, 20))
@settings(max_examples=200, deadline=None)
def test_chunks_cover_all_photos_and_overlap(photos, size, overlap):
    if photos > size and size <= overlap:
        with pytest.raises(ValueError, match="cannot share"):
            photo_chunks(photos, size, overlap)
        return
    chunks = photo_chunks(photos, size, overlap)
    assert chunks[0].start == 0 and chunks[-1].stop == photos
    assert all(len(chunk) <= size for chunk in chunks)
    for before, after in pairwise(chunks):
        assert before.stop - after.start >= overlap and after.start > before.start
    owner = owners(chunks, photos)
    assert all(p in chunks[c] for p, c in enumerate(owner)) and list(owner) == sorted(owner)


@given(st.floats(0.1, 10), st.floats(0.01, 2), st.floats(0, 2), st.integers(0, 8), st.floats(1, 99))
def test_as_many_photos_as_fit_and_not_one_more(fixed, per_photo, per_early, early, memory):
    need = MemoryNeed(fixed, per_photo, per_early, early)
    most = need.most_photos(memory)
    assert most == 0 or need.gb(most) <= memory * 0.9 + 1e-6
    assert need.gb(most + 1) > memory * 0.9 - 1e-6
