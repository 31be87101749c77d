"""Ask FoundationPose for a known mesh's pose: hypotheses, refinement, ranking.

Its thresholds are absolute (depth edges of 1 mm, differences of 1 cm) and made for a sensor at
arm's length, whatever the scene's unit: depth and mesh are brought to a median depth of one
metre, and translations back. Its pixel centres are whole numbers. It has no upright mode: its
grid of rotations is replaced by headings, and after each refinement, which turns freely, the
nearest upright rotation is taken.
"""

from __future__ import annotations

import tempfile
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from garden_models.foundation.containment import first_on_path, tensors_only, usual_tensors
from garden_models.foundation.failure import ModelFailed
from garden_models.foundation.imports import check_files, import_code
from garden_models.foundation.model_card import ModelCard, Terms, WeightFile
from garden_models.placement.pose_model import EstimatePose, PoseAnswer, PoseRequest
from garden_models.placement.upright_hypotheses import distinct, made_upright, upright_rotations
from garden_models.scene import BadGeometry, BadInput

CARD = ModelCard(
    name="foundation_pose",
    title="FoundationPose",
    source="https://github.com/NVlabs/FoundationPose",
    stage="place",
    terms=Terms(
        code="NVIDIA Source Code License (non-commercial)",
        weights="NVIDIA Source Code License (non-commercial)",
        commercial=False,
    ),
    weights=(
        WeightFile("estimater.py", "the folder is a clone of the repository"),
        WeightFile("weights/2023-10-28-18-33-37/config.yml", "the refiner"),
        WeightFile("weights/2023-10-28-18-33-37/model_best.pth", "the refiner"),
        WeightFile("weights/2024-01-11-20-02-45/config.yml", "the scorer"),
        WeightFile("weights/2024-01-11-20-02-45/model_best.pth", "the scorer"),
    ),
    imports=("nvdiffrast", "pytorch3d", "kornia", "warp", "open3d", "mycpp", "trimesh"),
    devices=("cuda",),
    install="clone the repository and build it as its readme says, in an environment of its own",
    bfloat16=False,
    own_process=True,  # it sets the type of every new tensor
)

WORKING_DEPTH_M = 1.0
"""Median depth of the object to which everything is scaled."""

NEEDED = {
    "mycpp": "its extension mycpp built",
    "erode_depth": "the package warp",
    "bilateral_filter_depth": "the package warp",
}
"""Parts whose absence the published code passes over until they are called."""

FEWEST_PIXELS = 4
"""With fewer measured pixels the model gives up without saying so."""


def load(weights: Path, device: str) -> EstimatePose:
    """Return what asks the model; BadInput if its code, its weights or a GPU is missing."""
    if not device.startswith("cuda"):
        raise BadInput(f"{CARD.title} runs on a CUDA GPU only, not on {device}")
    check_files(CARD, weights)
    rasteriser = import_code(CARD, "nvdiffrast.torch")
    if torch.cuda.is_available():
        torch.cuda.set_device(device)
    with first_on_path(weights), tensors_only(), usual_tensors():
        code = import_code(CARD, "estimater")
        _give_extension(code)
        for part, package in NEEDED.items():
            if getattr(code, part, None) is None:
                raise BadInput(f"{CARD.title} works only with {package}: {CARD.install}")
        try:
            refiner, scorer = code.PoseRefinePredictor(), code.ScorePredictor()
        except (OSError, RuntimeError, KeyError, ValueError) as error:
            raise BadInput(f"{weights} does not hold {CARD.title}: {error}") from error
        return FoundationPose(code, refiner, scorer, rasteriser.RasterizeCudaContext())


