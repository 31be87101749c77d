"""The paper's decoder: its sizes, and what may and may not change its answer."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from garden_models.geometry.rotation import matrix_from_6d
from garden_models.gravity.decoder.config import PAPER, DecoderConfig
from garden_models.gravity.decoder.loss import decoder_loss, down_error, rotation_l1, student_nll
from garden_models.gravity.decoder.network import (
    DecodedRotation,
    GravityViewDecoder,
    rotation_from_6d,
)
from garden_models.scene import BadInput

SMALL = DecoderConfig(
    token_width=20, tokens="test", width=32, blocks=2, heads=4, feature=48, head=16, uncertain=True
)


def decoder(config: DecoderConfig = SMALL, seed: int = 0) -> GravityViewDecoder:
    torch.manual_seed(seed)
    model = GravityViewDecoder(config)
    with torch.no_grad():
        model.head[-1].weight.mul_(30)  # an untrained head answers almost the identity
    return model.eval()


def tokens(batch: int = 3, views: int = 6, width: int = 20) -> torch.Tensor:
    return torch.randn(batch, views, width, generator=torch.Generator().manual_seed(1))


REFERENCE = torch.tensor([0, 2, 5])


def test_the_paper_network_has_the_paper_sizes():
    with torch.device("meta"):
        model = GravityViewDecoder(PAPER)
    shapes = {name: tuple(p.shape) for name, p in model.named_parameters()}
    assert shapes["project_query.weight"] == shapes["project_context.weight"] == (512, 3072)
    assert len(model.blocks) == 5
    assert model.blocks[0].self_attention.heads == model.blocks[0].cross_attention.heads == 8
    assert shapes["out.weight"] == (1536, 512)
    assert shapes["head.0.weight"] == (512, 1536)
    assert shapes["head.2.weight"] == (6, 512)


@pytest.mark.parametrize("width", [768, 3072])
def test_it_reads_tokens_of_any_size(width):
    config = dataclasses.replace(SMALL, token_width=width)
    found = decoder(config)(tokens(width=width), REFERENCE)
    assert found.rotation.shape == (3, 3, 3)


def test_the_answer_is_a_rotation():
    rotation = decoder()(tokens(), REFERENCE).rotation
    eye = torch.eye(3).expand(3, 3, 3)
    torch.testing.assert_close(rotation @ rotation.mT, eye, atol=1e-5, rtol=0)
    torch.testing.assert_close(torch.linalg.det(rotation), torch.ones(3), atol=1e-5, rtol=0)


def test_six_numbers_mean_the_same_as_in_the_geometry_room():
    six = np.random.default_rng(0).normal(size=(5, 6))
    ours = rotation_from_6d(torch.from_numpy(six)).numpy()
    np.testing.assert_allclose(ours, np.stack([matrix_from_6d(row) for row in six]), atol=1e-12)


@pytest.mark.parametrize("positions", ["order", "reference"])
def test_absent_views_change_nothing(positions):
    model = decoder(dataclasses.replace(SMALL, positions=positions))
    given = tokens()
    padded = torch.cat([given, torch.full((3, 4, 20), 1e6)], dim=1)
    padded[0, -1] = torch.nan
    present = torch.arange(10)[None].expand(3, 10) < 6
    alone, filled = model(given, REFERENCE), model(padded, REFERENCE, present)
    torch.testing.assert_close(alone.rotation, filled.rotation, atol=1e-6, rtol=0)
    torch.testing.assert_close(alone.log_sigma, filled.log_sigma, atol=1e-6, rtol=0)


def test_the_order_of_the_other_views_does_not_matter():
    model = decoder(dataclasses.replace(SMALL, positions="reference"))
    given = tokens()[:1]
    order = torch.tensor([4, 3, 0, 5, 1, 2])  # the reference view 0 is now the third
    before = model(given, torch.tensor([0])).rotation
    after = model(given[:, order], torch.tensor([2])).rotation
    torch.testing.assert_close(before, after, atol=1e-6, rtol=0)


def test_in_order_only_places_relative_to_the_reference_matter():
    model = decoder(dataclasses.replace(SMALL, positions="order"))
    given = tokens()[:1]
    present = torch.tensor([[False] * 3 + [True] * 6])
    shifted = torch.cat([torch.zeros(1, 3, 20), given], dim=1)
    before = model(given, torch.tensor([2])).rotation
    after = model(shifted, torch.tensor([5]), present).rotation
    torch.testing.assert_close(before, after, atol=1e-6, rtol=0)


def test_the_reference_view_matters():
    model = decoder()
    given = tokens()[:1]
    answers = [model(given, torch.tensor([k])).rotation for k in range(3)]
    assert (answers[0] - answers[1]).abs().max() > 1e-3
    assert (answers[1] - answers[2]).abs().max() > 1e-3


def test_every_view_is_heard():
    model = decoder()
    given = tokens()[:1]
    before = model(given, torch.tensor([0])).rotation
    for view in range(1, 6):
        changed = given.clone()
        changed[0, view] += 2
        assert (model(changed, torch.tensor([0])).rotation - before).abs().max() > 1e-4


def test_heads_of_an_odd_size_are_refused():
    with pytest.raises(BadInput, match="even size"):
        DecoderConfig(width=24, heads=8)


def test_the_loss_is_the_sum_of_nine_differences():
    turned = torch.tensor([[[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]])
    assert rotation_l1(turned, torch.eye(3)[None]).item() == pytest.approx(4)
    assert down_error(turned, torch.eye(3)[None]).item() == pytest.approx(np.pi / 2)


def test_the_claimed_error_is_learned_and_moves_no_rotation():
    rotation = torch.eye(3)[None].requires_grad_()
    log_sigma = torch.tensor([0.0], requires_grad=True)
    true = rotation_from_6d(torch.tensor([[1.0, 0.1, 0, 0, 1, 0.1]]))
    (with_sigma,) = torch.autograd.grad(
        decoder_loss(DecodedRotation(rotation, log_sigma), true), rotation
    )
    (without,) = torch.autograd.grad(decoder_loss(DecodedRotation(rotation, None), true), rotation)
    torch.testing.assert_close(with_sigma, without)


def test_the_likeliest_claim_is_the_size_of_the_errors():
    rng = np.random.default_rng(0)
    errors = torch.tensor(0.05 * np.linalg.norm(rng.normal(size=(20000, 2)), axis=1))
    errors = errors / torch.tensor(np.sqrt(rng.chisquare(2, size=20000) / 2))
    claims = torch.linspace(-5, -1, 81, dtype=torch.float64)
    losses = [student_nll(claim.expand(20000), errors).item() for claim in claims]
    assert claims[int(np.argmin(losses))].exp().item() == pytest.approx(0.05, rel=0.06)
