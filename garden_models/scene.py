"""Define the nouns that every room shares: frozen dataclasses of arrays.

Conventions (they hold for every field below)
---------------------------------------------
- Transforms are named ``<to>_from_<from>``; points are column vectors.
- Cameras are OpenCV (x right, y down, z forward); ``K`` is in pixels with pixel
  centres at +0.5; ``depth`` is z-depth, 0 where there is none.
- ``world`` is the frame of the given or estimated cameras. ``gv`` is the Gravity-View
  frame (paper, section 3.1): y points down along gravity. Both are in metres under the
  stated ``Scale``.
- The ``object`` frame is upright: its axes are parallel to a GV frame up to yaw, y points
  down, its origin is the centre of the object's footprint on its support, so that
  vertices have y <= 0.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

Status = Literal["ok", "degraded", "failed"]
ScaleSource = Literal["metric_depth", "known_cameras", "known_length", "prior", "unknown"]
STATUS_ORDER: tuple[Status, ...] = ("ok", "degraded", "failed")


class BadInput(ValueError):
    """Input that no retry can mend; the message names the file and the remedy."""


class BadGeometry(ValueError):
    """Photos whose geometry does not allow the step; the message says what to do."""


@dataclass(frozen=True)
class Verdict:
    """What a step says of its own result.

    ``reasons`` are sentences for the user; an ``ok`` verdict may carry remarks too.
    """

    status: Status = "ok"
    reasons: tuple[str, ...] = ()

    def worst(self, other: Verdict) -> Verdict:
        """Return the verdict with the worse status and the reasons of both."""
        status = max(self.status, other.status, key=STATUS_ORDER.index)
        return Verdict(status, tuple(dict.fromkeys(self.reasons + other.reasons)))


OK = Verdict()


@dataclass(frozen=True)
class KnownCamera:
    """A camera given by the user for one photo; ``K`` is for the photo's ingested size.

    ``distortion`` (OpenCV k1, k2, p1, p2) is still in the photo.
    """

    photo: str
    K: Float[np.ndarray, "3 3"]
    camera_from_world: Float[np.ndarray, "3 4"]
    distortion: Float[np.ndarray, "4"] = field(default_factory=lambda: np.zeros(4))


@dataclass(frozen=True)
class Photo:
    """One ingested photo: upright by its EXIF tag.

    ``focal_px`` is the focal length in pixels of ``rgb`` if EXIF gives it.
    ``original_size`` is (width, height) of the file after EXIF orientation; boxes of
    targets are in pixels of that size.
    """

    name: str
    rgb: UInt8[np.ndarray, "h w 3"]
    original_size: tuple[int, int]
    focal_px: float | None = None


@dataclass(frozen=True)
class Capture:
    """Ordered photos and, if given, their cameras."""

    SCHEMA: ClassVar[str] = "garden.Capture/1"
    photos: tuple[Photo, ...]
    cameras: tuple[KnownCamera, ...] = ()
    verdict: Verdict = OK


@dataclass(frozen=True)
class Scale:
    """How the unit of length is known.

    ``metres_per_unit`` is the factor that was applied to the estimated world to get the
    metres of all artifacts; with source ``unknown`` or ``prior`` it is an assumption.
    """

    source: ScaleSource
    metres_per_unit: float = 1.0
    note: str = ""


@dataclass(frozen=True)
class PointCloud:
    """Coloured points with unit normals; ``spacing`` is each point's local distance to
    its neighbours in metres (the splat size), ``confidence`` is in 0..1.
    """

    xyz: Float[np.ndarray, "n 3"]
    rgb: UInt8[np.ndarray, "n 3"]
    normal: Float[np.ndarray, "n 3"]
    spacing: Float[np.ndarray, " n"]
    confidence: Float[np.ndarray, " n"]

    def __len__(self) -> int:
        return len(self.xyz)

    def subset(self, keep: Bool[np.ndarray, " n"] | Int[np.ndarray, " m"]) -> PointCloud:
        """Return the points that ``keep`` (mask or indices) selects."""
        return PointCloud(
            self.xyz[keep],
            self.rgb[keep],
            self.normal[keep],
            self.spacing[keep],
            self.confidence[keep],
        )


@dataclass(frozen=True)
class Camera:
    """One registered photo's camera. ``K`` is for ``size`` = (width, height)."""

    photo: str
    size: tuple[int, int]
    K: Float[np.ndarray, "3 3"]
    camera_from_world: Float[np.ndarray, "3 4"]
    distortion: Float[np.ndarray, " d"] = field(default_factory=lambda: np.zeros(4))


