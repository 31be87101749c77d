"""Place an object's mesh in Gravity-View: upright hypotheses, refinement, and the gate."""

from __future__ import annotations

import numpy as np

from garden_models.geometry.upright import tilt_deg
from garden_models.placement.compare import Comparison
from garden_models.placement.config import PlaceObject
from garden_models.placement.model_poses import ModelPoses, ask_model, judge_model
from garden_models.placement.observation import observe
from garden_models.placement.pose import UPRIGHT_DEG, UprightPose
from garden_models.placement.pose_model import EstimatePose
from garden_models.placement.refine import refine
from garden_models.placement.register import register_to_points
from garden_models.placement.starts import pose_from_points
from garden_models.progress import Progress, silent
from garden_models.scene import (
    BadGeometry,
    GravityView,
    ObjectMasks,
    ObjectMesh,
    Placement,
    PlacementHypothesis,
    Reconstruction,
    Verdict,
)

AS_MESHED = "as meshed"

SAME_YAW_DEG = 12.0
"""Headings closer than this lead to the same refined pose."""

LEAN_DEG = 0.1
"""A lean above this is said."""

AMBIGUOUS = 0.03
"""Difference in total score under which two far headings cannot be told apart."""


def place(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    masks: ObjectMasks,
    mesh: ObjectMesh,
    config: PlaceObject | None = None,
    progress: Progress = silent,
    estimate: EstimatePose | None = None,
) -> Placement:
    """Return scored poses of the mesh (translation, yaw, scale) and the best one.

    The rotation is restricted to yaw about gravity (paper, section 3.2). The mesh may come
    from anywhere: its heading, position and size are also searched from the object's points.
    With the method ``foundation_pose``, ``estimate`` asks that model; its poses, some of them
    free, and the pose of the mesh's making are judged in the same gate. Raises BadGeometry if
    no view sees the object.
    """
    config = config or PlaceObject()
    progress(0.0, "picking views to compare")
    seen = observe(reconstruction, gravity_view, masks, config.max_views, config.pixels_per_view)
    if seen is None or len(masks.points_gv) == 0:
        raise BadGeometry(
            f"object {mesh.name!r} is not seen in any registered photo, so it cannot be placed"
        )
    support = None if masks.support is None else float(masks.support.height_gv)
    comparison = Comparison(mesh, seen, support)
    answered = ModelPoses()
    if config.method == "foundation_pose":
        if estimate is None:
            raise ValueError("the method foundation_pose needs what asks the model")
        progress(0.05, "asking FoundationPose")
        answered = ask_model(reconstruction, gravity_view, masks, mesh, estimate, config)
    hypotheses = {AS_MESHED: UprightPose.of(mesh.gv_from_object)}
    if config.gate:
        hypotheses |= _own_hypotheses(comparison, masks, mesh, config, progress)
    hypotheses |= answered.poses
    if config.gate:
        hypotheses |= _refined_model_poses(comparison, answered, config)
        hypotheses |= _set_on_support(comparison, hypotheses)
    progress(0.9, f"judging {len(hypotheses)} poses")
    scored = tuple(
        PlacementHypothesis(
            name,
            pose.rotation_gv,
            pose.translation_gv,
            pose.scale,
            comparison.scores(pose, config),
        )
        for name, pose in hypotheses.items()
    )
    chosen, why = _gate(scored, config) if config.gate else _ungated(scored, answered)
    progress(1.0, why)
    verdict = _verdict(scored, chosen, comparison.size, masks, config)
    verdict = verdict.worst(judge_model(answered, scored, chosen, masks.target.name))
    return Placement(mesh.name, scored, chosen, why, verdict)


def _own_hypotheses(
    comparison: Comparison,
    masks: ObjectMasks,
    mesh: ObjectMesh,
    config: PlaceObject,
    progress: Progress,
) -> dict[str, UprightPose]:
    """Return named upright poses, found from where the object was meshed and from its points."""
    meshed = UprightPose.of(mesh.gv_from_object)
    start = meshed.made_upright(comparison.vertices)
    poses = {} if start is meshed else {f"{AS_MESHED}, made upright": start}
    points = np.asarray(masks.points_gv.xyz, float)
    progress(0.1, "refining the pose of the mesh's making")
    steps = config.refine_steps
    poses["refined translation and yaw"] = refine(comparison, start, steps, with_scale=False)
    poses["refined translation, yaw and scale"] = refine(comparison, start, steps)
    poses["registered to the points"] = register_to_points(
        comparison.vertices, comparison.faces, points, start
    )
    progress(0.4, f"trying {config.yaw_starts} headings")
    for heading, pose in _headings(comparison, start, points, config):
        poses[f"heading {heading:+.0f} deg, refined"] = refine(comparison, pose, 2 * steps)
    return poses


def _refined_model_poses(
    comparison: Comparison, answered: ModelPoses, config: PlaceObject
) -> dict[str, UprightPose]:
    """Return the model's best upright pose refined by our own comparison."""
    upright = [(name, p) for name, p in answered.poses.items() if p.tilt_deg < UPRIGHT_DEG]
    return {
        f"{name}, refined": refine(comparison, pose, config.refine_steps)
        for name, pose in upright[:1]
    }


