"""Show one object: its masks, mesh, placement scores and its motion over the simulation."""

from __future__ import annotations

from html import escape

import numpy as np

from flows.report.charts import Line, line_chart
from flows.report.pictures import cropped, figure, mask_overlay
from flows.report.values import ObjectValues, SceneValues
from garden_models.geometry.rotation import matrix_from_quaternion
from garden_models.rendering.turntable import Turntable, turn_mesh
from garden_models.scene import Trajectory, Verdict

MASKS_SHOWN = 12
PICTURE = 320
LEAST_MM, LEAST_SHARE, LEAST_DEG = 1.0, 0.002, 1.0
"""Least ranges of the motion charts: millimetres or a share of the object's size, degrees."""


def object_section(values: ObjectValues, scene: SceneValues, verdict: Verdict) -> str:
    """Return the section of one factored object."""
    reasons = "".join(f"<p>{escape(reason)}</p>" for reason in verdict.reasons)
    parts = [
        reasons,
        _mesh(values),
        _masks(values, scene),
        _placement(values),
        _motion(values, scene),
    ]
    return "".join(parts)


def _mesh(values: ObjectValues) -> str:
    mesh, name = values.mesh, values.target.name
    config = Turntable(size=(PICTURE, PICTURE))
    turns = [f"{360 * i / config.sides:.0f}° around" for i in range(config.sides)]
    pictures = turn_mesh(mesh.vertices, mesh.faces, mesh.vertex_rgb, config)
    figures = "".join(
        figure(rgb, caption, f"mesh of {name}, {caption}", PICTURE)
        for caption, rgb in zip(
            [*turns, "from above"], cropped(pictures, config.backdrop), strict=True
        )
    )
    size = np.ptp(mesh.vertices, axis=0) * values.placement.best.scale
    closed = "watertight" if mesh.watertight else "not watertight"
    completion = "; ".join(mesh.completion) or "nothing had to be completed"
    return (
        f'<div class="card"><h3>Mesh</h3><p class="dim">{len(mesh.faces):,} faces, {closed}, '
        f"{size[0] * 100:.1f} × {size[1] * 100:.1f} × {size[2] * 100:.1f} cm "
        f"(x, height, z), {mesh.observed.mean():.0%} of it seen. {escape(completion)}.</p>"
        f'<div class="row wide">{figures}</div><p class="dim">All to one scale, from '
        f"{config.elevation_deg:.0f}° above level.</p></div>"
    )


def _masks(values: ObjectValues, scene: SceneValues) -> str:
    if scene.reconstruction is None:
        return ""
    seen = [i for i, mask in enumerate(values.masks.masks) if mask.any()]
    shown = [seen[i] for i in np.unique(np.linspace(0, len(seen) - 1, MASKS_SHOWN).astype(int))]
    figures = []
    for i in shown if seen else []:
        view = scene.reconstruction.views[i]
        picture = mask_overlay(view.rgb, values.masks.masks[i])
        hidden = values.masks.occluded[i]
        note = f", {hidden:.0%} hidden" if hidden > 0.02 else ""
        caption = f"{view.photo}{note}"
        figures.append(figure(picture, caption, f"mask of {values.target.name} in {caption}", 300))
    return (
        f'<div class="card"><h3>Masks</h3><p class="dim">Seen in {len(seen)} of '
        f"{len(values.masks.masks)} photos. Outlined in red, the rest dimmed; hidden is the share "
        f'that other things cover.</p><div class="row strip">{"".join(figures)}</div></div>'
    )


def _placement(values: ObjectValues) -> str:
    placement = values.placement
    names = list(dict.fromkeys(k for h in placement.hypotheses for k in h.scores))
    head = "".join(f'<th class="n">{escape(_score_name(name))}</th>' for name in names)
    rows = []
    for i, hypothesis in enumerate(placement.hypotheses):
        cells = "".join(
            f'<td class="n">{_score(name, hypothesis.scores.get(name))}</td>' for name in names
        )
        chosen = ' class="chosen"' if i == placement.chosen else ""
        rows.append(f"<tr{chosen}><td>{escape(hypothesis.name)}</td>{cells}</tr>")
    return (
        f'<div class="card"><h3>Placement</h3><p>{escape(placement.why)}</p>'
        f"<details><summary>scores of all {len(rows)} poses (the chosen one is bold)</summary>"
        f'<div class="scroll"><table><tr><th>pose</th>{head}</tr>{"".join(rows)}</table></div>'
        "</details></div>"
    )


def _score_name(name: str) -> str:
    """Return a score's name as the table's head: lengths are told in millimetres."""
    words = name.removesuffix("_m").replace("_", " ").replace("iou", "IoU").replace("rmse", "RMSE")
    if name.endswith("_m"):
        return f"{words} (mm)"
    return f"{words} (of 255)" if name.startswith("colour") else words


def _score(name: str, value: float | None) -> str:
    if value is None or not np.isfinite(value):
        return "–"
    return f"{1000 * value:.2f}" if name.endswith("_m") else f"{value:.4g}"


def _motion(values: ObjectValues, scene: SceneValues) -> str:
    trajectory = scene.trajectory
    names = [m.name for m in trajectory.motions] if trajectory else []
    if trajectory is None or values.target.name not in names:
        return '<div class="card"><h3>Motion</h3><p>Not simulated.</p></div>'
    index = names.index(values.target.name)
    motion = trajectory.motions[index]
    moved_mm, tilt_deg = motion_curves(trajectory, index)
    body = scene.scene.bodies[index] if scene.scene else None
    lines = [
        f"After {trajectory.times_s[-1]:.0f} s: tilted {motion.tilt_deg:.2f}°, moved "
        f"{motion.drift_m * 1000:.2f} mm, {motion.penetration_m * 1000:.2f} mm into its support, "
        + ("at rest" if motion.at_rest else "still moving")
    ]
    if body is not None:
        lines.append(
            f"{body.mass_kg:.3g} kg in {len(body.colliders)} convex pieces, friction "
            f"{body.friction:g}, carried by {escape(body.supported_by or 'nothing')}, lifted by "
            f"{body.lifted_m * 1000:.1f} mm at the start. {escape(body.physics_note)}"
        )
    size_m = float(np.ptp(values.mesh.vertices, axis=0).max()) * values.placement.best.scale
    floor_mm = max(LEAST_MM, 1000 * LEAST_SHARE * size_m)
    charts = [
        line_chart(trajectory.times_s, Line("moved", "mm", moved_mm, "#2a78c2", floor_mm)),
        line_chart(trajectory.times_s, Line("tilted", "°", tilt_deg, "#c2572a", LEAST_DEG)),
    ]
    text = "".join(f"<p>{line}</p>" for line in lines)
    return (
        f'<div class="card"><h3>Motion</h3>{text}<div class="row two">{"".join(charts)}</div></div>'
    )


def motion_curves(trajectory: Trajectory, index: int) -> tuple[np.ndarray, np.ndarray]:
    """Return how far (mm) and by what tilt (degrees) a body was from its start, over time."""
    positions = trajectory.positions_gv[:, index]
    up = np.stack([matrix_from_quaternion(q)[:, 1] for q in trajectory.quaternions_gv[:, index]])
    cosine = np.clip(up @ up[0], -1, 1)
    return (
        1000 * np.linalg.norm(positions - positions[0], axis=1),
        np.degrees(np.arccos(cosine)),
    )
