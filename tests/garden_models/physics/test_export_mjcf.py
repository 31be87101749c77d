"""The exported MJCF loads in MuJoCo, is z-up, carries its inertia, and rests."""

from __future__ import annotations

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from garden_models.physics.compose import compose
from garden_models.physics.config import Simulation
from garden_models.physics.export_mjcf import mjcf_zup
from garden_models.physics.mjcf import ZUP_FROM_GV, write_mjcf
from garden_models.physics.simulate import simulate
from storage.formats.png import rgb_png
from tests.garden_models.physics import room


def load(mjcf):
    pictures = {name: rgb_png(rgb) for name, rgb in mjcf.textures.items()}
    return mujoco.MjModel.from_xml_string(mjcf.xml, mjcf.asset_bytes | pictures)


@pytest.fixture(scope="module")
def scene():
    return compose(
        (room.upright("box", room.box(), 0.01), room.upright("mug", room.mug()),
         room.upright("lamp", room.box())),
        (room.at("box", 0, 0.5, 1.9, 0.4), room.at("mug", 0.3, 0.5, 1.9),
         room.at("lamp", 0, -1.0, 1.9)),
        (room.masks_of("box", room.TABLE), room.masks_of("mug", room.TABLE),
         room.masks_of("lamp", None)),
        room.room_background(),
        room.GRAVITY,
        room.SCALE,
    )  # fmt: skip


def test_it_loads_and_rests_upright(scene):
    trajectory = simulate(scene, Simulation(seconds=1))
    mjcf = mjcf_zup(scene, trajectory)
    model = load(mjcf)
    data = mujoco.MjData(model)
    np.testing.assert_allclose(model.opt.gravity, [0, 0, -9.81])
    assert model.opt.timestep == 0.001
    assert model.opt.iterations == 50
    assert model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
    assert model.opt.solver == mujoco.mjtSolver.mjSOL_NEWTON
    assert (model.dof_damping == 0).all()
    for key in ("recon", "settled"):
        mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
        mujoco.mj_forward(model, data)
        start = data.xpos.copy()
        mujoco.mj_step(model, data, nstep=2000)
        assert np.abs(data.xpos - start).max() < 1e-3
    for body in scene.bodies:
        got = data.body(body.name).xpos
        np.testing.assert_allclose(got, ZUP_FROM_GV @ body.gv_from_body[:3, 3], atol=1e-3)
    assert np.ptp(data.body("box").xpos[2] + 0.5) < 1e-3  # the table's top is at z = -0.5


def test_mass_and_inertia_are_explicit(scene):
    mjcf = mjcf_zup(scene)
    assert mjcf.xml.count("<inertial") == len(scene.bodies)
    model = load(mjcf)
    for body in scene.bodies:
        compiled = model.body(body.name)
        assert compiled.mass[0] == pytest.approx(body.mass_kg, rel=1e-6)
        np.testing.assert_allclose(
            np.sort(compiled.inertia), np.linalg.eigvalsh(body.inertia), rtol=1e-5
        )


def test_files_are_named_as_asked_and_all_there(scene):
    mjcf = mjcf_zup(scene, mesh_prefix="meshes/")
    assert mjcf.assets
    assert len(mjcf.textures) == len(scene.bodies)
    for name in mjcf.assets | mjcf.textures:
        assert name.startswith("meshes/")
        assert f'file="{name}"' in mjcf.xml


def test_gravity_view_and_zup_are_the_same_physics(scene):
    ends = []
    for frame in (np.eye(3), ZUP_FROM_GV):
        mjcf = write_mjcf(scene.bodies, scene.supports, frame)
        model = load(mjcf)
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, nstep=1000)
        ends.append(data.xpos @ frame)
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-4)


def test_names_of_objects_make_safe_file_names(scene):
    named = [replace(body, name=f"../{i} é") for i, body in enumerate(scene.bodies)]
    renamed = replace(scene, bodies=tuple(named))
    mjcf = mjcf_zup(renamed)
    assert len(mjcf.assets) == len(mjcf_zup(scene).assets)
    assert len(mjcf.textures) == len(mjcf_zup(scene).textures)
    assert all(re.fullmatch(r"assets/[A-Za-z0-9_-]+\.obj", name) for name in mjcf.assets)
    assert all(re.fullmatch(r"assets/[A-Za-z0-9_-]+\.png", name) for name in mjcf.textures)
    model = load(mjcf)
    assert model.body("../0 é").id > 0


def test_what_is_seen_adds_nothing_to_the_physics(scene):
    plain, seen = (
        load(write_mjcf(scene.bodies, scene.supports, ZUP_FROM_GV, visuals=visuals))
        for visuals in (False, True)
    )
    np.testing.assert_array_equal(seen.body_mass, plain.body_mass)
    np.testing.assert_array_equal(seen.body_inertia, plain.body_inertia)
    collides = (seen.geom_contype != 0) | (seen.geom_conaffinity != 0)
    assert collides.sum() == plain.ngeom
    assert seen.ngeom == plain.ngeom + len(scene.bodies)
    assert (seen.geom_matid[collides] == -1).all()
    assert (seen.geom_group[~collides] == 2).all()
    for name in ("geom_pos", "geom_quat", "geom_size", "geom_friction", "geom_rgba"):
        np.testing.assert_array_equal(getattr(seen, name)[collides], getattr(plain, name))


def test_a_body_without_colours_is_grey(scene):
    bare = replace(scene.bodies[0], vertex_rgb=np.zeros((0, 3), np.uint8))
    model = load(mjcf_zup(replace(scene, bodies=(bare,))))
    assert model.ntex == 0
    np.testing.assert_allclose(model.geom(f"{bare.name}_visual").rgba, [0.5, 0.5, 0.5, 1.0])