def _set_on_support(
    comparison: Comparison, poses: dict[str, UprightPose]
) -> dict[str, UprightPose]:
    """Return those poses that do not touch the support, lowered or raised to it."""
    if comparison.support_height is None:
        return {}
    out = {}
    for name, pose in poses.items():
        snapped = pose.lowered_to(comparison.support_height, comparison.vertices)
        if abs(snapped.translation_gv[1] - pose.translation_gv[1]) > 1e-6 * comparison.size:
            out[f"{name}, set on its support"] = snapped
    return out


def _ungated(scored: tuple[PlacementHypothesis, ...], answered: ModelPoses) -> tuple[int, str]:
    """Take the model's own best pose as it is; without one the pose of the mesh's making."""
    if not answered.poses:
        return 0, f"kept {AS_MESHED!r}: FoundationPose gave no pose, and nothing else was tried"
    first = next(iter(answered.poses))
    return [one.name for one in scored].index(first), f"took {first!r} as it is, without the gate"


def _headings(
    comparison: Comparison,
    start: UprightPose,
    points_gv: np.ndarray,
    config: PlaceObject,
) -> list[tuple[float, UprightPose]]:
    """Return the best headings (degrees from ``start``) far from it and from each other."""
    tried = []
    for yaw in 2.0 * np.pi * np.arange(config.yaw_starts) / config.yaw_starts:
        pose = pose_from_points(
            comparison.vertices, start.base, points_gv, comparison.support_height, float(yaw)
        )
        total = comparison.scores(pose, config)["total"]
        tried.append((total, float((np.degrees(yaw) + 180.0) % 360.0 - 180.0), pose))
    tried.sort(key=lambda item: -item[0])
    picked: list[tuple[float, UprightPose]] = []
    for _, heading, pose in tried:
        near = [abs((heading - other + 180.0) % 360.0 - 180.0) for other, _ in picked]
        if len(picked) < config.refined_starts and min(near, default=360.0) > SAME_YAW_DEG:
            picked.append((heading, pose))
    return picked


def _gate(scored: tuple[PlacementHypothesis, ...], config: PlaceObject) -> tuple[int, str]:
    """Pick the pose with the best total; keep the mesh's own pose unless it is clearly beaten.

    If the mesh's own pose leans, that which it has when made upright is kept in its place.
    """
    totals = np.array([hypothesis.scores["total"] for hypothesis in scored])
    best = int(totals.argmax())
    leans = [tilt_deg(hypothesis.rotation_gv) >= UPRIGHT_DEG for hypothesis in scored]
    own = leans.index(False) if False in leans else 0
    gain = totals[best] - totals[own]
    first, name = scored[own].scores, scored[own].name
    if best == own or gain < config.least_gain:
        others = np.where(np.arange(len(totals)) == own, -np.inf, totals)
        runner = scored[int(others.argmax())]
        return own, (
            f"kept {name!r} (total {totals[own]:.3f}, mask IoU {first['mask_iou']:.2f}): the "
            f"best of {len(scored) - 1} other poses, {runner.name!r}, reaches "
            f"{others.max():.3f}, no gain above {config.least_gain:g}"
        )
    won = scored[best].scores
    return best, (
        f"chose {scored[best].name!r}: total {totals[best]:.3f} against {totals[own]:.3f} "
        f"{name!r} (mask IoU {won['mask_iou']:.2f} against {first['mask_iou']:.2f}, depth "
        f"residual {1e3 * won['depth_residual_m']:.1f} mm against "
        f"{1e3 * first['depth_residual_m']:.1f} mm, support gap "
        f"{1e3 * won['support_gap_m']:.1f} mm against {1e3 * first['support_gap_m']:.1f} mm)"
    )


def _verdict(
    scored: tuple[PlacementHypothesis, ...],
    chosen: int,
    size: float,
    masks: ObjectMasks,
    config: PlaceObject,
) -> Verdict:
    """Judge the chosen pose; say so if another heading fits as well."""
    best = scored[chosen]
    name = masks.target.name
    problems, remarks = [], []
    if best.scores["mask_iou"] < config.least_iou:
        problems.append(
            f"{name!r} covers its masks badly where it was placed "
            f"(IoU {best.scores['mask_iou']:.2f})"
        )
    residual = best.scores["depth_residual_m"] / (size * best.scale)
    if residual > config.most_depth_residual:
        problems.append(
            f"{name!r} is {residual:.0%} of its size away from the measured depth on average"
        )
    lean = tilt_deg(best.rotation_gv)
    if lean > config.most_tilt_deg:
        problems.append(f"{name!r} leans by {lean:.0f} degrees where it was placed")
    elif lean > LEAN_DEG:
        remarks.append(f"{name!r} leans by {lean:.1f} degrees where it was placed")
    if masks.support is None:
        problems.append(f"nothing carries {name!r}, so its height rests on depth alone")
    for other in scored:
        relative = best.rotation_gv.T @ other.rotation_gv
        turn = np.degrees(np.arccos(np.clip((np.trace(relative) - 1.0) / 2.0, -1.0, 1.0)))
        close = best.scores["total"] - other.scores["total"] < AMBIGUOUS
        if turn > 2 * SAME_YAW_DEG and close:
            remarks.append(
                f"{name!r} looks much the same turned by {turn:.0f} degrees; its heading is "
                "uncertain"
            )
            break
    return Verdict("degraded" if problems else "ok", tuple(problems + remarks))
