"""Edges are weak where one thing ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from garden_models.geometry.rotation import angle_between_deg
from garden_models.segmentation.node_graph import lab_colours, node_graph
from tests.garden_models.segmentation.clouds import (
    BLUE,
    RED,
    block,
    cloud,
    joined,
    level,
    moved,
    sheet,
)


def graph_of(points, reach=3.0, colour_sigma=20.0, crease_deg=15.0):
    return node_graph(points, reach=reach, colour_sigma=colour_sigma, crease_deg=crease_deg)


def jittered(points, seed=0):
    """Break ties between the distances of a regular grid."""
    rng = np.random.default_rng(seed)
    return replace(points, xyz=points.xyz + rng.normal(0, 0.05, points.xyz.shape) * 0.01)


def across(graph, first):
    """The edges between the points before ``first`` and those from it on."""
    i, j = graph.edges.T
    return (i < first) != (j < first)


@pytest.fixture(scope="module")
def on_table():
    return jittered(joined(level(0.2), block((0.05, 0.06, 0.05))))


def test_each_pair_of_near_neighbours_is_joined_once(on_table):
    graph = graph_of(on_table)
    i, j = graph.edges.T
    assert (i < j).all()
    assert len(np.unique(graph.edges, axis=0)) == len(graph.edges)
    length = np.linalg.norm(on_table.xyz[i] - on_table.xyz[j], axis=1) / 0.01
    np.testing.assert_allclose(graph.length, length, rtol=1e-9)
    assert graph.length.max() <= 3.0


def test_the_edges_are_those_to_the_ten_nearest_within_reach(on_table):
    some = on_table.subset(np.arange(0, len(on_table), 4))
    distance = np.linalg.norm(some.xyz[:, None] - some.xyz[None], axis=2)
    np.fill_diagonal(distance, np.inf)
    wanted = {
        (min(i, j), max(i, j))
        for i, row in enumerate(distance)
        for j in np.argsort(row)[:10]
        if row[j] <= 3.0 * 0.01
    }
    assert set(map(tuple, graph_of(some).edges.tolist())) == wanted


def test_weights_lie_between_0_and_1(on_table):
    weights = graph_of(on_table).weights
    assert weights.min() >= 0
    assert weights.max() <= 1


def test_a_world_turned_enlarged_and_shifted_has_the_same_graph(on_table):
    here, there = graph_of(on_table), graph_of(moved(on_table))
    np.testing.assert_array_equal(here.edges, there.edges)
    np.testing.assert_allclose(here.weights, there.weights, atol=1e-9)


def test_the_order_of_points_does_not_change_what_is_joined(on_table):
    order = np.random.default_rng(0).permutation(len(on_table))
    shuffled = np.sort(order[graph_of(on_table.subset(order)).edges], axis=1)
    here = graph_of(on_table).edges
    assert set(map(tuple, shuffled.tolist())) == set(map(tuple, here.tolist()))


def test_an_edge_between_colours_is_weak():
    left, right = level(0.1, centre=(-0.1, 0), rgb=RED), level(0.1, centre=(0.11, 0), rgb=BLUE)
    graph = graph_of(joined(left, right))
    border = across(graph, len(left))
    assert border.sum() > 20
    assert np.median(graph.weights[border]) < 0.2 * np.median(graph.weights[~border])


def test_a_change_of_light_weakens_less_than_one_of_hue():
    def border(rgb):
        left, right = level(0.1, centre=(-0.1, 0)), level(0.1, centre=(0.11, 0), rgb=rgb)
        graph = graph_of(joined(left, right))
        return np.median(graph.weights[across(graph, len(left))])

    grey = lab_colours(np.array([[128, 128, 128]], np.uint8))
    darker, redder = (81, 81, 81), (160, 114, 117)
    steps = [np.linalg.norm(lab_colours(np.array([c], np.uint8)) - grey) for c in (darker, redder)]
    assert steps[0] == pytest.approx(steps[1], rel=0.1)
    assert border(darker) > border(redder) + 0.1


def test_colours_within_a_busy_texture_do_not_cut_it():
    plain = level(0.1)
    noise = np.random.default_rng(0).integers(0, 256, plain.rgb.shape).astype(np.uint8)
    busy = graph_of(replace(plain, rgb=noise)).weights
    assert np.median(busy) > 0.5 * np.median(graph_of(plain).weights)


def folded(bend_deg):
    """Two rectangles that meet in the x axis, bent up (positive: a valley) by an angle."""
    rise = np.tan(np.radians(bend_deg / 2))
    slope = np.array([0, -rise, 1.0]) / np.hypot(1, rise)
    sides = [
        sheet(
            0.1 * slope * [1, 1, side] + [0, 0, side * 0.002],
            (0.1, 0, 0),
            0.1 * slope * [1, 1, side],
            np.array([0, -1.0, -side * rise]) / np.hypot(1, rise),
        )
        for side in (1, -1)
    ]
    return joined(*sides), len(sides[0])


def test_a_valley_is_weak_and_a_ridge_is_not():
    def fold(bend_deg):
        points, first = folded(bend_deg)
        graph = graph_of(points)
        edges = across(graph, first)
        assert edges.sum() > 20
        return np.median(graph.weights[edges])

    valley, flat, ridge = fold(60.0), fold(0.0), fold(-60.0)
    assert valley < 0.3 * flat
    assert ridge > 0.8 * flat


def test_parts_are_those_that_flooding_finds(on_table):
    graph = graph_of(on_table)
    keep = np.random.default_rng(1).random(len(on_table)) < 0.25
    parts = graph.components(keep)
    neighbours = {i: set() for i in range(len(on_table))}
    for i, j in graph.edges[keep[graph.edges].all(1)]:
        neighbours[i].add(j)
        neighbours[j].add(i)
    for start in np.flatnonzero(keep)[::50]:
        flooded, front = {start}, [start]
        while front:
            front = [n for i in front for n in neighbours[i] - flooded]
            flooded.update(front)
        assert flooded == set(np.flatnonzero(parts == parts[start]))


def test_parts_are_numbered_from_0_and_the_rest_is_minus_1(on_table):
    graph = graph_of(on_table)
    keep = np.random.default_rng(1).random(len(on_table)) < 0.25
    parts = graph.components(keep)
    np.testing.assert_array_equal(parts >= 0, keep)
    assert set(parts[keep]) == set(range(parts.max() + 1))
    assert (graph.components(np.zeros(len(on_table), bool)) == -1).all()


def test_normals_are_smoothed_but_an_edge_stays_sharp():
    top = level(0.1)
    side = sheet((0.1, 0.1, 0), (0, 0.1, 0), (0, 0, 0.1), (1, 0, 0))
    both = joined(top, side)
    noisy = both.normal + np.random.default_rng(0).normal(0, 0.15, both.normal.shape)
    noisy /= np.linalg.norm(noisy, axis=1, keepdims=True)
    smooth = graph_of(replace(both, normal=noisy)).cloud.normal

    def error(normals):
        pairs = zip(normals, both.normal, strict=True)
        return np.mean([angle_between_deg(a, b) for a, b in pairs])

    assert error(smooth) < 0.5 * error(noisy)
    np.testing.assert_allclose(np.linalg.norm(smooth, axis=1), 1, atol=1e-9)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_few_points_are_a_graph_too(count):
    xyz = np.column_stack([0.01 * np.arange(count), np.zeros((count, 2))])
    graph = graph_of(cloud(xyz))
    assert graph.components(np.ones(count, bool)).max() == 0


def test_lab_is_that_of_the_textbook():
    rgb = np.array([[0, 0, 0], [255, 255, 255], [255, 0, 0], [0, 0, 255]], np.uint8)
    lab = [[0, 0, 0], [100, 0, 0], [53.24, 80.09, 67.20], [32.30, 79.19, -107.86]]
    np.testing.assert_allclose(lab_colours(rgb), lab, atol=0.5)