@dataclass(frozen=True)
class RegistrationAttempt:
    """One rung of the settings ladder and what came of it; how long it took does not count
    when results are compared (``unkeyed``).
    """

    name: str
    registered: int
    points: int
    mean_reprojection_px: float
    seconds: float = field(metadata={"unkeyed": True})
    chosen: bool
    note: str = ""


@dataclass(frozen=True)
class SparseModel:
    """Cameras and sparse points in world metres (``Scale``).

    ``track_views`` lists, for each sparse point, indices into ``cameras`` of the photos
    that see it, flattened; point i owns ``track_views[track_start[i]:track_start[i+1]]``.
    """

    SCHEMA: ClassVar[str] = "garden.SparseModel/1"
    cameras: tuple[Camera, ...]
    unregistered: tuple[str, ...]
    points_world: Float[np.ndarray, "n 3"]
    points_rgb: UInt8[np.ndarray, "n 3"]
    track_start: Int[np.ndarray, " n_plus_1"]
    track_views: Int[np.ndarray, " m"]
    scale: Scale
    attempts: tuple[RegistrationAttempt, ...] = ()
    cameras_source: Literal["estimated", "known"] = "estimated"
    verdict: Verdict = OK


@dataclass(frozen=True)
class View:
    """One registered photo at the working size of the dense reconstruction (undistorted).

    ``depth`` is in metres (0 = invalid), ``confidence`` in 0..1. ``rgb`` has had the
    lens ``distortion`` (OpenCV k1, k2, p1, p2, for ``K``) removed; ``original_size`` is
    (width, height) of the photo file, which boxes of targets refer to.
    """

    photo: str
    rgb: UInt8[np.ndarray, "h w 3"]
    depth: Float[np.ndarray, "h w"]
    confidence: Float[np.ndarray, "h w"]
    K: Float[np.ndarray, "3 3"]
    camera_from_world: Float[np.ndarray, "3 4"]
    original_size: tuple[int, int]
    distortion: Float[np.ndarray, "4"] = field(default_factory=lambda: np.zeros(4))

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels of ``rgb`` and ``depth``."""
        return self.rgb.shape[1], self.rgb.shape[0]


@dataclass(frozen=True)
class Reconstruction:
    """Views with depth, and the fused coloured points, in world metres."""

    SCHEMA: ClassVar[str] = "garden.Reconstruction/1"
    views: tuple[View, ...]
    points_world: PointCloud
    sparse_world: Float[np.ndarray, "n 3"]
    unregistered: tuple[str, ...]
    scale: Scale
    cameras_source: Literal["estimated", "known"] = "estimated"
    verdict: Verdict = OK


@dataclass(frozen=True)
class GravityEvidence:
    """One cue's estimate of gravity. ``sigma_deg`` is its own 1-sigma uncertainty."""

    method: str
    down_world: Float[np.ndarray, "3"]
    sigma_deg: float
    accepted: bool
    note: str = ""


@dataclass(frozen=True)
class GravityView:
    """The Gravity-View frame (paper, section 3.1), metres, origin at the reference camera.

    ``gv_from_world`` is rigid (4x4).
    """

    SCHEMA: ClassVar[str] = "garden.GravityView/1"
    gv_from_world: Float[np.ndarray, "4 4"]
    reference_photo: str
    down_world: Float[np.ndarray, "3"]
    sigma_deg: float
    evidence: tuple[GravityEvidence, ...]
    verdict: Verdict = OK


