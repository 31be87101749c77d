"""Build the files that MuJoCo opens: scene.xml with its meshes and textures."""

from __future__ import annotations

from garden_models.physics.export_mjcf import mjcf_zup
from garden_models.scene import SimScene, Trajectory
from storage.formats.png import rgb_png


def mujoco_files(scene: SimScene, trajectory: Trajectory | None = None) -> dict[str, bytes]:
    """Return scene.xml (z up, metres) and what it names in assets/, by relative file name."""
    mjcf = mjcf_zup(scene, trajectory)
    textures = {name: rgb_png(rgb) for name, rgb in mjcf.textures.items()}
    return {"scene.xml": mjcf.xml.encode(), **mjcf.asset_bytes, **textures}
