"""What carries the thing in a box, and what only looks like it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from garden_models.segmentation.carrier import BoxEvidence, find_carrier
from garden_models.segmentation.node_graph import node_graph
from tests.garden_models.segmentation.clouds import block, joined, level, moved, sheet

HALF = (0.08, 0.1, 0.08)


def standing(*others, lift=0.0):
    """A block on a table at y = 0 (the first points), and how many points it has."""
    rng = np.random.default_rng(0)
    thing = block(HALF, bottom=-lift)
    both = joined(thing, level(0.4), *others)
    return replace(both, xyz=both.xyz + rng.normal(0, 0.0005, both.xyz.shape)), len(thing)


def boxed(points, thing, reach=0.12):
    """A round box about the thing: it holds some of the table as well."""
    reach = reach * np.ptp(points.xyz[:thing, 1]) / (2 * HALF[1])
    away = (points.xyz - points.xyz[:thing].mean(0)) / reach
    radius = np.hypot(away[:, 0], away[:, 2])
    inside = (radius < 1) & (np.abs(away[:, 1]) < 1)
    central = inside * np.exp(-(radius**2) - away[:, 1] ** 2)
    return BoxEvidence(inside, np.ones(len(points), bool), central / central.sum())


def carrier_of(points, thing, **settings):
    graph = node_graph(points, reach=3.0, colour_sigma=20.0, crease_deg=15.0)
    settings = {"max_tilt_deg": 8.0, "band_sigma": 3.0, "min_score": 0.05, **settings}
    return find_carrier(graph, boxed(points, thing), **settings)


def height_under_foot(carrier):
    return carrier.plane.height + carrier.plane.slope @ carrier.foot_xz


def test_a_block_on_a_table_is_carried_by_the_table():
    points, thing = standing()
    carrier = carrier_of(points, thing)
    assert height_under_foot(carrier) == pytest.approx(0, abs=0.001)
    np.testing.assert_allclose(carrier.foot_xz, 0, atol=0.01)
    assert carrier.score > 0.5
    well_above = points.xyz[:, 1] < -0.02
    np.testing.assert_array_equal(carrier.core[well_above], well_above[well_above])
    assert not carrier.core[thing:].any()
    assert carrier.inliers[thing:].mean() > 0.95


def test_the_blocks_own_lid_does_not_carry_it():
    """It is level and large, but ends inside of the box."""
    points, thing = standing()
    carrier = carrier_of(points, thing)
    assert height_under_foot(carrier) > -0.01


def test_below_is_the_height_over_the_table():
    points, thing = standing()
    carrier = carrier_of(points, thing)
    np.testing.assert_allclose(carrier.below, points.xyz[:, 1], atol=0.003)


def test_a_lower_floor_does_not_carry_what_stands_on_the_table():
    points, thing = standing(level(0.8, y=0.5, spacing=0.02))
    assert height_under_foot(carrier_of(points, thing)) == pytest.approx(0, abs=0.002)


def test_nothing_carries_a_block_that_hangs_in_the_air():
    points, thing = standing(lift=0.3)
    assert carrier_of(points, thing) is None


def test_nothing_carries_a_block_without_any_level_surface():
    points, thing = standing()
    bare = points.subset(np.abs(points.normal[:, 1]) < 0.5)
    assert carrier_of(bare, int((np.abs(points.normal[:thing, 1]) < 0.5).sum())) is None


def test_a_level_part_that_ends_inside_the_box_does_not_carry():
    """A block on a slightly larger foot of its own; what that stands on was not seen."""
    own_foot = block((0.084, 0.03, 0.084), bottom=0.06)
    thing = block(HALF)
    assert carrier_of(joined(thing, own_foot), len(thing)) is None


def test_a_table_beside_it_does_not_carry():
    thing = block(HALF)
    assert carrier_of(joined(thing, level(0.2, centre=(0.36, 0))), len(thing)) is None


def test_a_wall_does_not_carry():
    wall = sheet((0, -0.1, 0.09), (0.4, 0, 0), (0, 0.4, 0), (0, 0, -1))
    points, thing = standing()
    no_table = joined(points.subset(np.arange(thing)), wall)
    assert carrier_of(no_table, thing) is None


@pytest.mark.parametrize("tilt_deg", [3.0, 6.0])
def test_a_leaning_support_is_followed(tilt_deg):
    points, thing = standing()
    lean = np.tan(np.radians(tilt_deg))
    leaning = replace(points, xyz=points.xyz + np.outer(points.xyz[:, 0], [0, lean, 0]))
    carrier = carrier_of(leaning, thing)
    np.testing.assert_allclose(carrier.plane.slope, [lean, 0], atol=0.01)
    np.testing.assert_allclose(carrier.below, points.xyz[:, 1], atol=0.004)


def test_a_bulging_support_is_followed():
    """A cushion that rises 1.5 cm towards the block: its points are support all the same."""
    points, thing = standing()
    bulge = 0.015 * np.exp(-((points.xyz[:, [0, 2]] / 0.25) ** 2).sum(1))
    cushion = replace(points, xyz=points.xyz - np.outer(bulge, [0, 1, 0]))
    carrier = carrier_of(cushion, thing)
    near = (np.abs(points.xyz[:, [0, 2]]) < 0.2).all(1)
    near[:thing] = False
    assert np.abs(carrier.below[near]).max() < 0.5 * np.ptp(cushion.xyz[near, 1])
    assert np.median(np.abs(carrier.below[near])) < 0.002


def test_a_world_turned_enlarged_and_shifted_has_the_same_carrier():
    points, thing = standing()
    here, there = carrier_of(points, thing), carrier_of(moved(points), thing)
    np.testing.assert_array_equal(here.core, there.core)
    assert (here.inliers == there.inliers).mean() > 0.99
    np.testing.assert_allclose(there.below, 2 * here.below, atol=0.004)
    assert there.score == pytest.approx(here.score, abs=0.02)


def test_a_score_under_the_least_is_no_carrier():
    points, thing = standing()
    score = carrier_of(points, thing).score
    assert carrier_of(points, thing, min_score=score * 1.01) is None
    assert carrier_of(points, thing, min_score=score * 0.99) is not None
