"""Composing and simulating: things that stand keep standing, and what does not says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from garden_models.physics.compose import compose
from garden_models.physics.config import Simulation
from garden_models.physics.simulate import simulate
from garden_models.scene import BadInput, Scale
from tests.garden_models.physics import room


def composed(things, supports=None):
    """Compose (mesh, placement) pairs; all stand on the table unless told otherwise."""
    meshes, placements = zip(*things, strict=True)
    supports = supports or [room.TABLE] * len(meshes)
    masks = tuple(room.masks_of(m.name, s) for m, s in zip(meshes, supports, strict=True))
    return compose(
        tuple(meshes), tuple(placements), masks, room.room_background(), room.GRAVITY, room.SCALE
    )


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.02])
def test_touching_noisy_things_stay_put_for_ten_seconds(noise):
    scene = composed(
        [
            (room.upright("box", room.box(), noise, 0), room.at("box", 0, 0.503, 1.9)),
            (room.upright("mug", room.mug(), noise, 1), room.at("mug", 0.124, 0.499, 1.9)),
            (room.upright("ball", room.ball(), noise, 2), room.at("ball", -0.2, 0.5, 1.8)),
        ]
    )
    assert {body.supported_by for body in scene.bodies} == {"table_1"}
    assert [support.kind for support in scene.supports] == ["floor", "table"]
    trajectory = simulate(scene)
    assert trajectory.times_s[-1] == pytest.approx(10.0)
    assert trajectory.verdict.status == "ok"
    for motion in trajectory.motions:
        assert motion.drift_m < 1e-3
        assert motion.tilt_deg < 0.5
        assert motion.penetration_m < 1e-3
        assert motion.at_rest


def test_a_thing_inside_its_support_is_lifted_and_says_how_far():
    scene = composed([(room.upright("box", room.box()), room.at("box", 0, 0.54, 1.9))])
    (body,) = scene.bodies
    assert body.lifted_m == pytest.approx(0.04, abs=0.004)
    assert body.verdict.status == "degraded"
    assert "lifted" in body.verdict.reasons[0]
    assert simulate(scene).motions[0].drift_m < 1e-3


def two_boxes(distance):
    """Compose two boxes, 0.16 wide and 0.2 high, whose centres are ``distance`` apart."""
    mesh = room.upright("a", room.box())
    places = room.at("a", 0, 0.5, 1.9), room.at("b", distance, 0.5, 1.9)
    return composed([(mesh, places[0]), (replace(mesh, name="b"), places[1])])


def test_what_overlaps_within_its_noise_is_trimmed_and_stays_where_it_was_seen():
    scene = two_boxes(0.15)
    assert all(body.pushed_m == 0 for body in scene.bodies)
    assert all("cut back" in body.physics_note for body in scene.bodies)
    assert all(motion.drift_m < 1e-3 for motion in simulate(scene).motions)


def test_things_that_overlap_more_are_pushed_apart_sideways():
    scene = two_boxes(0.142)
    gap = scene.bodies[1].gv_from_body[0, 3] - scene.bodies[0].gv_from_body[0, 3] - 0.16
    assert 0 <= gap < 1e-3
    assert all(body.pushed_m == pytest.approx(0.009, abs=1e-3) for body in scene.bodies)
    assert all(abs(body.lifted_m) < 1e-6 for body in scene.bodies)
    assert all(motion.drift_m < 1e-3 for motion in simulate(scene).motions)


def test_one_thing_upon_another_rests_there():
    low = room.upright("low", room.box())
    high = room.upright("high", room.box((0.1, 0.1, 0.06)))
    top = 0.5 - 0.2
    own = replace(room.TABLE, kind="patch", height_gv=top)
    scene = composed(
        [(low, room.at("low", 0, 0.5, 1.9)), (high, room.at("high", 0, top + 0.002, 1.9))],
        [room.TABLE, own],
    )
    assert [body.supported_by for body in scene.bodies] == ["table_1", "low"]
    assert len(scene.supports) == 2
    trajectory = simulate(scene)
    assert trajectory.verdict.status == "ok"
    assert max(motion.drift_m for motion in trajectory.motions) < 1e-3


def test_without_support_a_thing_is_fixed_and_degraded():
    scene = composed([(room.upright("fox", room.box()), room.at("fox", 0, 0.2, 1.9))], [None])
    assert scene.verdict.status == "degraded"
    assert "nothing was found that carries fox" in scene.verdict.reasons[0]
    trajectory = simulate(scene, Simulation(seconds=1))
    assert trajectory.motions[0].drift_m == 0
    assert np.ptp(trajectory.positions_gv[:, 0], axis=0).max() == 0


def test_a_thing_over_the_edge_falls_and_says_so():
    """Its centre of mass is beyond the table although a tip of it is above."""
    narrow = replace(room.TABLE, outline_gv=room.TABLE_OUTLINE * [0.1, 1] + [0.06, 0])
    mesh = room.upright("box", room.box((0.4, 0.1, 0.1)))
    background = room.room_background()
    floor_only = background.points_gv.subset(background.points_gv.xyz[:, 1] > 1.0)
    scene = compose(
        (mesh,),
        (room.at("box", 0.2, 0.5, 1.9),),
        (room.masks_of("box", narrow),),
        replace(background, points_gv=floor_only),
        room.GRAVITY,
        room.SCALE,
    )
    carried = replace(scene.supports[-1], outline_gv=narrow.outline_gv)
    scene = replace(scene, supports=(*scene.supports[:-1], carried))
    motion = simulate(scene, Simulation(seconds=2)).motions[0]
    assert motion.verdict.status == "degraded"
    assert any("fell" in reason for reason in motion.verdict.reasons)


def test_scale_is_baked_and_an_assumed_scale_is_said():
    mesh, placement = room.upright("box", room.box()), room.at("box", 0, 0.5, 1.9, scale=1.5)
    scene = composed([(mesh, placement)])
    np.testing.assert_allclose(np.ptp(scene.bodies[0].vertices, axis=0), [0.24, 0.3, 0.15])
    np.testing.assert_allclose(np.linalg.det(scene.bodies[0].gv_from_body[:3, :3]), 1)
    assert scene.bodies[0].mass_kg == pytest.approx(400 * 0.24 * 0.3 * 0.15, rel=1e-6)
    unknown = compose(
        (mesh,),
        (placement,),
        (room.masks_of("box", room.TABLE),),
        room.room_background(),
        room.GRAVITY,
        Scale("unknown", 1.0),
    )
    assert unknown.verdict.status == "ok"
    assert "assumed scale" in unknown.verdict.reasons[0]


def test_what_does_not_belong_together_is_refused():
    mesh = room.upright("box", room.box())
    with pytest.raises(BadInput, match="same targets"):
        compose(
            (mesh,),
            (room.at("mug", 0, 0.5, 1.9),),
            (room.masks_of("box", None),),
            room.room_background(),
            room.GRAVITY,
            room.SCALE,
        )


def test_nothing_to_simulate_is_no_error():
    scene = compose((), (), (), room.room_background(), room.GRAVITY, room.SCALE)
    assert simulate(scene, Simulation(seconds=0.1)).positions_gv.shape == (6, 0, 3)


def test_a_flat_mesh_is_left_out_and_the_rest_goes_on():
    flat = room.upright("paper", room.box())
    flat = replace(flat, vertices=flat.vertices * [1, 0, 1])
    scene = composed(
        [(flat, room.at("paper", 0, 0.5, 1.9)), (room.upright("box", room.box()),
         room.at("box", 0.3, 0.5, 1.9))]
    )  # fmt: skip
    assert [body.name for body in scene.bodies] == ["box"]
    assert scene.verdict.status == "degraded"
    assert "paper is left out" in scene.verdict.reasons[0]
