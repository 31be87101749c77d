"""A texture sampled bilinearly at a face's corners and inside shows what vertex colours would."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.ndimage import map_coordinates

from garden_models.meshing.texture_atlas import (
    MAX_FACES,
    MAX_SIZE,
    MIN_SIZE,
    TextureAtlas,
    bake_vertex_colours,
)

ROUNDING = 1.0
"""Of 255: texels are whole numbers."""


def sample(atlas: TextureAtlas, uv):
    """Look colours up as a renderer does: bilinear, u right, v up, first row on top."""
    size = len(atlas.rgb)
    x, y = uv[..., 0] * size - 0.5, (1 - uv[..., 1]) * size - 0.5
    channels = np.moveaxis(atlas.rgb.astype(float), 2, 0)
    seen = [map_coordinates(c, [y, x], order=1, mode="nearest") for c in channels]
    return np.stack(seen, axis=-1)


def soup(face_count, seed, low=0, high=256):
    """Faces between random vertices with random colours."""
    rng = np.random.default_rng(seed)
    vertex_count = face_count + 2
    faces = rng.integers(0, vertex_count, (face_count, 3))
    return faces, rng.integers(low, high, (vertex_count, 3)).astype(np.uint8)


def blends(face_count, seed, count=20):
    """Barycentric weights of places inside every face."""
    return np.random.default_rng(seed).dirichlet([1.0, 1.0, 1.0], (face_count, count))


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 400), st.integers(0, 2**32 - 1))
def test_corners_have_their_vertex_colour(face_count, seed):
    faces, rgb = soup(face_count, seed)
    atlas = bake_vertex_colours(faces, rgb)
    assert_allclose(sample(atlas, atlas.corner_uv), rgb[faces], atol=1e-6)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 400), st.integers(0, 2**32 - 1))
def test_inside_a_face_the_corners_are_blended_linearly(face_count, seed):
    # Colours whose continuation beyond a face's edge stays within 0..255.
    faces, rgb = soup(face_count, seed, 100, 150)
    atlas = bake_vertex_colours(faces, rgb)
    weights = blends(face_count, seed)
    got = sample(atlas, np.einsum("fnk,fkc->fnc", weights, atlas.corner_uv))
    assert_allclose(got, np.einsum("fnk,fkc->fnc", weights, rgb[faces]), atol=ROUNDING)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 400), st.integers(0, 2**32 - 1))
def test_the_strongest_contrasts_are_missed_by_little(face_count, seed):
    faces, rgb = soup(face_count, seed, 0, 2)
    atlas = bake_vertex_colours(faces, rgb * 255)
    weights = blends(face_count, seed)
    got = sample(atlas, np.einsum("fnk,fkc->fnc", weights, atlas.corner_uv))
    assert_allclose(got, np.einsum("fnk,fkc->fnc", weights, rgb[faces] * 255.0), atol=255 / 12 + 1)


@settings(max_examples=30, deadline=None)
@given(
    st.integers(1, 400),
    st.integers(0, 2**32 - 1),
    st.sampled_from([(1, 0), (-1, 0), (0, 1), (0, -1)]),
)
def test_a_texel_beside_a_face_is_still_its_own(face_count, seed, step):
    # Every face has one colour, so that any other one shows.
    rgb = np.random.default_rng(seed).integers(0, 256, (face_count, 3)).astype(np.uint8)
    atlas = bake_vertex_colours(np.repeat(np.arange(face_count)[:, None], 3, axis=1), rgb)
    got = sample(atlas, atlas.corner_uv + np.array(step) / len(atlas.rgb))
    assert_allclose(got, np.repeat(rgb[:, None], 3, axis=1), atol=1e-6)


@pytest.mark.parametrize(
    ("faces", "size"), [(1, MIN_SIZE), (8, 16), (9, 32), (24_000, 1024), (131_072, MAX_SIZE)]
)
def test_the_size_is_the_least_power_of_two_with_room(faces, size):
    corners, rgb = soup(faces, 0)
    atlas = bake_vertex_colours(corners, rgb)
    assert atlas.rgb.shape == (size, size, 3)
    assert_allclose(sample(atlas, atlas.corner_uv), rgb[corners], atol=1e-6)
    assert atlas.corner_uv.shape == (faces, 3, 2)
    assert ((atlas.corner_uv > 0) & (atlas.corner_uv < 1)).all()


@pytest.mark.slow
@pytest.mark.parametrize("faces_count", [131_073, MAX_FACES])
def test_very_many_faces_share_the_largest_texture(faces_count):
    faces, rgb = soup(faces_count, 0, 100, 150)
    atlas = bake_vertex_colours(faces, rgb)
    assert atlas.rgb.shape == (MAX_SIZE, MAX_SIZE, 3)
    weights = blends(faces_count, 0, 2)
    got = sample(atlas, np.einsum("fnk,fkc->fnc", weights, atlas.corner_uv))
    assert_allclose(got, np.einsum("fnk,fkc->fnc", weights, rgb[faces]), atol=ROUNDING)


@pytest.mark.parametrize("faces", [0, MAX_FACES + 1])
def test_no_faces_and_too_many_are_refused(faces):
    with pytest.raises(ValueError, match=f"1 to {MAX_FACES} faces, got {faces}"):
        bake_vertex_colours(np.zeros((faces, 3), int), np.zeros((1, 3), np.uint8))


def test_coarse_levels_mix_like_with_like():
    # Two colours in faces of random order: averages over four cells still tell them apart.
    rgb = np.array([[250, 20, 20], [20, 20, 250]], np.uint8)
    of_face = np.random.default_rng(0).integers(0, 2, 2048)
    atlas = bake_vertex_colours(np.repeat(of_face[:, None], 3, axis=1), rgb)
    size, block = len(atlas.rgb), 16
    means = atlas.rgb.reshape(size // block, block, size // block, block, 3).mean(axis=(1, 3))
    mixed = (np.abs(means[..., None, :] - rgb).max(axis=-1) > 1).all(axis=-1)
    assert mixed.sum() <= 2
