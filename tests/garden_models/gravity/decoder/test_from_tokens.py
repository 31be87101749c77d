"""Gravity from a backbone's tokens: turned to the world by the reference view's camera."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from garden_models.geometry.rotation import axis_angle
from garden_models.gravity.decoder.checkpoint import from_bytes, to_bytes
from garden_models.gravity.decoder.config import DecoderConfig
from garden_models.gravity.decoder.from_tokens import down_from_tokens
from garden_models.gravity.decoder.network import GravityViewDecoder
from garden_models.scene import BadInput

CONFIG = DecoderConfig(
    token_width=6, tokens="da3-test", width=8, blocks=1, heads=2, feature=8, head=8
)


@pytest.fixture
def known():
    torch.manual_seed(0)
    return from_bytes(to_bytes(GravityViewDecoder(CONFIG), None, None, {}), "da3-test", 6)


def test_another_world_turns_the_answer(known):
    rng = np.random.default_rng(0)
    tokens = rng.normal(size=(4, 6))
    cameras = np.stack([np.c_[axis_angle(rng.normal(size=3), 1.0), np.zeros(3)] for _ in range(4)])
    down, claimed = down_from_tokens(known, tokens, 2, cameras)
    assert claimed is None or claimed > 0
    assert np.linalg.norm(down) == pytest.approx(1)
    turn = axis_angle(np.array([1.0, 2, 3]), 0.9)
    turned = cameras.copy()
    turned[:, :, :3] = cameras[:, :, :3] @ turn.T
    again, _ = down_from_tokens(known, tokens, 2, turned)
    np.testing.assert_allclose(again, turn @ down, atol=1e-9)


def test_what_does_not_go_together_is_refused(known):
    cameras = np.tile(np.eye(4), (4, 1, 1))
    for tokens, reference, message in (
        (np.zeros((4, 7)), 0, "use the decoder that was trained on them"),
        (np.full((4, 6), np.nan), 0, "not finite"),
        (np.zeros((4, 6)), 4, "reference view 4"),
        (np.zeros((3, 6)), 0, "3 tokens, 4 cameras"),
    ):
        with pytest.raises(BadInput, match=message):
            down_from_tokens(known, tokens, reference, cameras)