class FoundationPose:
    """Answers pose requests with the published estimator."""

    def __init__(self, code: Any, refiner: Any, scorer: Any, rasteriser: Any) -> None:
        """``code`` is the published module ``estimater``."""
        self._code = code
        self._refiner, self._scorer, self._rasteriser = refiner, scorer, rasteriser
        self._trimesh = import_code(CARD, "trimesh")
        self._estimator: Any = None
        self._all_rotations: Any = None

    def __call__(self, request: PoseRequest) -> PoseAnswer:
        """Return the best poses, best first.

        Raises BadGeometry if too little of the object has depth.
        """
        masked = request.depth[request.mask & (request.depth > 0)]
        if len(masked) < FEWEST_PIXELS:
            raise BadGeometry(
                f"only {len(masked)} pixels of the object have depth, too few for {CARD.title}"
            )
        factor = WORKING_DEPTH_M / float(np.median(masked))
        picture = {
            "K": integer_centres(request.K),
            "rgb": np.ascontiguousarray(request.rgb),
            "depth": np.ascontiguousarray(request.depth * factor, np.float32),
            "mask": np.ascontiguousarray(request.mask),
        }
        with torch.inference_mode(), usual_tensors():
            estimator = self._of_mesh(request, factor)
            ask = partial(self._ask_upright, gv_from_camera=request.gv_from_camera)
            poses, scores = (ask if request.upright else self._ask_freely)(
                estimator, picture, request.iterations
            )
            centred = torch.as_tensor(estimator.get_tf_to_centered_mesh())
            found = _numpy(poses) @ _numpy(centred)
        order = np.argsort(-scores, kind="stable")
        found, scores = found[order], scores[order]
        found[:, :3, 3] /= factor
        size = float(np.linalg.norm(np.ptp(request.vertices, axis=0)))
        kept = distinct(found, size, request.keep)
        return PoseAnswer(found[kept], scores[kept])

    def _of_mesh(self, request: PoseRequest, factor: float) -> Any:
        """Return the estimator, set to the mesh at its working scale."""
        mesh = self._trimesh.Trimesh(
            np.asarray(request.vertices, np.float64) * factor,
            request.faces,
            vertex_colors=request.vertex_rgb,
            process=False,
        )
        given = {"model_pts": mesh.vertices, "model_normals": mesh.vertex_normals, "mesh": mesh}
        if self._estimator is None:
            self._estimator = self._code.FoundationPose(
                **given,
                scorer=self._scorer,
                refiner=self._refiner,
                glctx=self._rasteriser,
                debug=0,
                debug_dir=tempfile.mkdtemp(prefix="garden-foundation-pose-"),
            )
            self._all_rotations = self._estimator.rot_grid
        else:
            self._estimator.reset_object(**given)
        written = getattr(self._estimator, "mesh_path", None)
        if written:
            Path(written).unlink(missing_ok=True)
        return self._estimator

    def _ask_freely(
        self, estimator: Any, picture: dict[str, Any], iterations: int
    ) -> tuple[Any, Float[np.ndarray, " n"]]:
        """Run the model as published: all rotations, refined freely."""
        estimator.rot_grid = self._all_rotations
        estimator.poses = None
        estimator.register(
            K=picture["K"],
            rgb=picture["rgb"],
            depth=picture["depth"],
            ob_mask=picture["mask"],
            iteration=iterations,
        )
        if estimator.poses is None:
            raise BadGeometry(
                f"{CARD.title} finds too little depth on the object that does not lie at an edge"
            )
        return estimator.poses, _numpy(estimator.scores)

    def _ask_upright(
        self,
        estimator: Any,
        picture: dict[str, Any],
        iterations: int,
        *,
        gv_from_camera: Float[np.ndarray, "3 3"],
    ) -> tuple[Any, Float[np.ndarray, " n"]]:
        """Run the model's own steps, its rotations made upright after every one."""
        depth = self._code.erode_depth(picture["depth"], radius=2, device="cuda")
        depth = self._code.bilateral_filter_depth(depth, radius=2, device="cuda")
        if np.count_nonzero((depth >= 1e-3) & picture["mask"]) < FEWEST_PIXELS:
            raise BadGeometry(
                f"{CARD.title} finds too little depth on the object that does not lie at an edge"
            )
        grid = np.tile(np.eye(4), (len(upright_rotations(gv_from_camera)), 1, 1))
        grid[:, :3, :3] = upright_rotations(gv_from_camera)
        like = self._all_rotations
        estimator.rot_grid = torch.as_tensor(grid, dtype=like.dtype, device=like.device)
        given = {
            "mesh": estimator.mesh,
            "mesh_tensors": estimator.mesh_tensors,
            "rgb": picture["rgb"],
            "depth": depth,
            "K": picture["K"],
            "normal_map": None,
            "glctx": self._rasteriser,
            "mesh_diameter": estimator.diameter,
            "get_vis": False,
        }
        poses = _numpy(
            estimator.generate_random_pose_hypo(
                K=picture["K"], rgb=picture["rgb"], depth=depth, mask=picture["mask"]
            )
        )
        xyz_map = self._code.depth2xyzmap(depth, picture["K"])
        for _ in range(iterations):
            refined, _ = self._refiner.predict(
                ob_in_cams=poses.astype(np.float32), xyz_map=xyz_map, iteration=1, **given
            )
            poses = made_upright(_numpy(refined), gv_from_camera)
        scores, _ = self._scorer.predict(ob_in_cams=poses.astype(np.float32), **given)
        return poses, _numpy(scores)


def integer_centres(K: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
    """Return a camera matrix for pixel centres at whole numbers; ours are at +0.5."""
    out = np.array(K, np.float64)
    out[:2, 2] -= 0.5
    return out


def _numpy(value: Any) -> Float[np.ndarray, "*n"]:
    out = np.asarray(torch.as_tensor(value).detach().float().cpu(), np.float64)
    if not np.isfinite(out).all():
        raise ModelFailed(f"{CARD.title} gave numbers that are not finite")
    return out


def _give_extension(code: Any) -> None:
    """Let the extension be one that is installed: the model looks in its own build folder."""
    if getattr(code, "mycpp", None) is None:
        with suppress(ImportError):
            built = import_module("mycpp")
            code.mycpp = built if hasattr(built, "cluster_poses") else None