@dataclass(frozen=True)
class Target:
    """An object to factor out: a box ``(x0, y0, x1, y1)`` in pixels of the photo file."""

    name: str
    photo: str
    box: tuple[float, float, float, float]


@dataclass(frozen=True)
class Rivals:
    """The targets whose boxes hold some of the points that lie in one target's box."""

    SCHEMA: ClassVar[str] = "garden.Rivals/1"
    targets: tuple[Target, ...] = ()


@dataclass(frozen=True)
class SupportSurface:
    """A horizontal surface that can carry things, in GV.

    ``height_gv`` is its y coordinate (larger is lower). ``outline_gv`` is a convex or
    simple polygon of (x, z), counter-clockwise seen from above. ``kind`` is ``floor``
    for the lowest large one, else ``table`` (raised) or ``patch`` (small, local).
    """

    name: str
    kind: Literal["floor", "table", "patch"]
    height_gv: float
    outline_gv: Float[np.ndarray, "k 2"]
    area_m2: float
    inliers: int


@dataclass(frozen=True)
class ObjectMasks:
    """One target's visible pixels in every view of the reconstruction, and its points.

    ``masks[i]`` belongs to ``Reconstruction.views[i]`` and has its size; all False where
    the object is not seen. ``occluded`` is the estimated share of the object hidden in
    each view by nearer things or the image border (0..1). ``points_gv`` are the object's
    own fused points. ``support`` is the surface that it stands on (None: nothing found
    that carries it; the verdict is then degraded).
    """

    SCHEMA: ClassVar[str] = "garden.ObjectMasks/1"
    target: Target
    photos: tuple[str, ...]
    masks: tuple[Bool[np.ndarray, "h w"], ...]
    occluded: Float[np.ndarray, " views"]
    points_gv: PointCloud
    support: SupportSurface | None
    verdict: Verdict = OK


@dataclass(frozen=True)
class ObjectMesh:
    """A complete, closed triangle mesh in the upright object frame, metres.

    ``observed`` tells for each vertex whether a photo saw it (False: closed by support
    plane, symmetry or interpolation; ``completion`` says which were used).
    ``gv_from_object`` is where the object was seen when the mesh was made; it leans if a
    model that made the mesh put it so.
    """

    SCHEMA: ClassVar[str] = "garden.ObjectMesh/1"
    name: str
    vertices: Float[np.ndarray, "v 3"]
    faces: Int[np.ndarray, "f 3"]
    vertex_rgb: UInt8[np.ndarray, "v 3"]
    observed: Bool[np.ndarray, " v"]
    gv_from_object: Float[np.ndarray, "4 4"]
    watertight: bool
    completion: tuple[str, ...] = ()
    verdict: Verdict = OK


