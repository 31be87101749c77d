"""Build all files of a package from a scene's artifacts, as far as the scene came."""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np

from flows.package.background import background_files
from flows.package.frames import GLTF_FROM_GV, frames_document
from flows.package.licences import licences_document
from flows.package.mujoco_files import mujoco_files
from flows.report.document import Json, report_document
from flows.report.page import report_page
from flows.report.values import SceneValues
from garden_models.scene import Background, SimScene
from storage.formats.colmap import colmap_model
from storage.formats.glb import GlbNode, scene_glb
from storage.formats.nerfstudio import transforms_json
from storage.formats.png import depth_png, mask_png
from storage.redact import redact

GLB_POINTS = 200_000
"""Background points in scene.glb; all of them are in background/points.ply."""


def package_files(values: SceneValues) -> tuple[dict[str, bytes], Json]:
    """Return the package's files and its report."""
    document = report_document(values)
    files = {
        "report.json": dump_json(document),
        "report.html": redact(report_page(values, document)).encode(),
        "timings.parquet": timings_parquet(document),
        "targets.json": dump_json(_targets(values)),
        "LICENSES.json": dump_json(
            licences_document(
                (step["backend"] or "" for step in document["steps"]), _services(document)
            )
        ),
    }
    if values.reconstruction is not None:
        files |= _camera_files(values) | _view_files(values)
    if values.gravity_view is not None and values.cameras is not None:
        files["frames.json"] = dump_json(frames_document(values.gravity_view, values.cameras.scale))
    if values.background is not None:
        files |= background_files(values.background, values.gaussians)
    if values.scene is not None and values.trajectory is not None:
        files |= mujoco_files(values.scene, values.trajectory)
        files["scene.glb"] = _glb(values.scene, values.background)
    return files, document


def _services(document: Json) -> list[str]:
    """Return the models that were asked over a network."""
    proposal = document["proposal"]
    return sorted({query["model"] for query in proposal["queries"]}) if proposal else []


def dump_json(value: Any) -> bytes:
    """Return readable JSON."""
    return (json.dumps(value, indent=1) + "\n").encode()


def timings_parquet(document: Json) -> bytes:
    """Return one row per step and target: outcome, seconds by kind, peak memory."""
    import pyarrow
    import pyarrow.parquet

    rows = [
        {
            "scene": document["scene"],
            "step": step["step"],
            "target": step["target"] or "",
            "backend": step["backend"] or "",
            "outcome": step["outcome"],
            "status": step["status"],
            **{f"{kind}_s": float(value or 0) for kind, value in step["seconds"].items()},
            "peak_mb": float(step["peak_mb"] or 0),
            "key": step["key"],
        }
        for step in document["steps"]
    ]
    stream = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.Table.from_pylist(rows), stream, write_page_checksum=True)
    return stream.getvalue()


def _targets(values: SceneValues) -> Json:
    return {
        "targets": [
            {"name": t.name, "image": t.photo, "box": list(t.box)}
            for t in values.result.refs.targets
        ]
    }


def _camera_files(values: SceneValues) -> dict[str, bytes]:
    assert values.reconstruction is not None
    views = values.reconstruction.views
    names = [view.photo for view in views]
    sizes = [view.size for view in views]
    intrinsics = np.stack([view.K for view in views])
    poses = np.stack([view.camera_from_world for view in views])
    files = {"cameras/transforms.json": dump_json(transforms_json(names, sizes, intrinsics, poses))}
    points = values.reconstruction.sparse_world
    model = colmap_model(names, sizes, intrinsics, poses, points)
    return files | {f"cameras/colmap/sparse/0/{name}": data for name, data in model.items()}


def _view_files(values: SceneValues) -> dict[str, bytes]:
    assert values.reconstruction is not None
    files = {}
    for i, view in enumerate(values.reconstruction.views):
        stem = view.photo.rsplit(".", 1)[0]
        files[f"depth/{stem}.png"] = depth_png(view.depth)
        for factored in values.objects:
            if factored.masks.masks[i].any():
                name = f"masks/{factored.target.name}/{stem}.png"
                files[name] = mask_png(factored.masks.masks[i])
    return files


def _glb(scene: SimScene, background: Background | None) -> bytes:
    nodes = [
        GlbNode(
            body.name, body.vertices, body.faces, body.vertex_rgb, GLTF_FROM_GV @ body.gv_from_body
        )
        for body in scene.bodies
    ]
    if background is not None and len(background.points_gv):
        points = background.points_gv
        keep = np.linspace(0, len(points) - 1, min(GLB_POINTS, len(points))).astype(int)
        nodes.append(GlbNode("background", points.xyz[keep], None, points.rgb[keep], GLTF_FROM_GV))
    return scene_glb(nodes)
