"""Gravity from a prediction's camera tokens: each chunk votes, in the prediction's world."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from garden_models.geometry.rotation import axis_angle
from garden_models.gravity.camera_tokens import token_cue
from garden_models.gravity.decoder.checkpoint import to_bytes
from garden_models.gravity.decoder.config import DecoderConfig
from garden_models.gravity.decoder.network import GravityViewDecoder
from garden_models.gravity.token_config import TokenGravity
from garden_models.reconstruction.geometry_model import (
    CameraTokens,
    GeometryPrediction,
    GeometryView,
)
from garden_models.scene import BadInput

CONFIG = DecoderConfig(
    token_width=6, tokens="da3-toy", width=8, blocks=1, heads=2, feature=8, head=8
)


class Knows(GravityViewDecoder):
    """Reads gravity out of the tokens: their first three numbers are down in the camera."""

    def forward(self, tokens, reference):
        found = super().forward(tokens, reference)
        down = tokens[torch.arange(len(tokens)), reference, :3].double().numpy()
        rotation = np.stack([_upright(d) for d in down])
        return type(found)(torch.from_numpy(rotation).float(), found.log_sigma)


def _upright(down: np.ndarray) -> np.ndarray:
    z = np.cross(np.cross(down, [0, 0, 1.0]), down)
    z /= np.linalg.norm(z)
    return np.stack([np.cross(down, z), down, z])


@pytest.fixture
def weights(tmp_path, monkeypatch):
    path = tmp_path / "decoder.safetensors"
    path.write_bytes(to_bytes(GravityViewDecoder(CONFIG), None, None, {}))
    from garden_models.gravity.decoder import checkpoint

    monkeypatch.setattr(checkpoint, "GravityViewDecoder", Knows)
    return TokenGravity(str(path))


def prediction_of(down: np.ndarray, wrong: int | None = None) -> GeometryPrediction:
    rng = np.random.default_rng(0)
    views, tokens = [], []
    for k in range(9):
        rotation = axis_angle(rng.normal(size=3), 0.6)
        camera = np.column_stack([rotation, rng.normal(size=3)])
        own = rotation @ (-down if k == wrong else down)
        tokens.append(np.r_[own, rng.normal(size=3)])
        nothing = np.zeros((2, 2), np.float32)
        views.append(GeometryView(nothing, nothing, nothing > 1, np.eye(3), camera))
    chunks = (range(4), range(3, 7), range(5, 9))
    references = (2, 3, 8)
    return GeometryPrediction(
        tuple(views),
        True,
        tuple(
            CameraTokens("da3-toy", np.array(c), np.array(tokens)[c.start : c.stop], r)
            for c, r in zip(chunks, references, strict=True)
        ),
    )


def test_the_chunks_agree_in_the_world_of_the_prediction(weights):
    down = np.array([0.2, 0.9, -0.3])
    down /= np.linalg.norm(down)
    cue = token_cue(prediction_of(down), weights)
    (mode,) = cue.modes
    assert cue.method == "camera_tokens" and "100% of the photos agree" in mode.note
    np.testing.assert_allclose(np.abs(mode.axis @ down), 1, atol=1e-6)
    assert cue.down_log_odds(down) > 1 and cue.down_log_odds(-down) < -1


def test_a_chunk_that_has_it_upside_down_is_outvoted(weights):
    down = np.array([0.0, 1.0, 0.0])
    cue = token_cue(prediction_of(down, wrong=8), weights)
    assert cue.down_log_odds(down) > 0
    assert "67% of the photos agree" in cue.modes[0].note


def test_tokens_that_are_missing_or_of_another_network_are_refused(weights):
    found = prediction_of(np.array([0.0, 1.0, 0.0]))
    bare = GeometryPrediction(found.views, True)
    with pytest.raises(BadInput, match="holds no camera tokens"):
        token_cue(bare, weights)
    other = CameraTokens("da3-giant", np.arange(2), np.zeros((2, 6)), 0)
    with pytest.raises(BadInput, match="tokens"):
        token_cue(GeometryPrediction(found.views, True, (other,)), weights)
