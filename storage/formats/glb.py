"""Write meshes with vertex colours as binary glTF (y up, metres)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float, Int, UInt8


@dataclass(frozen=True)
class GlbNode:
    """One named mesh with its pose; ``points`` without faces become a point primitive."""

    name: str
    vertices: Float[np.ndarray, "v 3"]
    faces: Int[np.ndarray, "f 3"] | None
    rgb: UInt8[np.ndarray, "v 3"]
    scene_from_node: Float[np.ndarray, "4 4"]


def scene_glb(nodes: list[GlbNode]) -> bytes:
    """Return a GLB with one node per mesh or point set."""
    scene = trimesh.Scene()
    for node in nodes:
        geometry: trimesh.Trimesh | trimesh.PointCloud
        if node.faces is None:
            geometry = trimesh.PointCloud(node.vertices, colors=_rgba(node.rgb))
        else:
            geometry = trimesh.Trimesh(
                node.vertices, node.faces, vertex_colors=_rgba(node.rgb), process=False
            )
        scene.add_geometry(
            geometry,
            node_name=node.name,
            geom_name=node.name,
            transform=node.scene_from_node,
        )
    return bytes(scene.export(file_type="glb"))


def _rgba(rgb: UInt8[np.ndarray, "v 3"]) -> UInt8[np.ndarray, "v 4"]:
    return np.concatenate([rgb, np.full((len(rgb), 1), 255, np.uint8)], axis=1)
