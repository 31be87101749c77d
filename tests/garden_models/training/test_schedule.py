"""What a training step sees follows from its number alone."""

from __future__ import annotations

import numpy as np

from garden_models.training.schedule import samples_at


def test_every_sample_comes_once_an_epoch_in_a_new_order():
    epochs = [np.concatenate([samples_at(e * 5 + k, 15, 3, 7) for k in range(5)]) for e in (0, 1)]
    for epoch in epochs:
        np.testing.assert_array_equal(np.sort(epoch), np.arange(15))
    assert not np.array_equal(*epochs)


def test_a_batch_that_crosses_epochs_takes_from_both():
    seen = np.concatenate([samples_at(step, 5, 3, 0) for step in range(5)])
    assert sorted(np.bincount(seen)) == [3] * 5
