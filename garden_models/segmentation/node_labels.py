"""Divide the nodes near a box between the background and the targets, in 3D."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from garden_models.segmentation.carrier import BoxEvidence, Carrier
from garden_models.segmentation.colours import colour_bins, colour_counts, colour_posterior
from garden_models.segmentation.node_graph import NodeGraph, lab_colours
from garden_models.segmentation.random_walk import walk_on_graph

Probabilities = Float[np.ndarray, "n labels"]

# Strengths are relative to the edges' weights, which go up to 1.
SURE = 10.0
"""What cannot be otherwise."""
SUPPORT = 1.0
"""A node on or below the support."""
VOTE = 0.5
"""The votes of three or more views."""
ISOLATED = 0.3
"""A node of a connected core that nothing joins to what is outside of the box."""
COLOUR = 0.05
"""A node's colour, where the labels' colours differ fully."""
CENTRE = 0.2
"""The nodes in the middle of a box that its view sees, as if all nodes inside and above the
support were such, together, in units of a cut across them.
"""
RIM = 0.03
"""The same for the nodes far from the middle or hidden from the box's view, towards the
background: what goes on behind or beside the target is not drawn along with it.
"""
LEAK = 0.3
"""A core leaks when its joints to the outside reach this share of a cut across it."""
RISES = 3.0
"""What stands beside the box rises above the support by more than this many bands."""
NEAR = 0.1
"""A part cut off from the core counts as near within this share of the core's size."""
COLOUR_ROUNDS = 3
SHARED = 0.02
"""What is left at first of a box's claim on nodes that a rival's box claims too."""


@dataclass(frozen=True)
class Candidate:
    """One target's claim on the nodes: its box, how central (0..1) nodes are in it, what
    carries it (None: nothing), the connected nodes that fill its middle, and how near
    (0..1) all nodes are to those.
    """

    evidence: BoxEvidence
    centrality: Float[np.ndarray, " n"]
    carrier: Carrier | None
    core: Bool[np.ndarray, " n"]
    near: Float[np.ndarray, " n"]


@dataclass(frozen=True)
class Votes:
    """What the views say of each node: probability of the target, and weight (0..1)."""

    target: Float[np.ndarray, " n"]
    weight: Float[np.ndarray, " n"]


def label_nodes(
    graph: NodeGraph,
    candidates: tuple[Candidate, ...],
    votes: Votes | None = None,
    before: Probabilities | None = None,
) -> Probabilities:
    """Return each node's probabilities: column 0 background, then one a candidate.

    A node outside of a target's box, or on or below what carries it, is not its. The rest
    is a random walk: from the middle of each box, from its rim and what is background, from
    the labels' colours, and from the ``votes`` of the views on the first candidate;
    ``before`` is then the last round's result.
    """
    open_to, grip = _claims(graph, candidates)
    weights = _above_support(graph, candidates)
    contested = open_to[:, 1:].sum(1)
    draws = np.zeros(open_to.shape)
    rims = np.full(open_to.shape, np.inf)
    for k, candidate in enumerate(candidates, 1):
        others = [other for other in candidates if other is not candidate]
        alone = isolation(graph, weights, candidate, others)
        draws[:, k], rims[:, k] = _draws(candidate, open_to[:, k], alone * (1 - grip))
    draws[:, 0] = np.where(contested > 0, rims.min(1), 0.0)
    bins = colour_bins(lab_colours(graph.cloud.rgb))
    result = before
    for _ in range(COLOUR_ROUNDS + (before is None)):
        drawn = _divided(draws, candidates, contested, result)
        drawn[:, 0] += SUPPORT * np.where(contested == 1, grip, 0.0)
        if votes is not None and before is not None:
            drawn += _vote(votes, before, open_to)
        if result is not None:
            colour, sure = _colour_evidence(bins, result, graph.cloud.spacing**2)
            drawn += COLOUR * sure[:, None] * colour
        drawn[contested == 0] = np.eye(open_to.shape[1])[0] * SURE
        strength = drawn.sum(1)
        prior = drawn / np.maximum(strength, 1e-12)[:, None]
        prior[strength <= 0, 0] = 1.0
        result = walk_on_graph(graph.edges, weights, prior, strength, result) * open_to
        result /= np.maximum(result.sum(1, keepdims=True), 1e-9)
    assert result is not None
    return result


def _divided(
    draws: Probabilities,
    candidates: tuple[Candidate, ...],
    contested: Int[np.ndarray, " n"],
    before: Probabilities | None,
) -> Probabilities:
    """Return what draws nodes to each label: what rivals both claim belongs to one of them,
    divided as in the last result; at first only what one alone claims counts in full.
    """
    near = np.column_stack([np.ones(len(draws)), *(one.near for one in candidates)])
    drawn = draws * near
    if before is None:
        drawn *= np.where(contested > 1, SHARED, 1.0)[:, None]
    else:
        share = before[:, 1:] / np.maximum(before[:, 1:].sum(1, keepdims=True), 1e-9)
        full = drawn[:, 1:].max(1, keepdims=True)
        drawn[:, 1:] = np.where(contested[:, None] > 1, full * share, drawn[:, 1:])
    drawn[:, 0] += np.where(contested == 1, (draws * (1 - near)).sum(1), 0.0)
    return drawn


def support_grip(graph: NodeGraph, carrier: Carrier) -> Float[np.ndarray, " n"]:
    """Return how surely (0..1) each node belongs to the support or lies below it.

    Within the band, a node that faces up is support, the surer the nearer to it; one that
    faces sideways may be the foot of what stands there.
    """
    below = carrier.below / carrier.band
    upward = np.clip((np.abs(graph.cloud.normal[:, 1]) - 0.75) / 0.2, 0, 1)
    near = np.clip(1.5 - np.abs(below), 0, 1) * upward
    return np.where(below > 1.0, 1.0, np.where(below > -0.3, np.maximum(near, 0.5), near))


