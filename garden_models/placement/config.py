"""Hold the settings of object placement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class PlaceObject:
    """How an object's pose is searched and judged.

    Lengths are shares of the object's size (the diagonal of its bounding box).
    """

    method: Literal["render_and_compare", "foundation_pose"] = "render_and_compare"
    """What proposes poses: our own search, or FoundationPose beside it in the same gate."""

    max_views: int = 8
    """Most views that are compared; spread around the object."""

    pixels_per_view: int = 3600
    """About how many pixels of each view are compared, spread over the object's box."""

    refine_steps: int = 14
    """Gauss-Newton steps of a refinement."""

    yaw_starts: int = 24
    """Headings tried around the vertical axis for meshes whose heading is not known."""

    refined_starts: int = 3
    """Most of those headings that are refined."""

    depth_weight: float = 2.0
    """Cost in mask IoU of a depth residual as large as the object."""

    colour_weight: float = 0.4
    """Cost in mask IoU of the largest possible colour difference."""

    support_weight: float = 1.0
    """Cost in mask IoU of a gap to the support as large as the object."""

    rotations: Literal["both", "upright", "free"] = "both"
    """Rotations that FoundationPose may take: turns about gravity, all, or both in turn.
    ``free`` leaves gravity out of its hypotheses, as the paper's ablations do."""

    gate: bool = True
    """Whether the best of all hypotheses is taken; else FoundationPose's own best, as it is
    (with ``rotations`` "free": the paper's "full FP pose")."""

    iterations: int = 5
    """FoundationPose's refinements of every hypothesis."""

    model_poses: int = 3
    """Most of FoundationPose's poses, upright and free each, that enter the gate."""

    tilt_weight: float = 2.0
    """Cost in mask IoU of a lean by 90 degrees."""

    most_tilt_deg: float = 5.0
    """Lean of the chosen pose above which the placement is degraded."""

    least_gain: float = 0.004
    """Gain in the total score under which the pose of the mesh's making is kept."""

    least_iou: float = 0.6
    """Mean mask IoU of the chosen pose below which the placement is degraded."""

    most_depth_residual: float = 0.06
    """Depth residual (share of the size) above which the placement is degraded."""

    def __post_init__(self) -> None:
        if self.max_views < 1 or self.pixels_per_view < 100:
            raise ValueError(
                "max_views must be at least 1 and pixels_per_view at least 100, got "
                f"{self.max_views} and {self.pixels_per_view}"
            )
        if self.iterations < 1 or self.model_poses < 1:
            raise ValueError(
                "iterations and model_poses must be positive, got "
                f"{self.iterations} and {self.model_poses}"
            )
        if self.yaw_starts < 1 or self.refined_starts < 0 or self.refine_steps < 1:
            raise ValueError(
                "yaw_starts and refine_steps must be positive and refined_starts not negative, "
                f"got {self.yaw_starts}, {self.refine_steps} and {self.refined_starts}"
            )