@dataclass(frozen=True)
class PlacementHypothesis:
    """One candidate pose; ``scores`` hold at least mask_iou, depth_residual_m,
    support_gap_m and total (higher total is better), and tilt_deg where poses may lean.
    """

    name: str
    rotation_gv: Float[np.ndarray, "3 3"]
    translation_gv: Float[np.ndarray, "3"]
    scale: float
    scores: dict[str, float]

    @property
    def gv_from_object(self) -> Float[np.ndarray, "4 4"]:
        """Similarity transform (4x4) from the object frame to GV."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation_gv * self.scale
        matrix[:3, 3] = self.translation_gv
        return matrix


@dataclass(frozen=True)
class Placement:
    """Every hypothesis with its scores, and the one that the gate picked and why."""

    SCHEMA: ClassVar[str] = "garden.Placement/1"
    name: str
    hypotheses: tuple[PlacementHypothesis, ...]
    chosen: int
    why: str
    verdict: Verdict = OK

    @property
    def best(self) -> PlacementHypothesis:
        """The chosen hypothesis."""
        return self.hypotheses[self.chosen]


@dataclass(frozen=True)
class PointLabels:
    """For each of ``Reconstruction.points_world``: probability (0..1) of being part of
    the target object; points at or above ``threshold`` leave the background.
    """

    SCHEMA: ClassVar[str] = "garden.PointLabels/1"
    name: str
    method: str
    probability: Float[np.ndarray, " n"]
    threshold: float = 0.5
    verdict: Verdict = OK


@dataclass(frozen=True)
class Background:
    """The scene's points without the objects, in GV; holes on supports are filled.

    ``filled`` marks points that were invented to close a hole; ``removed`` counts the
    points that each target took away.
    """

    SCHEMA: ClassVar[str] = "garden.Background/1"
    points_gv: PointCloud
    filled: Bool[np.ndarray, " n"]
    removed: dict[str, int]
    verdict: Verdict = OK


@dataclass(frozen=True)
class ConvexPiece:
    """A convex collider in the body frame, metres."""

    vertices: Float[np.ndarray, "v 3"]
    faces: Int[np.ndarray, "f 3"]


@dataclass(frozen=True)
class Body:
    """A rigid body. Mesh, colliders, centre of mass and inertia are in the body frame,
    which is the upright object frame with the placement's scale baked in.

    ``inertia`` (kg m^2) is about the centre of mass. ``lifted_m`` is how far it was
    raised because it started inside its support (negative: lowered onto it), ``pushed_m``
    how far it was moved sideways out of another body. ``physics_note`` says where mass and
    friction come from.
    """

    name: str
    vertices: Float[np.ndarray, "v 3"]
    faces: Int[np.ndarray, "f 3"]
    vertex_rgb: UInt8[np.ndarray, "v 3"]
    colliders: tuple[ConvexPiece, ...]
    mass_kg: float
    centre_of_mass: Float[np.ndarray, "3"]
    inertia: Float[np.ndarray, "3 3"]
    friction: float
    gv_from_body: Float[np.ndarray, "4 4"]
    lifted_m: float
    supported_by: str
    physics_note: str = ""
    pushed_m: float = 0.0
    verdict: Verdict = OK


@dataclass(frozen=True)
class SimScene:
    """Bodies, supports and the MuJoCo model's MJCF text (GV frame, gravity +y)."""

    SCHEMA: ClassVar[str] = "garden.SimScene/1"
    bodies: tuple[Body, ...]
    supports: tuple[SupportSurface, ...]
    scale: Scale
    verdict: Verdict = OK


@dataclass(frozen=True)
class BodyMotion:
    """How one body moved: at the end against the start (after any lift).

    ``tilt_deg`` is the angle between its y axis then and now; ``drift_m`` the distance
    its centre of mass moved; ``penetration_m`` the deepest contact at the end.
    """

    name: str
    tilt_deg: float
    drift_m: float
    penetration_m: float
    at_rest: bool
    verdict: Verdict = OK


@dataclass(frozen=True)
class Trajectory:
    """Poses over the simulated time, GV metres; quaternions are wxyz."""

    SCHEMA: ClassVar[str] = "garden.Trajectory/1"
    times_s: Float[np.ndarray, " t"]
    positions_gv: Float[np.ndarray, "t b 3"]
    quaternions_gv: Float[np.ndarray, "t b 4"]
    motions: tuple[BodyMotion, ...]
    verdict: Verdict = OK


@dataclass(frozen=True)
class Render:
    """Pictures at one photo's camera: the scene before and after the simulation, and
    the background alone; ``object_ids`` is -1 for background, else the body's index.
    """

    photo: str
    before: UInt8[np.ndarray, "h w 3"]
    after: UInt8[np.ndarray, "h w 3"]
    background: UInt8[np.ndarray, "h w 3"]
    object_ids: Int[np.ndarray, "h w"]


@dataclass(frozen=True)
class Renders:
    """Renders at the photos' cameras."""

    SCHEMA: ClassVar[str] = "garden.Renders/1"
    renders: tuple[Render, ...]
    verdict: Verdict = OK
