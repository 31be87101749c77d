"""What a colour says of a label."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.segmentation.colours import (
    BINS,
    HIGH,
    LOW,
    TOTAL,
    colour_bins,
    colour_counts,
    colour_posterior,
)
from garden_models.segmentation.node_graph import lab_colours
from tests.garden_models.segmentation.clouds import BLUE, RED

EVEN = np.full(2, 0.5)


def bin_of(rgb):
    return int(colour_bins(lab_colours(np.array([rgb], np.uint8)))[0])


def random_counts(seed, labels=3):
    rng = np.random.default_rng(seed)
    return rng.uniform(0, 5, (labels, TOTAL)) * (rng.random((labels, TOTAL)) < 0.01)


def test_a_bin_and_its_middle_name_each_other():
    index = np.arange(TOTAL)
    cell = np.stack(np.unravel_index(index, BINS), 1)
    middle = LOW + (cell + 0.5) * (HIGH - LOW) / BINS
    np.testing.assert_array_equal(colour_bins(middle), index)


def test_colours_beyond_the_cube_fall_into_its_outermost_bins():
    assert colour_bins(np.array([-5.0, -200, -200])) == 0
    assert colour_bins(np.array([100.0, 200, 200])) == TOTAL - 1


def test_counts_add_up_the_evidence_of_each_label():
    bins = np.array([3, 7, 3])
    counts = colour_counts(bins, np.array([[1, 0], [0.5, 0.5], [0.25, 0.75]]))
    assert counts[:, 3].tolist() == [1.25, 0.75]
    assert counts[:, 7].tolist() == [0.5, 0.5]
    assert counts.sum() == 3


@pytest.mark.parametrize("seed", range(3))
def test_probabilities_sum_to_1_whatever_was_counted(seed):
    posterior = colour_posterior(random_counts(seed), np.array([0.7, 0.2, 0.1]))
    np.testing.assert_allclose(posterior.sum(1), 1)
    assert posterior.min() >= 0


def test_a_colour_that_no_label_has_says_nothing():
    counts = np.zeros((2, TOTAL))
    counts[0, bin_of(RED)] = counts[1, bin_of(BLUE)] = 50
    prior = np.array([0.8, 0.2])
    np.testing.assert_allclose(colour_posterior(counts, prior)[bin_of((40, 200, 40))], prior)
    nothing = colour_posterior(np.zeros((2, TOTAL)), prior)
    np.testing.assert_allclose(nothing, np.broadcast_to(prior, nothing.shape))


def test_a_colour_that_one_label_has_tells_it_and_colours_like_it_too():
    counts = np.zeros((2, TOTAL))
    counts[0, bin_of(RED)] = counts[1, bin_of(BLUE)] = 50
    posterior = colour_posterior(counts, EVEN)
    assert posterior[bin_of(RED), 0] > 0.95
    assert posterior[bin_of(BLUE), 1] > 0.95
    alike = (190, 50, 45)
    assert posterior[bin_of(alike), 0] > 0.9


def test_a_label_counted_more_often_is_not_thereby_more_likely():
    counts = random_counts(0)
    prior = np.array([0.5, 0.3, 0.2])
    more = colour_posterior(counts * np.array([[10.0], [1.0], [0.1]]), prior)
    np.testing.assert_allclose(more, colour_posterior(counts, prior))


def test_labels_may_change_places():
    counts, prior, order = random_counts(1), np.array([0.5, 0.3, 0.2]), [2, 0, 1]
    np.testing.assert_allclose(
        colour_posterior(counts[order], prior[order]), colour_posterior(counts, prior)[:, order]
    )
