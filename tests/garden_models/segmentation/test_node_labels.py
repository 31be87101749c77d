"""Nodes are divided between the background and the targets; only what must always hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from garden_models.physics.support_surfaces import SurfacePlane
from garden_models.segmentation.carrier import BoxEvidence, Carrier
from garden_models.segmentation.node_graph import node_graph
from garden_models.segmentation.node_labels import (
    Candidate,
    Votes,
    isolation,
    label_nodes,
    nearness,
    support_grip,
)
from tests.garden_models.segmentation.clouds import BLUE, RED, block, joined, level

HALF = (0.06, 0.08, 0.06)


class Table:
    """Two blocks on a table, ``gap`` apart, and the claims of a box around each."""

    def __init__(self, gap=0.1, colours=(RED, BLUE), seed=0):
        x = HALF[0] + gap / 2
        parts = (
            block(HALF, centre=(-x, 0), rgb=colours[0]),
            block(HALF, centre=(x, 0), rgb=colours[1]),
            level(0.35),
        )
        points = joined(*parts)
        rng = np.random.default_rng(seed)
        points = replace(points, xyz=points.xyz + rng.normal(0, 0.0005, points.xyz.shape))
        self.truth = np.repeat([1, 2, 0], [len(part) for part in parts])
        self.graph = node_graph(points, reach=3.0, colour_sigma=20.0, crease_deg=15.0)
        self.above = points.xyz[:, 1] < -0.015
        self.claims = tuple(self.claim(label) for label in (1, 2))

    def claim(self, label, carried=True):
        xyz, own = self.graph.cloud.xyz, self.truth == label
        low, high = xyz[own].min(0) - 0.01, xyz[own].max(0) + 0.01
        inside = ((xyz >= low) & (xyz <= high)).all(1)
        relative = (xyz - (low + high) / 2) / (high - low)
        centrality = inside * np.exp(-4 * (relative**2).sum(1))
        core = own & self.above
        evidence = BoxEvidence(inside, np.ones(len(xyz), bool), centrality / centrality.sum())
        carrier = None
        if carried:
            carrier = Carrier(
                SurfacePlane(0.0, np.zeros(2)),
                0.004,
                xyz[:, 1],
                np.abs(xyz[:, 1]) < 0.004,
                core,
                xyz[own].mean(0)[[0, 2]],
                1.0,
            )
        return Candidate(evidence, centrality, carrier, core, nearness(xyz, core))


@pytest.fixture(scope="module")
def apart():
    return Table()


def test_probabilities_sum_to_1_and_lie_between_0_and_1(apart):
    labels = label_nodes(apart.graph, apart.claims)
    np.testing.assert_allclose(labels.sum(1), 1, atol=1e-6)
    assert labels.min() >= 0


def test_things_apart_are_each_their_own_boxs(apart):
    labels = label_nodes(apart.graph, apart.claims).argmax(1)
    assert (labels == apart.truth)[apart.above].mean() > 0.99
    assert (labels == 0)[apart.truth == 0].mean() > 0.97


def test_what_nobody_claims_is_background(apart):
    labels = label_nodes(apart.graph, apart.claims[:1])
    outside = ~apart.claims[0].evidence.inside
    np.testing.assert_allclose(labels[outside, 0], 1)
    assert (labels[apart.above & (apart.truth == 1), 1] > 0.5).mean() > 0.99


def test_what_lies_below_the_support_is_background(apart):
    """A support 3 cm up, as when the thing stands behind something: its foot is not its own."""
    claim = apart.claims[0]
    higher = replace(claim.carrier, below=claim.carrier.below + 0.03)
    labels = label_nodes(apart.graph, (replace(claim, carrier=higher),))
    below = (higher.below > higher.band) & (apart.truth == 1)
    assert below.sum() > 50
    assert (labels[below, 0] == 1).all()


def test_boxes_in_another_order_give_the_labels_in_that_order(apart):
    both = label_nodes(apart.graph, apart.claims)
    swapped = label_nodes(apart.graph, apart.claims[::-1])
    same = both.argmax(1) == swapped[:, [0, 2, 1]].argmax(1)
    assert same.mean() > 0.99


def test_rivals_that_touch_are_divided_by_their_boxes():
    touching = Table(gap=0.0)
    labels = label_nodes(touching.graph, touching.claims).argmax(1)
    assert (labels == touching.truth)[touching.above].mean() > 0.9


def test_a_thing_that_nothing_carries_is_still_found(apart):
    alone = apart.graph
    labels = label_nodes(alone, (apart.claim(1, carried=False),))
    core = apart.claims[0].core
    assert labels.shape == (len(alone.cloud), 2)
    assert (labels[~apart.claims[0].evidence.inside, 0] == 1).all()
    assert np.isfinite(labels[core]).all()


def test_all_views_together_can_turn_a_doubtful_node(apart):
    """Where views agree that a part of the box is not the target, it is less so than before."""
    before = label_nodes(apart.graph, apart.claims)
    lower = apart.claims[0].core & (apart.graph.cloud.xyz[:, 1] > -0.06)

    def voted(target):
        votes = Votes(target, np.ones(len(before)))
        return label_nodes(apart.graph, apart.claims, votes, before)

    against = voted(np.where(lower, 0.0, before[:, 1]))
    assert against[lower, 1].mean() < voted(before[:, 1])[lower, 1].mean() - 0.05
    assert against[~apart.claims[0].evidence.inside, 1].max() == 0


def test_the_grip_of_a_support_is_full_below_it_and_ends_above_it(apart):
    carrier = apart.claims[0].carrier
    grip = support_grip(apart.graph, carrier)
    y, upward = apart.graph.cloud.xyz[:, 1], np.abs(apart.graph.cloud.normal[:, 1]) > 0.95
    assert ((grip >= 0) & (grip <= 1)).all()
    assert (grip[y > carrier.band] == 1).all()
    assert (grip[y < -2 * carrier.band] == 0).all()
    assert grip[upward & (np.abs(y) < 0.4 * carrier.band)].min() > 0.9


def test_nearness_is_1_on_the_core_and_falls_with_the_distance():
    xyz = np.column_stack([np.linspace(0, 1, 101), np.zeros((101, 2))])
    core = xyz[:, 0] < 0.3
    near = nearness(xyz, core)
    assert (near[core] == 1).all()
    assert (np.diff(near[~core]) <= 0).all()
    assert near[~core][0] > 0.5
    assert near[-1] < 1e-3
    np.testing.assert_allclose(nearness(3 * xyz, core), near, atol=1e-9)
    assert (nearness(xyz, np.zeros(101, bool)) == 1).all()


def test_a_thing_cut_by_its_box_is_less_isolated_than_one_inside(apart):
    graph, claim = apart.graph, apart.claims[0]
    weights = graph.weights * (np.abs(graph.cloud.xyz[graph.edges][..., 1]) > 0.012).all(1)
    whole = isolation(graph, weights, claim, [])
    x = graph.cloud.xyz[:, 0]
    half = claim.evidence.inside & (x < np.median(x[claim.core]))
    cut = replace(claim, evidence=replace(claim.evidence, inside=half), core=claim.core & half)
    assert whole > 0.95
    assert isolation(graph, weights, cut, []) < 0.5 * whole


def test_touching_a_rival_does_not_count_against_a_things_isolation():
    touching = Table(gap=0.0)
    graph, (own, rival) = touching.graph, touching.claims
    weights = 1.0 * (np.abs(graph.cloud.xyz[graph.edges][..., 1]) > 0.012).all(1)
    assert isolation(graph, weights, own, [rival]) > isolation(graph, weights, own, []) + 0.01
