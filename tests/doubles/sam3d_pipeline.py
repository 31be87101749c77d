"""SAM-3D Objects' pipeline, answering a scene's truth as the published code would.

Its inputs are checked against what ``InferencePipelinePointMap.run`` takes: RGBA whose alpha is
the mask, a point map as a torch tensor (H, W, 3) in PyTorch3D's camera axes with NaN for what is
not known. Its answers are built from the published conventions alone, by other means than the
adapter's: canonical frame z up in a unit cube, exporter to y up, row-vector pose with a
quaternion wxyz, in the point map's unit.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import torch
import trimesh
from PIL import Image
from scipy.spatial.transform import Rotation

from tests.doubles.truth_scene import TruthScene

Fault = Literal[
    "", "quaternion_order", "up_axis", "transposed_rotation", "camera_axes", "other_unit"
]

SIDE_TEXELS = 512


class Sam3dPipeline:
    """``fault`` breaks one convention on purpose; ``lean_deg`` makes the pose that inexact."""

    def __init__(
        self,
        truth: TruthScene,
        *,
        fault: Fault = "",
        lean_deg: float = 0.0,
        textured: bool = False,
        torn: bool = False,
    ) -> None:
        self.truth = truth
        self.fault, self.lean_deg = fault, lean_deg
        self.textured, self.torn = textured, torn
        self.asked = 0

    def run(
        self,
        image,
        mask=None,
        seed=None,
        stage1_only=False,
        with_mesh_postprocess=True,
        with_texture_baking=True,
        with_layout_postprocess=True,
        use_vertex_color=False,
        stage1_inference_steps=None,
        stage2_inference_steps=None,
        use_stage1_distillation=False,
        use_stage2_distillation=False,
        pointmap=None,
        decode_formats=None,
        estimate_plane=False,
    ):
        self.asked += 1
        assert mask is None and isinstance(seed, int)
        assert not (stage1_only or with_mesh_postprocess or with_texture_baking), "needs nvdiffrast"
        assert not with_layout_postprocess, "infers a negative focal length from a point map"
        assert use_vertex_color, "without it the mesh has neither colours nor texture"
        assert isinstance(image, np.ndarray) and image.dtype == np.uint8
        assert image.ndim == 3 and image.shape[-1] == 4
        assert set(np.unique(image[..., 3])) == {0, 255}
        alpha = image[..., 3] == 255
        camera = self.truth.camera_of(image[..., :3])
        unit = self._check_points(pointmap, alpha, camera)
        body = self.truth.body_of(camera, alpha)
        return self._answer(camera, body, unit)

    def _check_points(self, pointmap, mask, camera) -> float:
        """Check axes, unit and type of the point map; return its units per metre."""
        assert isinstance(pointmap, torch.Tensor) and pointmap.dtype == torch.float32
        assert tuple(pointmap.shape) == (*mask.shape, 3)
        points = pointmap.numpy()
        known = np.isfinite(points).all(-1)
        assert (np.isnan(points).all(-1) == ~known).all(), "NaN, whole points, where unknown"
        assert (known & mask).sum() >= 100
        size = (mask.shape[1], mask.shape[0])
        depth = self.truth.picture(camera, size).depth
        known &= depth > 0
        unit = float(np.median(points[known][:, 2] / depth[known]))
        assert unit > 0, "z looks forward"
        K = self.truth.cameras[camera].scaled_K(size)
        row, column = np.nonzero(known)
        z = depth[known]
        left = -(column + 0.5 - K[0, 2]) / K[0, 0] * z
        up = -(row + 0.5 - K[1, 2]) / K[1, 1] * z
        true = unit * np.stack([left, up, z], -1)
        away = np.linalg.norm(points[known] - true, axis=1) / (unit * z)
        assert np.median(away) < 0.03, f"points are not x left, y up, z forward ({away.mean():.2f})"
        return unit

    def _answer(self, camera: int, body: int, unit: float):
        item = self.truth.bodies[body]
        low, high = item.vertices.min(0), item.vertices.max(0)
        middle, length = 0.5 * (low + high), float((high - low).max())
        x, y, z = ((item.vertices - middle) / length).T
        canonical = np.stack([x, z, -y], 1)  # z up
        pose = self.truth.camera_from_object(camera, body)
        # Where the canonical axes point in the OpenCV camera: x, forward z, up -y of the object.
        axes = pose[:3, :3] @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float)
        if self.lean_deg:
            tilt = Rotation.from_euler("x", self.lean_deg, degrees=True)
            axes = axes @ tilt.as_matrix()
        centre = pose[:3, :3] @ middle + pose[:3, 3]
        flip = np.diag([1.0, 1.0, 1.0] if self.fault == "camera_axes" else [-1.0, -1.0, 1.0])
        column_rotation = flip @ axes
        # Row vectors: p_camera = s * p_canonical @ R + t, so R is the transpose.
        rotation = column_rotation.T if self.fault != "transposed_rotation" else column_rotation
        xyzw = Rotation.from_matrix(rotation).as_quat()
        quaternion = xyzw if self.fault == "quaternion_order" else xyzw[[3, 0, 1, 2]]
        if self.fault == "other_unit":
            unit = 3.0 * unit
        return {
            "glb": self._export(canonical, item.faces, item.rgb),
            "rotation": torch.tensor(quaternion, dtype=torch.float32)[None],
            "translation": torch.tensor(flip @ centre * unit, dtype=torch.float32)[None],
            "scale": torch.full((1, 3), length * unit, dtype=torch.float32),
        }

    def _export(self, canonical, faces, rgb) -> trimesh.Trimesh:
        vertices = canonical
        if self.fault != "up_axis":
            vertices = canonical @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
        if self.torn:
            faces = faces[np.abs(canonical[faces].mean(1)[:, 2]) < 0.45 * np.ptp(canonical[:, 2])]
        if self.textured:
            return self._textured(vertices, faces, rgb)
        mesh = trimesh.Trimesh(vertices=vertices, faces=faces, process=False)
        mesh.visual.vertex_colors = rgb / 255.0
        return mesh

    def _textured(self, vertices, faces, rgb) -> trimesh.Trimesh:
        """Give every face its own corner of the picture: seams everywhere."""
        per_side = int(np.ceil(np.sqrt(len(faces))))
        cell = 4
        picture = np.zeros((cell * per_side, cell * per_side, 3), np.uint8)
        row, column = np.divmod(np.arange(len(faces)), per_side)
        shade = rgb[faces].mean(1).astype(np.uint8)
        for dy in range(cell):
            for dx in range(cell):
                picture[cell * row + dy, cell * column + dx] = shade
        middle = np.stack(
            [(column + 0.5) / per_side, 1.0 - (row + 0.5) / per_side], 1
        )  # origin at the lower left
        offset = np.array([[-0.2, -0.2], [0.2, -0.2], [-0.2, 0.2]]) / per_side
        uv = (middle[:, None] + offset).reshape(-1, 2)
        material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(picture))
        return trimesh.Trimesh(
            vertices[faces].reshape(-1, 3),
            np.arange(3 * len(faces)).reshape(-1, 3),
            visual=trimesh.visual.TextureVisuals(uv=uv, material=material),
            process=False,
        )