def isolation(
    graph: NodeGraph,
    weights: Float[np.ndarray, " e"],
    candidate: Candidate,
    others: list[Candidate],
) -> float:
    """Return 1 where no edges lead from the core out of the box, falling to 0 with them.

    ``weights`` are the edges' own, those to the support cut: there the core ends by its
    height. Edges to what lies in another's box do not count either; things that touch
    are one in this, so that none of them claims the other by being better cut off.
    """
    i, j = graph.edges.T
    core, outside = candidate.core.copy(), ~candidate.evidence.inside
    for other in others:
        outside &= ~other.evidence.inside
        if (other.core & candidate.core).any():
            core |= other.core
    joints = float(weights[(core[i] & outside[j]) | (core[j] & outside[i])].sum())
    across = 3 * math.sqrt(max(int(np.count_nonzero(core)), 1))
    return float(np.exp(-((joints / across / LEAK) ** 2)))


def _above_support(graph: NodeGraph, candidates: tuple[Candidate, ...]) -> Float[np.ndarray, " e"]:
    """Return the edges' weights, those that lead to a support surface cut.

    What stands on a surface is told from it by height, and by the image, not by how the
    points of the contact hang together.
    """
    kept = np.ones(len(graph.cloud))
    for k, candidate in enumerate(candidates):
        if candidate.carrier is not None:
            depth = np.abs(candidate.carrier.below) / candidate.carrier.band
            near = depth < 1.5
            # A rival may stand on the target: its support then counts in its own box only.
            near &= candidate.evidence.inside if k else True
            kept *= np.where(near, 1 - support_grip(graph, candidate.carrier), 1.0)
            # Outside of the box, what hardly rises above the support is its noise.
            kept[(depth < RISES) & ~candidate.evidence.inside] = 0.0
    i, j = graph.edges.T
    return graph.weights * kept[i] * kept[j]


def _claims(
    graph: NodeGraph, candidates: tuple[Candidate, ...]
) -> tuple[Bool[np.ndarray, "n labels"], Float[np.ndarray, " n"]]:
    """Return which labels each node may have, and the supports' grip on it."""
    open_to = np.ones((len(graph.cloud), len(candidates) + 1), bool)
    on_support = np.zeros(len(graph.cloud))
    for k, candidate in enumerate(candidates, 1):
        open_to[:, k] = candidate.evidence.inside
        if candidate.carrier is not None:
            grip = support_grip(graph, candidate.carrier)
            open_to[:, k] &= grip < 1.0
            on_support = np.maximum(on_support, np.where(candidate.evidence.inside, grip, 0.0))
    return open_to, on_support


def nearness(
    xyz: Float[np.ndarray, "n 3"], core: Bool[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Return 1 for the nodes of a core, falling to 0 with the distance from it: what is near
    may be a part of it that holes in the points cut off.
    """
    if not core.any():
        return np.ones(len(xyz))
    low, high = np.percentile(xyz[core], [2, 98], axis=0)
    size = float(np.linalg.norm(high - low))
    reach = max(NEAR * size, 1e-12)
    distance, _ = cKDTree(xyz[core]).query(xyz, distance_upper_bound=4 * reach, workers=2)
    return np.where(core, 1.0, 0.8 * np.exp(-((distance / reach) ** 2)))


def _draws(
    candidate: Candidate, claimed: Bool[np.ndarray, " n"], alone: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return how strongly a candidate draws the nodes that it claims, and how strongly the
    background does (infinite for nodes that it does not claim).

    ``alone`` (0..1) says how isolated the core is, and that a node is not of the support.
    """
    # Counted over a surface of n nodes, a cut across it meets about sqrt(n) of them.
    weak = 1.0 / math.sqrt(max(int(np.count_nonzero(claimed)), 1))
    middle = candidate.near * candidate.centrality * candidate.evidence.seen
    claim = weak * CENTRE * middle + ISOLATED * candidate.core * alone
    return claimed * claim, np.where(claimed, weak * RIM * (1 - middle), np.inf)


def _vote(
    votes: Votes, before: Probabilities, open_to: Bool[np.ndarray, "n labels"]
) -> Float[np.ndarray, "n labels"]:
    """Spread the votes over the labels: what is not the first candidate's is divided
    between the other labels as before.
    """
    rest = before * open_to
    rest[:, 0] += 1e-6
    rest[:, 1] = 0.0
    rest /= rest.sum(1, keepdims=True)
    out = rest * (1 - votes.target)[:, None]
    out[:, 1] = votes.target * open_to[:, 1]
    return VOTE * votes.weight[:, None] * out


def _colour_evidence(
    bins: Int[np.ndarray, " n"], labels: Probabilities, area: Float[np.ndarray, " n"]
) -> tuple[Probabilities, Float[np.ndarray, " n"]]:
    """Return what the nodes' colours say of their labels, and how surely (0..1).

    All targets are as likely, however large they are, and together as the background: by
    its size alone a large one would take a small one's colours.
    """
    counts = colour_counts(bins, labels * area[:, None])
    count = labels.shape[1]
    prior = np.array([0.5] + [0.5 / (count - 1)] * (count - 1))
    colour = colour_posterior(counts, prior)[bins]
    best: Float[np.ndarray, " n"] = colour.max(axis=1)
    return colour, ((count * best - 1) / (count - 1)).clip(0, 1) ** 2
