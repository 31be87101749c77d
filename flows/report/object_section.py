"""Show one object: its masks, mesh, placement scores and its motion over the simulation."""

from __future__ import annotations

from html import escape

import numpy as np

from flows.report.charts import Line, line_chart
from flows.report.pictures import data_uri, mask_overlay
from flows.report.values import ObjectValues, SceneValues
from garden_models.geometry.rotation import matrix_from_quaternion
from garden_models.rendering.turntable import Turntable, turn_mesh
from garden_models.scene import Trajectory, Verdict

MASKS_SHOWN = 12


def object_section(values: ObjectValues, scene: SceneValues, verdict: Verdict) -> str:
    """Return the section of one factored object."""
    reasons = "".join(f"<p>{escape(reason)}</p>" for reason in verdict.reasons)
    parts = [
        f'<h2>{escape(values.target.name)} <span class="verdict {verdict.status}">'
        f"{verdict.status}</span></h2>{reasons}",
        _mesh(values),
        _masks(values, scene),
        '<div class="row two">',
        _placement(values),
        _motion(values, scene),
        "</div>",
    ]
    return "".join(parts)


def _mesh(values: ObjectValues) -> str:
    mesh = values.mesh
    config = Turntable()
    turns = [f"{360 * i / config.sides:.0f}°" for i in range(config.sides)]
    pictures = turn_mesh(mesh.vertices, mesh.faces, mesh.vertex_rgb, config)
    figures = "".join(
        f'<figure><img src="{data_uri(rgb, 260)}" alt="{name}"><figcaption>{name}</figcaption>'
        "</figure>"
        for name, rgb in zip([*turns, "from above"], pictures, strict=True)
    )
    size = np.ptp(mesh.vertices, axis=0) * values.placement.best.scale
    closed = "watertight" if mesh.watertight else "not watertight"
    completion = "; ".join(mesh.completion) or "nothing had to be completed"
    return (
        f'<div class="card"><h3>Mesh</h3><p class="dim">{len(mesh.faces):,} faces, {closed}, '
        f"{size[0] * 100:.1f} × {size[1] * 100:.1f} × {size[2] * 100:.1f} cm "
        f"(x, height, z), {mesh.observed.mean():.0%} of it seen. {escape(completion)}.</p>"
        f'<div class="row strip">{figures}</div></div>'
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
        figures.append(
            f'<figure><img src="{data_uri(picture, 280)}" alt=""><figcaption>'
            f"{escape(view.photo)}{note}</figcaption></figure>"
        )
    return (
        f'<div class="card"><h3>Masks</h3><p class="dim">seen in {len(seen)} of '
        f'{len(values.masks.masks)} photos</p><div class="row strip">{"".join(figures)}</div></div>'
    )


def _placement(values: ObjectValues) -> str:
    placement = values.placement
    names = list(dict.fromkeys(k for h in placement.hypotheses for k in h.scores))
    head = "".join(f'<th class="n">{escape(name.replace("_", " "))}</th>' for name in names)
    rows = []
    for i, hypothesis in enumerate(placement.hypotheses):
        cells = "".join(
            f'<td class="n">{hypothesis.scores.get(name, float("nan")):.4g}</td>' for name in names
        )
        chosen = ' class="chosen"' if i == placement.chosen else ""
        rows.append(f"<tr{chosen}><td>{escape(hypothesis.name)}</td>{cells}</tr>")
    return (
        f'<div class="card scroll"><h3>Placement</h3><p>{escape(placement.why)}</p>'
        f"<table><tr><th>hypothesis</th>{head}</tr>{''.join(rows)}</table></div>"
    )


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
        f"after {trajectory.times_s[-1]:.0f} s: tilted {motion.tilt_deg:.2f}°, moved "
        f"{motion.drift_m * 1000:.2f} mm, {motion.penetration_m * 1000:.2f} mm into its support, "
        + ("at rest" if motion.at_rest else "still moving")
    ]
    if body is not None:
        lines.append(
            f"{body.mass_kg:.3g} kg in {len(body.colliders)} convex pieces, friction "
            f"{body.friction:g}, carried by {escape(body.supported_by or 'nothing')}, lifted by "
            f"{body.lifted_m * 1000:.1f} mm at the start. {escape(body.physics_note)}"
        )
    chart = line_chart(trajectory.times_s, [Line("moved", moved_mm, "#2a78c2")], "s", "mm")
    chart += line_chart(trajectory.times_s, [Line("tilt", tilt_deg, "#c2572a")], "s", "deg")
    text = "".join(f"<p>{line}</p>" for line in lines)
    return f'<div class="card"><h3>Motion</h3>{text}{chart}</div>'


def motion_curves(trajectory: Trajectory, index: int) -> tuple[np.ndarray, np.ndarray]:
    """Return how far (mm) and by what tilt (degrees) a body was from its start, over time."""
    positions = trajectory.positions_gv[:, index]
    up = np.stack([matrix_from_quaternion(q)[:, 1] for q in trajectory.quaternions_gv[:, index]])
    cosine = np.clip(up @ up[0], -1, 1)
    return (
        1000 * np.linalg.norm(positions - positions[0], axis=1),
        np.degrees(np.arccos(cosine)),
    )
