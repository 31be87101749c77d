"""Training: what is cut and taken up again ends with the same weights; loss goes down."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from garden_models.disentanglement.network.checkpoint import to_bytes
from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.training.config import (
    CPU,
    PAPER,
    SMOKE,
    Optimisation,
    training_preset,
)
from garden_models.disentanglement.training.described import DescribedShard, describe_shard, joined
from garden_models.disentanglement.training.optimise import (
    batch_at,
    pairs_at,
    start,
    train,
    trained_model,
)
from garden_models.disentanglement.training.pairs import make_shard
from garden_models.disentanglement.training.pairs_config import CLEAN
from garden_models.scene import BadInput
from garden_models.training.schedule import rate_at

TINY = NetworkConfig(
    width=16, heads=2, token_layers=1, point_layers=1, scene_tokens=32, object_tokens=16
)
QUICK = Optimisation(steps=12, batch=3, warm_up=4, points=128, threads=1, token_loss=0.5)


@pytest.fixture(scope="module")
def data() -> DescribedShard:
    return describe_shard(make_shard("train", 8, 1, CLEAN), TINY)


def test_a_training_cut_anywhere_ends_with_the_same_weights(data):
    whole = train(start(TINY, QUICK), data, TINY, QUICK, 12)
    parts = start(TINY, QUICK)
    for steps in (1, 4, 5, 100):
        parts = train(parts, data, TINY, QUICK, steps)
    assert parts.step == whole.step == 12
    assert parts.tensors == whole.tensors
    np.testing.assert_array_equal(parts.losses, whole.losses)
    one, other = (to_bytes(trained_model(s, TINY), {}) for s in (whole, parts))
    assert one == other


def test_another_seed_gives_other_weights(data):
    other = dataclasses.replace(QUICK, seed=1)
    assert start(TINY, QUICK).tensors != start(TINY, other).tensors
    assert start(TINY, QUICK).tensors == start(TINY, QUICK).tensors


@pytest.mark.slow
def test_the_loss_goes_down(data):
    config = dataclasses.replace(QUICK, steps=60, learning_rate=3e-3)
    state = train(start(TINY, config), data, TINY, config, 60)
    assert state.losses[-10:].mean() < 0.6 * state.losses[:5].mean()


def test_every_pair_is_seen_once_an_epoch():
    config = Optimisation(batch=4)
    seen = np.concatenate([pairs_at(step, 10, config) for step in range(5)])
    assert sorted(seen[:10]) == list(range(10))
    assert sorted(seen[10:]) == list(range(10))
    assert list(seen[:10]) != list(seen[10:])


def test_a_batch_is_a_function_of_the_steps_number(data):
    config = dataclasses.replace(QUICK, symmetries=True)
    one, again, next_ = (batch_at(step, data, config) for step in (3, 3, 4))
    assert (one.points == again.points).all()
    assert one.points.shape == (3, 128, data.features.shape[2])
    assert not (one.points.shape == next_.points.shape and (one.points == next_.points).all())
    assert 0 < one.label.mean() < 1


def test_the_rate_rises_and_falls():
    config = Optimisation(steps=100, warm_up=10)
    rates = np.array([rate_at(step, config) for step in range(100)])
    assert rates[0] == pytest.approx(0.1)
    assert rates.argmax() in (9, 10)
    assert rates[-1] < 0.01
    assert (np.diff(rates[10:]) < 0).all()
    assert rate_at(99, dataclasses.replace(config, decay=False)) == 1


def test_presets():
    assert PAPER.optimisation.learning_rate == 5e-4
    assert PAPER.optimisation.batch == 48
    assert PAPER.optimisation.steps == 2000
    assert not PAPER.network.geometric
    assert not PAPER.pairs.augmentations.relative
    assert training_preset("smoke") is SMOKE
    assert CPU.network.geometric
    with pytest.raises(BadInput, match="smoke, cpu, paper"):
        training_preset("huge")


def test_shards_join_in_order(data):
    both = joined((data, data))
    assert len(both) == 2 * len(data)
    np.testing.assert_array_equal(both.features[len(data) :], data.features)
