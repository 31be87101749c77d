"""The walk is the solution of its linear system, and sharpens towards a minimal cut."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve

from garden_models.segmentation.random_walk import (
    LEAST_STRENGTH,
    STEP,
    walk_on_graph,
    walk_on_image,
)


def solved(edges, weights, prior, strength):
    """The minimiser by a direct solver: (L + S) x = S p."""
    count = len(prior)
    laplacian = np.zeros((count, count))
    for (i, j), w in zip(edges, weights, strict=True):
        laplacian[i, i] += w
        laplacian[j, j] += w
        laplacian[i, j] -= w
        laplacian[j, i] -= w
    strength = np.maximum(strength, LEAST_STRENGTH)
    return spsolve(
        sparse.csc_matrix(laplacian + np.diag(strength)), strength[:, None] * prior
    ).reshape(prior.shape)


def random_walk(seed, count=80, labels=3):
    rng = np.random.default_rng(seed)
    pairs = np.array([(i, j) for i in range(count) for j in range(i)])
    edges = pairs[rng.choice(len(pairs), 4 * count, replace=False)]
    turned = rng.random(len(edges)) < 0.5
    edges[turned] = edges[turned][:, ::-1]
    prior = rng.dirichlet(np.ones(labels), count)
    strength = rng.uniform(0, 1, count) * (rng.random(count) < 0.3)
    return edges, rng.uniform(0.01, 1, len(edges)), prior, strength


def image_walk(seed, shape=(9, 12)):
    rng = np.random.default_rng(seed)
    h, w = shape
    edges = tuple(
        rng.uniform(0.01, 1, size).astype(np.float32)
        for size in ((h, w - 1), (h - 1, w), (h - 1, w - 1), (h - 1, w - 1))
    )
    prior = rng.random(shape).astype(np.float32)
    strength = (rng.random(shape) * (rng.random(shape) < 0.3)).astype(np.float32)
    return edges, prior, strength


def listed(edges, shape):
    """Image edges as pairs of flat pixels."""
    flat = np.arange(np.prod(shape)).reshape(shape)
    ends = (
        (flat[:, :-1], flat[:, 1:]),
        (flat[:-1], flat[1:]),
        (flat[:-1, :-1], flat[1:, 1:]),
        (flat[:-1, 1:], flat[1:, :-1]),
    )
    pairs = np.concatenate([np.stack([a.ravel(), b.ravel()], 1) for a, b in ends])
    return pairs, np.concatenate([weights.ravel() for weights in edges])


@pytest.mark.parametrize("labels", [2, 3])
@pytest.mark.parametrize("seed", range(6))
def test_a_walk_on_a_graph_is_the_direct_solution(seed, labels):
    edges, weights, prior, strength = random_walk(seed, labels=labels)
    walked = walk_on_graph(edges, weights, prior, strength)
    np.testing.assert_allclose(walked, solved(edges, weights, prior, strength), atol=1e-2)
    np.testing.assert_allclose(walked.sum(1), 1, atol=1e-2)


@pytest.mark.parametrize("seed", range(6))
def test_a_walk_from_an_earlier_result_solves_the_reweighted_system(seed):
    edges, weights, prior, strength = random_walk(seed)
    start = np.random.default_rng(seed).dirichlet(np.ones(3), len(prior))
    change = np.abs(start[edges[:, 0]] - start[edges[:, 1]]).max(1)
    walked = walk_on_graph(edges, weights, prior, strength, start)
    expected = solved(edges, weights / (1 + change / STEP), prior, strength)
    np.testing.assert_allclose(walked, expected, atol=2e-2)


@pytest.mark.parametrize("seed", range(6))
def test_a_walk_on_an_image_is_the_direct_solution(seed):
    edges, prior, strength = image_walk(seed)
    pairs, weights = listed(edges, prior.shape)
    two = np.stack([prior.ravel(), 1 - prior.ravel()], 1)
    expected = solved(pairs, weights, two, strength.ravel())[:, 0]
    np.testing.assert_allclose(walk_on_image(edges, prior, strength).ravel(), expected, atol=1e-2)


@pytest.mark.parametrize("seed", range(3))
def test_an_image_and_its_graph_sharpen_alike(seed):
    edges, prior, strength = image_walk(seed)
    pairs, weights = listed(edges, prior.shape)
    two = np.stack([prior.ravel(), 1 - prior.ravel()], 1).astype(float)
    start = walk_on_image(edges, prior, strength)
    start_two = np.stack([start.ravel(), 1 - start.ravel()], 1).astype(float)
    walked = walk_on_image(edges, prior, strength, start).ravel()
    on_graph = walk_on_graph(pairs, weights.astype(float), two, strength.ravel(), start_two)
    np.testing.assert_allclose(walked, on_graph[:, 0], atol=1e-2)


@pytest.mark.parametrize("seed", range(3))
def test_renaming_nodes_and_turning_edges_changes_nothing(seed):
    edges, weights, prior, strength = random_walk(seed)
    place = np.random.default_rng(seed).permutation(len(prior))
    renamed = np.empty_like(prior)
    renamed[place], drawn = prior, np.empty_like(strength)
    drawn[place] = strength
    walked = walk_on_graph(place[edges[:, ::-1]], weights, renamed, drawn)
    np.testing.assert_allclose(
        walked[place], walk_on_graph(edges, weights, prior, strength), atol=1e-2
    )


def chain(count):
    return np.stack([np.arange(count - 1), np.arange(1, count)], 1)


def ends(count):
    """Priors and strengths that draw the first node to label 0 and the last to label 1."""
    prior, strength = np.full((count, 2), 0.5), np.zeros(count)
    prior[0], prior[-1], strength[[0, -1]] = [1, 0], [0, 1], 1.0
    return prior, strength


def test_between_the_two_ends_of_a_chain_it_falls_evenly():
    """As the voltage along a wire; drawing an end with strength 1 adds a resistance of 1."""
    prior, strength = ends(11)
    walked = walk_on_graph(chain(11), np.ones(10), prior, strength)
    np.testing.assert_allclose(walked[:, 0], np.linspace(1, 0, 13)[1:-1], atol=1e-2)


def test_sharpening_gathers_the_border_on_the_weakest_edge():
    prior, strength = ends(21)
    weights = np.ones(20)
    weights[6] = 0.2
    blurred = walk_on_graph(chain(21), weights, prior, strength)
    sharp = blurred
    for _ in range(6):
        sharp = walk_on_graph(chain(21), weights, prior, strength, sharp)
    before, after = -np.diff(blurred[:, 0]), -np.diff(sharp[:, 0])
    assert before[6] < 0.25
    assert after[6] > 0.6
    assert np.delete(after, 6).max() < 0.05


def test_nodes_without_edges_or_evidence_keep_their_prior():
    prior = np.array([[0.2, 0.8], [0.9, 0.1], [0.5, 0.5]])
    none = np.zeros((0, 2), int)
    walked = walk_on_graph(none, np.zeros(0), prior, np.array([0.0, 1.0, 1e-9]))
    np.testing.assert_allclose(walked, prior, atol=1e-6)
