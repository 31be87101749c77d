"""Training the decoder: what is cut ends with the same weights, tokens a batch are constant."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from garden_models.geometry.rotation import angle_between_deg
from garden_models.gravity.decoder.checkpoint import to_bytes
from garden_models.gravity.decoder.config import PAPER as PAPER_NETWORK
from garden_models.gravity.decoder.decode import decode
from garden_models.gravity.decoder.loss import decoder_loss
from garden_models.gravity.decoder.network import GravityViewDecoder
from garden_models.gravity.decoder.tokens import view_tokens
from garden_models.gravity.training import optimise_tokens
from garden_models.gravity.training.batch import batch_at
from garden_models.gravity.training.calibrating import calibrate_decoder
from garden_models.gravity.training.config import (
    CPU,
    PAPER,
    GravityOptimisation,
    embedded_network,
    gravity_preset,
)
from garden_models.gravity.training.optimise import start, train, trained_model
from garden_models.gravity.training.shard import EvidenceShard, joined, make_shard
from garden_models.gravity.training.token_shard import TokenShard
from garden_models.scene import BadInput

TINY = embedded_network(16, 1, 2, 16, 16)
QUICK = GravityOptimisation(
    steps=12, tokens_a_batch=24, learning_rate=1e-3, warm_up=4, decay=True, threads=1
)


@pytest.fixture(scope="module")
def data() -> EvidenceShard:
    return joined((make_shard("train", 0, 4), make_shard("train", 4, 8)))


def test_the_paper_preset_has_the_paper_numbers():
    assert PAPER.network == PAPER_NETWORK
    assert PAPER.optimisation.steps == 10_000
    assert PAPER.optimisation.learning_rate == 5e-6
    assert PAPER.optimisation.warm_up == 1000
    with pytest.raises(BadInput, match="use one of"):
        gravity_preset("large")


def test_shards_keep_what_scenes_hold(data):
    assert len(data) == 12
    whole, part = make_shard("train", 0, 12), data.scene(7)
    np.testing.assert_array_equal(whole.scene(7).normal, part.normal)
    np.testing.assert_array_equal(whole.down, data.down)
    np.testing.assert_array_equal(whole.start, data.start)


def test_a_training_cut_anywhere_ends_with_the_same_weights(data):
    whole = train(start(TINY, QUICK), data, TINY, QUICK, 12)
    parts = start(TINY, QUICK)
    for steps in (1, 4, 100):
        parts = train(parts, data, TINY, QUICK, steps)
    assert parts.step == whole.step == 12
    assert parts.tensors == whole.tensors
    np.testing.assert_array_equal(parts.losses, whole.losses)
    one, other = (to_bytes(trained_model(s, TINY), None, None, {}) for s in (whole, parts))
    assert one == other


def test_batches_hold_about_the_same_number_of_tokens(data):
    sizes = []
    for step in range(12):
        batch = batch_at(step, data, QUICK)
        scenes, views = batch.evidence.rotation.shape[:2]
        assert scenes * views <= 24
        assert scenes * views > 24 - views
        sizes.append(views)
    assert len(set(sizes)) > 3


def test_a_batch_is_turned_from_its_starts_to_the_truth(data):
    batch = batch_at(3, data, QUICK)
    true = (batch.true @ batch.start).numpy()
    reference = batch.evidence.rotation[range(len(true)), batch.reference].numpy()
    downs = true[:, 1]
    known = [min(angle_between_deg(down, d) for d in data.down) for down in downs]
    assert max(known) < 0.1
    x = np.einsum("bi,bi->b", true[:, 0], reference[:, 2])  # level, square to the view
    np.testing.assert_allclose(x, 0, atol=1e-5)


def loss_on(model: GravityViewDecoder, data: EvidenceShard, config: GravityOptimisation) -> float:
    """Return the mean loss on batches of numbers that no training reaches."""
    losses = []
    with torch.no_grad():
        for step in range(1000, 1010):
            batch = batch_at(step, data, config)
            found = model(view_tokens(batch.evidence, batch.start), batch.reference)
            losses.append(decoder_loss(found, batch.true).item())
    return float(np.mean(losses))


@pytest.mark.slow
def test_it_learns(data):
    config = dataclasses.replace(QUICK, steps=200, tokens_a_batch=96, learning_rate=2e-3)
    network = embedded_network(32, 1, 4, 32, 32)
    fresh = start(network, config)
    state = train(fresh, data, network, config, 200)
    before, after = (loss_on(trained_model(s, network), data, config) for s in (fresh, state))
    assert after < 0.95 * before
    found = calibrate_decoder(trained_model(state, network), data)
    assert np.isfinite(found.claimed_rad).all()


def test_decoding_finds_the_same_in_another_world(data):
    model, scene = trained_model(start(TINY, QUICK), TINY), data.scene(0)
    found = decode(model, scene)
    assert np.linalg.norm(found.down_world) == pytest.approx(1)
    from garden_models.geometry.rotation import axis_angle

    turn = axis_angle(np.array([1.0, 1, 0]), 1.1)
    parts = ("centre", "place", "normal", "line")
    other = dataclasses.replace(
        scene,
        rotation=scene.rotation @ turn.T,
        **{name: getattr(scene, name) @ turn.T for name in parts},
    )
    assert angle_between_deg(decode(model, other).down_world, turn @ found.down_world) < 0.5


def test_evidence_that_is_not_finite_is_refused(data):
    scene = data.scene(0)
    normal = scene.normal.copy()
    normal[0, 0, 0] = np.nan
    with pytest.raises(BadInput, match="not finite"):
        decode(trained_model(start(TINY, QUICK), TINY), dataclasses.replace(scene, normal=normal))


def token_shard(width: int = 10) -> TokenShard:
    rng = np.random.default_rng(0)
    views = rng.integers(2, 7, 9)
    rotations = np.linalg.qr(rng.normal(size=(views.sum(), 3, 3)))[0]
    rotations *= np.sign(np.linalg.det(rotations))[:, None, None]
    return TokenShard(
        "da3-test",
        rng.normal(size=(views.sum(), width)).astype(np.float16),
        rotations.astype(np.float32),
        np.array([int(rng.integers(v)) for v in views]),
        np.concatenate([[0], np.cumsum(views)]),
    )


def test_tokens_of_a_backbone_are_learned_from_as_whole_scenes():
    shard = token_shard()
    network = dataclasses.replace(TINY, token_width=10, tokens="da3-test", uncertain=False)
    for step in range(5):
        batch = optimise_tokens.batch_at(step, shard, QUICK)
        assert int(batch.present.sum()) <= 24
        row = 0
        k = int(
            np.flatnonzero(
                [
                    np.array_equal(
                        shard.tokens[shard.start[s]],
                        batch.tokens[row, 0].numpy().astype(np.float16),
                    )
                    for s in range(len(shard))
                ]
            )[0]
        )
        own = shard.gv_from_camera[shard.start[k] + shard.reference[k]]
        np.testing.assert_array_equal(batch.true[row].numpy(), own)
        assert int(batch.reference[row]) == shard.reference[k]
    whole = optimise_tokens.train(start(network, QUICK), shard, network, QUICK, 12)
    part = optimise_tokens.train(start(network, QUICK), shard, network, QUICK, 5)
    part = optimise_tokens.train(part, shard, network, QUICK, 7)
    assert part.tensors == whole.tensors


def test_tokens_of_another_backbone_are_refused():
    network = dataclasses.replace(TINY, token_width=12, tokens="da3-test")
    with pytest.raises(BadInput, match="with 10 entries"):
        optimise_tokens.train(start(network, QUICK), token_shard(), network, QUICK, 1)
    shard = token_shard()
    shard.tokens[shard.start[4], 3] = np.inf
    network = dataclasses.replace(TINY, token_width=10, tokens="da3-test")
    with pytest.raises(BadInput, match="tokens of scene 4"):
        optimise_tokens.train(start(network, QUICK), shard, network, QUICK, 1)


def test_a_cpu_checkpoint_fits_the_repository():
    model = trained_model(start(CPU.network, CPU.optimisation), CPU.network)
    assert len(to_bytes(model, None, None, {})) < 20e6
