"""FoundationPose's module ``estimater``, its networks replaced by a scene's truth.

What the published code takes is checked: metres at arm's length, whole-numbered pixel centres,
mesh and depth in one unit, rigid poses of the mesh centred in its bounding box, one process-wide
default tensor type. The refiner turns by at most 20 degrees and moves by at most half a diameter
an iteration, towards the truth but for ``drift_deg`` of lean, as a free refiner may; the scorer
ranks by the distance to the truth.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import torch
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from tests.doubles.truth_scene import TruthScene

Fault = Literal["", "camera_axes", "transposed_rotation", "other_unit", "not_centred"]

MOST_TURN_DEG = 20.0


class FoundationPoseCode:
    """Stands for the module: its attributes are the names that the module holds."""

    def __init__(
        self,
        truth: TruthScene,
        *,
        fault: Fault = "",
        drift_deg: float = 1.0,
        knows_mesh: bool = True,
    ) -> None:
        """``knows_mesh``: refuse a mesh that is none of the scene's objects; else it is taken
        for the one that it is most like, as a network would.
        """
        self.truth, self.fault, self.drift_deg = truth, fault, drift_deg
        self.knows_mesh = knows_mesh
        self.mycpp = object()
        self.refinements: list[int] = []
        """How many hypotheses each refinement was given."""

    def ScorePredictor(self):  # noqa: N802
        return Scorer(self)

    def PoseRefinePredictor(self):  # noqa: N802
        return Refiner(self)

    def FoundationPose(self, **given):  # noqa: N802
        return Estimator(self, **given)

    def erode_depth(self, depth, radius=2, depth_diff_thres=0.001, device="cuda"):
        assert isinstance(depth, np.ndarray) and depth.dtype == np.float32
        return depth.copy()

    def bilateral_filter_depth(self, depth, radius=2, device="cuda"):
        assert isinstance(depth, np.ndarray) and depth.dtype == np.float32
        return depth.copy()

    def depth2xyzmap(self, depth, K):
        y, x = np.mgrid[0 : depth.shape[0], 0 : depth.shape[1]]
        out = np.stack([(x - K[0, 2]) / K[0, 0], (y - K[1, 2]) / K[1, 1], np.ones_like(x)], -1)
        return (out * depth[..., None]).astype(np.float32)

    def true_pose(self, mesh, rgb, depth, K) -> np.ndarray:
        """Return where the centred mesh truly is, in the unit of the depth."""
        check_picture(rgb, depth, K)
        camera = self.truth.camera_of(rgb)
        size = (rgb.shape[1], rgb.shape[0])
        picture = self.truth.picture(camera, size)
        expected = self.truth.cameras[camera].scaled_K(size)
        expected[:2, 2] -= 0.5
        assert np.abs(K - expected).max() < 0.3, "pixel centres are whole numbers"
        known = (depth > 0) & (picture.depth > 0)
        unit = float(np.median(depth[known] / picture.depth[known]))
        body, turn = self._recognise(mesh, unit)
        pose = self.truth.camera_from_object(camera, body)
        vertices = self.truth.bodies[body].vertices
        middle = 0.5 * (vertices.min(0) + vertices.max(0))
        out = np.eye(4)
        out[:3, :3] = pose[:3, :3] @ turn
        out[:3, 3] = (pose[:3, :3] @ middle + pose[:3, 3]) * unit
        if self.fault == "camera_axes":
            out = np.diag([1.0, -1.0, -1.0, 1.0]) @ out
        if self.fault == "transposed_rotation":
            out[:3, :3] = out[:3, :3].T
        if self.fault == "other_unit":
            out[:3, 3] *= 3.0
        if self.fault == "not_centred":
            out[:3, 3] += out[:3, :3] @ np.array([0.0, np.ptp(mesh.vertices[:, 1]), 0.0])
        return out

    def _recognise(self, mesh, unit: float) -> tuple[int, np.ndarray]:
        """Return which body a centred mesh is, and the turn about y to the body's own frame."""
        given = np.asarray(mesh.vertices, float) / unit
        middle = 0.5 * (given.min(0) + given.max(0))
        assert np.abs(middle).max() < 1e-3 * np.ptp(given), "poses are of the centred mesh"
        best: tuple[float, int, np.ndarray] = (np.inf, -1, np.eye(3))
        for index, body in enumerate(self.truth.bodies):
            true = body.vertices - 0.5 * (body.vertices.min(0) + body.vertices.max(0))
            tree, size = cKDTree(true), float(np.linalg.norm(np.ptp(true, axis=0)))
            few = given[:: len(given) // 500 + 1]
            for yaw in (0.0, *np.arange(4.0, 360.0, 4.0)):
                turn = Rotation.from_euler("y", yaw, degrees=True).as_matrix()
                away = float(tree.query(few @ turn.T)[0].mean()) / size
                if away < best[0]:
                    best = (away, index, turn)
                if away < 0.01:
                    break
        assert best[0] < 0.06 or not self.knows_mesh, (
            "mesh and depth are not of one unit, or the mesh is none of the objects "
            f"({best[0]:.2f} of its size away)"
        )
        return best[1], best[2]


class Estimator:
    """The class ``FoundationPose``: hypotheses, refinement, ranking."""

    def __init__(
        self,
        code: FoundationPoseCode,
        model_pts,
        model_normals,
        symmetry_tfs=None,
        mesh=None,
        scorer=None,
        refiner=None,
        glctx=None,
        debug=0,
        debug_dir=None,
    ) -> None:
        assert debug_dir is not None, "its default is a home folder of the author's"
        assert Path(debug_dir).is_dir() and debug == 0
        assert scorer is not None and refiner is not None and glctx is not None
        self.code, self.scorer, self.refiner, self.glctx = code, scorer, refiner, glctx
        self.reset_object(model_pts, model_normals, symmetry_tfs, mesh)
        rotations = Rotation.random(252, random_state=0).as_matrix()
        grid = np.tile(np.eye(4), (252, 1, 1))
        grid[:, :3, :3] = rotations
        self.rot_grid = torch.tensor(grid, dtype=torch.float)
        self.pose_last = None

    def reset_object(self, model_pts, model_normals, symmetry_tfs=None, mesh=None) -> None:
        assert len(model_pts) == len(model_normals) == len(mesh.vertices)
        assert mesh.visual.kind == "vertex", "a texture must have material.image, a PBR one has not"
        self.model_center = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
        self.mesh = mesh.copy()
        self.mesh.vertices = self.mesh.vertices - self.model_center
        self.diameter = float(np.linalg.norm(np.ptp(self.mesh.vertices, axis=0)))
        assert 0.01 < self.diameter < 10.0, f"a mesh of {self.diameter:.3g} m"
        self.mesh_tensors = {"pos": torch.tensor(np.asarray(self.mesh.vertices))}
        self.mesh_path = None

    def get_tf_to_centered_mesh(self):
        out = torch.eye(4, dtype=torch.float)
        out[:3, 3] = -torch.as_tensor(self.model_center, dtype=torch.float)
        return out

    def generate_random_pose_hypo(self, K, rgb, depth, mask, scene_pts=None):
        assert mask.dtype == bool and mask.shape == depth.shape
        valid = mask & (depth >= 0.001)
        row, column = np.nonzero(mask)
        middle = [(column.min() + column.max()) / 2, (row.min() + row.max()) / 2, 1.0]
        poses = self.rot_grid.clone()
        centre = np.linalg.inv(K) @ middle * np.median(depth[valid])
        poses[:, :3, 3] = torch.tensor(centre, dtype=torch.float)
        return poses

    def register(self, K, rgb, depth, ob_mask, ob_id=None, glctx=None, iteration=5):
        if ((depth >= 0.001) & ob_mask).sum() < 4:
            return np.eye(4)
        poses = self.generate_random_pose_hypo(K, rgb, depth, ob_mask).numpy()
        given = {
            "mesh": self.mesh, "mesh_tensors": self.mesh_tensors, "rgb": rgb, "depth": depth,
            "K": K, "normal_map": None, "glctx": self.glctx, "mesh_diameter": self.diameter,
        }  # fmt: skip
        xyz_map = self.code.depth2xyzmap(depth, K)
        poses, _ = self.refiner.predict(
            ob_in_cams=poses, xyz_map=xyz_map, iteration=iteration, **given
        )
        scores, _ = self.scorer.predict(ob_in_cams=poses.numpy(), **given)
        order = scores.argsort(descending=True)
        self.poses, self.scores = poses[order], scores[order]
        self.pose_last = self.poses[0]
        return (self.poses[0] @ self.get_tf_to_centered_mesh()).numpy()


class Refiner:
    def __init__(self, code: FoundationPoseCode) -> None:
        self.code = code

    def predict(
        self, rgb, depth, K, ob_in_cams, xyz_map, normal_map=None, get_vis=False, mesh=None,
        mesh_tensors=None, glctx=None, mesh_diameter=None, iteration=5,
    ):  # fmt: skip
        torch.set_default_tensor_type(torch.DoubleTensor)  # as the published code does, to CUDA's
        check_poses(ob_in_cams)
        assert xyz_map.shape == (*depth.shape, 3) and mesh_tensors is not None
        self.code.refinements.append(len(ob_in_cams))
        true = self.code.true_pose(mesh, rgb, depth, K)
        poses = np.array(ob_in_cams, float)
        for _ in range(iteration):
            poses = np.stack([self._step(pose, true, mesh_diameter) for pose in poses])
        return torch.tensor(poses, dtype=torch.float), None

    def _step(self, pose: np.ndarray, true: np.ndarray, diameter: float) -> np.ndarray:
        out = pose.copy()
        turn = Rotation.from_matrix(true[:3, :3] @ pose[:3, :3].T).as_rotvec()
        angle = np.linalg.norm(turn)
        turn *= min(1.0, np.radians(MOST_TURN_DEG) / max(angle, 1e-12))
        drift = Rotation.from_euler("z", self.code.drift_deg, degrees=True).as_matrix()
        out[:3, :3] = drift @ Rotation.from_rotvec(turn).as_matrix() @ pose[:3, :3]
        move = true[:3, 3] - pose[:3, 3]
        move *= min(1.0, 0.5 * diameter / max(float(np.linalg.norm(move)), 1e-12))
        out[:3, 3] += move
        return out


class Scorer:
    def __init__(self, code: FoundationPoseCode) -> None:
        self.code = code

    def predict(
        self, rgb, depth, K, ob_in_cams, normal_map=None, get_vis=False, mesh=None,
        mesh_tensors=None, glctx=None, mesh_diameter=None,
    ):  # fmt: skip
        check_poses(ob_in_cams)
        true = self.code.true_pose(mesh, rgb, depth, K)
        turn = np.einsum("nij,kj->nik", ob_in_cams[:, :3, :3], true[:3, :3])
        angle = np.linalg.norm(Rotation.from_matrix(turn).as_rotvec(), axis=1)
        apart = np.linalg.norm(ob_in_cams[:, :3, 3] - true[:3, 3], axis=1) / mesh_diameter
        return torch.tensor(100.0 - angle - apart, dtype=torch.float), None


def check_picture(rgb, depth, K) -> None:
    assert rgb.dtype == np.uint8 and rgb.ndim == 3 and rgb.shape[2] == 3
    assert depth.dtype == np.float32 and depth.shape == rgb.shape[:2]
    assert K.shape == (3, 3) and K.dtype == np.float64
    median = float(np.median(depth[depth > 0.001]))
    assert 0.1 < median < 20.0, f"depth of {median:.3g} m: thresholds are in metres"


def check_poses(poses) -> None:
    assert isinstance(poses, np.ndarray) and poses.shape[1:] == (4, 4) and len(poses) > 0
    turn = poses[:, :3, :3].astype(float)
    assert np.abs(turn @ turn.transpose(0, 2, 1) - np.eye(3)).max() < 1e-3, "not rigid"
    assert (np.linalg.det(turn) > 0).all()
