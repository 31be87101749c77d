"""Draw a MuJoCo model off screen, for tests that look at what a viewer would show."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np
import pytest


@contextmanager
def drawing(size: int) -> Iterator[None]:
    """Give the block an off-screen OpenGL context; skip the test where none can be had."""
    backend = _backend()
    try:
        # Not mujoco.Renderer: its backend is fixed when mujoco is first imported.
        context = importlib.import_module(f"mujoco.{backend}").GLContext(size, size)
        context.make_current()
    except Exception as error:  # noqa: BLE001 -- each platform fails in its own way
        pytest.skip(f"no OpenGL to draw with ({backend}: {error})")
    try:
        yield
    finally:
        context.free()


def _backend() -> str:
    """Name the one that needs no display (glfw, MuJoCo's default, aborts without one)."""
    if os.environ.get("MUJOCO_GL", "").lower() == "osmesa":
        return "osmesa"
    return "cgl" if sys.platform == "darwin" else "egl"


def picture(
    model: mujoco.MjModel, look_at: np.ndarray, forward: np.ndarray, distance: float, size: int
) -> np.ndarray:
    """Return (size, size, 3) uint8, first row on top: colours as they are, without shading.

    ``forward`` is the unit direction of the camera's view in the model's frame. Only inside
    ``drawing``.
    """
    model.vis.headlight.ambient, model.vis.headlight.diffuse = 1.0, 0.0
    model.vis.headlight.specular = 0.0
    model.vis.global_.offwidth = model.vis.global_.offheight = size
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance = look_at, distance
    camera.azimuth = np.degrees(np.arctan2(forward[1], forward[0]))
    camera.elevation = np.degrees(np.arcsin(forward[2]))
    scene = mujoco.MjvScene(model, maxgeom=100)
    mujoco.mjv_updateScene(
        model, data, mujoco.MjvOption(), None, camera, mujoco.mjtCatBit.mjCAT_ALL, scene
    )
    context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
    mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
    viewport = mujoco.MjrRect(0, 0, size, size)
    mujoco.mjr_render(viewport, scene, context)
    rgb = np.empty((size, size, 3), np.uint8)
    mujoco.mjr_readPixels(rgb, None, viewport, context)
    context.free()
    return rgb[::-1]
