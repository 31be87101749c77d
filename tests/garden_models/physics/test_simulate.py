"""What the simulation says when it goes wrong, and that it is the same every time."""

from __future__ import annotations

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from garden_models.physics.compose import compose
from garden_models.physics.simulate import Simulation, compile_scene, simulate
from tests.garden_models.physics import room


@pytest.fixture(scope="module")
def scene():
    mesh = room.upright("box", room.box(), 0.01)
    return compose(
        (mesh,),
        (room.at("box", 0, 0.5, 1.9),),
        (room.masks_of("box", room.TABLE),),
        room.room_background(),
        room.GRAVITY,
        room.SCALE,
    )


def test_same_scene_same_bits(scene):
    first, second = (simulate(scene, Simulation(seconds=0.5)) for _ in range(2))
    assert np.array_equal(first.positions_gv, second.positions_gv)
    assert np.array_equal(first.quaternions_gv, second.quaternions_gv)


def test_frames_are_even_and_start_with_the_composed_pose(scene):
    trajectory = simulate(scene, Simulation(seconds=0.5, frames_per_second=40))
    np.testing.assert_allclose(np.diff(trajectory.times_s), 0.025)
    np.testing.assert_allclose(trajectory.positions_gv[0, 0], scene.bodies[0].gv_from_body[:3, 3])


def test_a_top_heavy_body_tips_and_says_so(scene):
    (body,) = scene.bodies
    outside = replace(body, centre_of_mass=body.centre_of_mass + np.array([0.12, 0, 0]))
    motion = simulate(replace(scene, bodies=(outside,)), Simulation(seconds=1.5)).motions[0]
    assert motion.tilt_deg > 3
    assert motion.verdict.status == "degraded"
    assert any("tilted" in reason for reason in motion.verdict.reasons)


def test_a_simulation_that_diverges_is_failed(scene):
    """MuJoCo calls a position beyond 1e10 bad and starts anew; that must not look like rest."""
    (body,) = scene.bodies
    pose = body.gv_from_body.copy()
    pose[0, 3] = 1e11
    far = replace(scene, bodies=(replace(body, gv_from_body=pose),))
    trajectory = simulate(far, Simulation(seconds=1))
    assert trajectory.verdict.status == "failed"
    assert "diverged" in trajectory.verdict.reasons[0]
    assert any("QPOS" in reason and "unstable" in reason for reason in trajectory.verdict.reasons)


def test_contacts_that_do_not_fit_in_memory_make_it_degraded(scene, monkeypatch):
    """MuJoCo leaves out what does not fit, so a body may sink without tilting or drifting."""
    boxes = "".join(
        f"<body pos='{0.05 * i} 0 0.05'><freejoint/><geom type='box' size='.1 .1 .1'/></body>"
        for i in range(60)
    )
    world = f"<worldbody><geom type='plane' size='1 1 1'/>{boxes}</worldbody>"
    scarce = mujoco.MjModel.from_xml_string(f"<mujoco><size memory='1M'/>{world}</mujoco>")
    monkeypatch.setattr("garden_models.physics.simulate.compile_scene", lambda scene: scarce)
    bare = replace(scene, bodies=())
    trajectory = simulate(bare, Simulation(seconds=0.1, frames_per_second=50))
    assert trajectory.verdict.status == "degraded"
    (reason,) = trajectory.verdict.reasons
    assert re.search(r"warned \d+ times: .*arena memory", reason)


def test_no_log_is_left_in_the_users_folder(scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (body,) = scene.bodies
    pose = body.gv_from_body.copy()
    pose[0, 3] = 1e11
    simulate(replace(scene, bodies=(replace(body, gv_from_body=pose),)), Simulation(seconds=1))
    assert list(tmp_path.iterdir()) == []


def test_free_fall_is_that_of_gravity(scene):
    """Dropped from above, a body falls 9.81 t^2 / 2 along +y."""
    (body,) = scene.bodies
    pose = body.gv_from_body.copy()
    pose[1, 3] -= 1.0
    falling = replace(scene, bodies=(replace(body, gv_from_body=pose),))
    trajectory = simulate(falling, Simulation(seconds=0.4, frames_per_second=50))
    fallen = trajectory.positions_gv[-1, 0] - trajectory.positions_gv[0, 0]
    np.testing.assert_allclose(fallen, [0, 9.81 * 0.4**2 / 2, 0], atol=4e-3)


def test_settings_are_the_papers(scene):
    model = compile_scene(scene)
    np.testing.assert_allclose(model.opt.gravity, [0, 9.81, 0])
    assert model.opt.timestep == 0.001
    assert model.opt.iterations == 50
    with pytest.raises(ValueError, match="frames_per_second"):
        Simulation(seconds=0)
