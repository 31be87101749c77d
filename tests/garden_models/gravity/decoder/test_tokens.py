"""Tokens: free of origin, unit and world axes; they see agreement, its tilt, and up from down."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from garden_models.geometry.rotation import axis_angle
from garden_models.gravity.decoder.evidence import ViewEvidence, read_evidence
from garden_models.gravity.decoder.start_frame import frame_of, habitual_down, starts
from garden_models.gravity.decoder.token_layout import TOKEN_WIDTH
from garden_models.gravity.decoder.tokens import evidence_batch, view_tokens
from garden_models.gravity.training.scenes.furnish import RoomKind
from garden_models.gravity.training.scenes.observe import photographed
from garden_models.gravity.training.scenes.photograph import PHOTO_SIZE, photograph
from garden_models.gravity.training.scenes.photographer import PhotographerKind
from garden_models.scene import BadInput


@pytest.fixture(scope="module")
def scene():
    """A reconstruction of a room with level photos, and its true direction down."""
    rng = np.random.default_rng(5)
    kind = PhotographerKind(photos=4, roll_deg=0.0)
    shot = photographed(rng, RoomKind(planes=True, slanted=False), kind, PHOTO_SIZE)
    return photograph(shot, rng), shot.down_world


@pytest.fixture(scope="module")
def evidence(scene):
    return read_evidence(scene[0])


def tokens(evidence: ViewEvidence, down: np.ndarray) -> np.ndarray:
    frame = frame_of(down, evidence.rotation[evidence.reference])
    batch = evidence_batch([evidence])
    return view_tokens(batch, torch.tensor(frame[None], dtype=torch.float32))[0].numpy()


def test_there_is_one_token_a_view(evidence, scene):
    found = tokens(evidence, scene[1])
    assert found.shape == (len(evidence), TOKEN_WIDTH)
    assert np.isfinite(found).all()
    assert np.abs(found).max() < 10


def test_the_same_evidence_gives_the_same_tokens(scene, evidence):
    again = read_evidence(scene[0])
    np.testing.assert_array_equal(tokens(evidence, scene[1]), tokens(again, scene[1]))


def test_another_world_changes_nothing(evidence, scene):
    turn, moved, factor = axis_angle(np.array([1.0, 2, -1]), 2.2), np.array([5.0, -3, 7]), 30.0
    other = dataclasses.replace(
        evidence,
        rotation=evidence.rotation @ turn.T,
        centre=factor * (evidence.centre @ turn.T) + moved,
        place=factor * (evidence.place @ turn.T) + moved,
        normal=evidence.normal @ turn.T,
        line=evidence.line @ turn.T,
    )
    np.testing.assert_allclose(
        tokens(evidence, scene[1]), tokens(other, turn @ scene[1]), atol=5e-3
    )


def test_padding_changes_nothing(evidence, scene):
    other = dataclasses.replace(
        evidence,
        place=np.where(evidence.normal_weight[..., None] > 0, evidence.place, 9.0),
        normal=np.where(evidence.normal_weight[..., None] > 0, evidence.normal, 0.5),
        line=np.where(evidence.line_weight[..., None] > 0, evidence.line, 0.5),
    )
    np.testing.assert_array_equal(tokens(evidence, scene[1]), tokens(other, scene[1]))


@pytest.mark.parametrize("axis", [0, 2])
def test_the_tilt_of_floor_and_edges_shows_how_far_down_is_off(evidence, scene, axis):
    """Turning the start frame by two degrees moves the tilts by as much, the right way."""
    from garden_models.gravity.decoder import token_layout as t

    frame = frame_of(scene[1], evidence.rotation[evidence.reference])
    first = t.SPHERE + t.HALF_SPHERE
    lines = first + 6 * len(t.NORMAL_GATES) * 3
    moved = np.radians(2.0)
    start = axis_angle(np.eye(3)[axis], moved) @ frame
    batch = evidence_batch([evidence])
    both = [
        view_tokens(batch, torch.tensor(f[None], dtype=torch.float32))[0, 0].numpy()
        for f in (frame, start)
    ]
    whole = sum(t.PARTS.values())
    normal_tilts = [
        row[whole + first : whole + lines].reshape(6, len(t.NORMAL_GATES), 3) for row in both
    ]
    line_tilts = [
        row[whole + lines : whole + lines + 18].reshape(3, len(t.LINE_GATES), 3) for row in both
    ]
    # Up (-y) is where the floor's and the tables' normals are; columns are (z, x).
    turned = axis_angle(np.eye(3)[axis], moved)
    expected = (turned @ [0, -1, 0])[[2, 0]] / t.TILT_UNIT
    found = normal_tilts[1][4, 1, 1:] - normal_tilts[0][4, 1, 1:]
    np.testing.assert_allclose(found, expected, atol=0.1)
    expected = (turned @ [0, 1, 0])[[2, 0]] / t.TILT_UNIT
    found = line_tilts[1][1, 1, 1:] - line_tilts[0][1, 1, 1:]
    assert found @ expected > 0.5 * expected @ expected


def test_starts_reach_every_direction(evidence):
    directions = starts(evidence)
    random = np.random.default_rng(0).normal(size=(1000, 3))
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    assert np.degrees(np.arccos((random @ directions.T).max(axis=1))).max() < 55


def test_some_start_is_gravity_almost_exactly(evidence, scene):
    directions = starts(evidence)
    assert np.degrees(np.arccos((directions @ scene[1]).max())) < 1.5
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)


def test_level_cameras_start_near_gravity(evidence, scene):
    down = habitual_down(evidence.rotation, evidence.reference)
    assert np.degrees(np.arccos(down @ scene[1])) < 40


def spoilt(reconstruction, **changes):
    view = dataclasses.replace(reconstruction.views[1], **changes)
    views = (reconstruction.views[0], view, *reconstruction.views[2:])
    return dataclasses.replace(reconstruction, views=views)


def test_what_is_no_view_is_refused(scene):
    view = scene[0].views[1]
    camera = view.camera_from_world.copy()
    camera[:3, :3] *= 1000
    wrong = [
        ({"camera_from_world": camera}, "no rotation"),
        ({"camera_from_world": np.full((3, 4), np.nan)}, "no rotation"),
        ({"K": np.array([[0.8, 0, 0.5], [0, 0.8, 0.5], [0, 0, 1]])}, "in pixels"),
        ({"depth": np.full_like(view.depth, np.nan)}, "not finite"),
        ({"depth": -np.ones_like(view.depth)}, "negative"),
    ]
    for changes, message in wrong:
        with pytest.raises(BadInput, match=message):
            read_evidence(spoilt(scene[0], **changes))
