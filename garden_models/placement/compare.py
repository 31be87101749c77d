"""Render an object at a pose (ray casting) and score it against masks, depth and colours."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, UInt8

from garden_models.meshing.ray_casting import Hits, RayCaster
from garden_models.placement.config import PlaceObject
from garden_models.placement.observation import Observation, ViewPixels
from garden_models.placement.pose import UprightPose
from garden_models.scene import ObjectMesh

HIDDEN_MARGIN = 0.02
"""What is nearer than the object by this share of its size hides it."""

WORST_DEPTH = 0.25
"""Depth residuals are capped at this share of the size, so that a few cannot rule."""


@dataclass(frozen=True)
class RenderedView:
    """The part of a rendering that falls on one view's pixels.

    ``hidden`` marks pixels at which something nearer hides the rendered object.
    """

    pixels: ViewPixels
    hit: Bool[np.ndarray, " n"]
    depth: Float[np.ndarray, " n"]
    hidden: Bool[np.ndarray, " n"]
    part: slice

    @property
    def shown(self) -> Bool[np.ndarray, " n"]:
        """Pixels at which the object should be visible."""
        return self.hit & ~self.hidden


class Comparison:
    """Compares one mesh with one observation at any pose."""

    def __init__(
        self, mesh: ObjectMesh, observation: Observation, support_height: float | None
    ) -> None:
        """``support_height``: y of the support in GV, None if there is none."""
        self.vertices = np.asarray(mesh.vertices, float)
        self.faces = mesh.faces
        self.observation = observation
        self.support_height = support_height
        self._rgb: UInt8[np.ndarray, "v 3"] = mesh.vertex_rgb
        self._caster = RayCaster(self.vertices, mesh.faces)

    @cached_property
    def size(self) -> float:
        """Diagonal of the mesh's bounding box at scale 1, metres."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    @cached_property
    def face_normals(self) -> Float[np.ndarray, "f 3"]:
        """Unit normals in the object frame."""
        a, b, c = (self.vertices[self.faces[:, i]] for i in range(3))
        normals = np.cross(b - a, c - a)
        return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)

    def render(self, pose: UprightPose) -> tuple[Hits, list[RenderedView]]:
        """Cast all rays at the mesh in ``pose``."""
        seen = self.observation
        hits = self._caster.cast(*pose.rays_to_object(seen.origins_gv, seen.directions_gv))
        margin = HIDDEN_MARGIN * self.size * pose.scale
        out = []
        for view, start, stop in zip(
            seen.views, seen.view_start[:-1], seen.view_start[1:], strict=True
        ):
            part = slice(int(start), int(stop))
            hit = hits.face[part] >= 0
            depth = hits.distance[part].astype(float)
            hidden = hit & ~view.mask & (view.occluder_depth < depth - margin)
            out.append(RenderedView(view, hit, depth, hidden, part))
        return hits, out

    def scores(self, pose: UprightPose, config: PlaceObject) -> dict[str, float]:
        """Return mask_iou, depth_residual_m, colour_rmse (0..255), support_gap_m and total;
        with a method whose poses may lean, tilt_deg too.
        """
        hits, views = self.render(pose)
        size = self.size * pose.scale
        overlaps, residuals, differences = [], [], []
        for view in views:
            mask = view.pixels.mask
            both = mask & view.hit
            overlaps.append(both.sum() / max((mask | view.shown).sum(), 1))
            measured = both & (view.pixels.depth > 0)
            residuals.append(np.abs(view.depth - view.pixels.depth)[measured])
            rendered = self._colours(hits, np.flatnonzero(both) + view.part.start)
            differences.append(rendered - view.pixels.rgb[both])
        residual = np.concatenate(residuals)
        difference = np.concatenate(differences)
        worst = WORST_DEPTH * size
        gap = self.support_gap(pose)
        iou = float(np.mean(overlaps))
        depth = float(np.minimum(residual, worst).mean()) if len(residual) else worst
        colour = float(np.sqrt((difference**2).mean())) if len(difference) else 255.0
        total = (
            iou
            - config.depth_weight * depth / size
            - config.colour_weight * colour / 255.0
            - config.support_weight * gap / size
            - config.tilt_weight * pose.tilt_deg / 90.0
        )
        scores = {
            "mask_iou": iou,
            "depth_residual_m": depth,
            "colour_rmse": colour,
            "support_gap_m": gap,
            "total": float(total),
        }
        if config.method != "render_and_compare":
            scores["tilt_deg"] = pose.tilt_deg
        return scores

    def support_gap(self, pose: UprightPose) -> float:
        """Return the distance between the lowest vertex and the support, metres."""
        if self.support_height is None:
            return 0.0
        return abs(float(pose.apply(self.vertices)[:, 1].max()) - self.support_height)

    def _colours(self, hits: Hits, rays: np.ndarray) -> Float[np.ndarray, "k 3"]:
        corners = self._rgb[self.faces[hits.face[rays]]].astype(float)
        return np.einsum("kc,kcd->kd", hits.barycentric[rays], corners)
