"""Show the scene: photos beside renders, the points turned upright, gravity, depth maps."""

from __future__ import annotations

import base64
from html import escape

import numpy as np

from flows.report.pictures import data_uri, depth_picture, draw_box
from flows.report.values import SceneValues
from garden_models.scene import PointCloud

POINTS_SHOWN = 60_000


def photo_section(values: SceneValues) -> str:
    """Return photos beside the renders before and after the simulation."""
    if values.renders is None or values.reconstruction is None:
        return _photos_only(values)
    views = {view.photo: view for view in values.reconstruction.views}
    rows = []
    for render in values.renders.renders:
        view = views[render.photo]
        pictures = [
            (f"photo {render.photo}", view.rgb),
            ("render before", render.before),
            ("render after 10 s", render.after),
            ("background alone", render.background),
        ]
        rows.append(f'<div class="row four">{_figures(pictures, 460)}</div>')
    first, rest = "".join(rows[:3]), "".join(rows[3:])
    more = f"<details><summary>{len(rows) - 3} more views</summary>{rest}</details>" if rest else ""
    return f'<h2>Photos and renders</h2><div class="card">{first}{more}</div>'


def _photos_only(values: SceneValues) -> str:
    if values.capture is None:
        return ""
    boxes = {t.photo: t for t in values.result.request.targets}
    pictures = []
    for photo in values.capture.photos[:12]:
        rgb = photo.rgb
        if photo.name in boxes:
            factor = rgb.shape[1] / photo.original_size[0]
            x0, y0, x1, y1 = (factor * v for v in boxes[photo.name].box)
            rgb = draw_box(rgb, (x0, y0, x1, y1))
        pictures.append((photo.name, rgb))
    return f'<h2>Photos</h2><div class="card row four">{_figures(pictures, 320)}</div>'


def depth_section(values: SceneValues) -> str:
    """Return every view's depth map."""
    if values.reconstruction is None:
        return ""
    pictures = []
    for view in values.reconstruction.views:
        share = float((view.depth > 0).mean())
        pictures.append((f"{view.photo}, {share:.0%} valid", depth_picture(view.depth)))
    return (
        "<h2>Depth</h2><details open><summary>near is warm, grey has no depth</summary>"
        f'<div class="card row strip">{_figures(pictures, 260)}</div></details>'
    )


def gravity_section(values: SceneValues) -> str:
    """Return the cues, what each said, and which were believed."""
    gravity = values.gravity_view
    if gravity is None:
        return ""
    rows = []
    for cue in gravity.evidence:
        cosine = float(np.clip(cue.down_world @ gravity.down_world, -1, 1))
        rows.append(
            f"<tr><td>{escape(cue.method)}</td><td>{'yes' if cue.accepted else 'no'}</td>"
            f'<td class="n">{np.degrees(np.arccos(cosine)):.2f}°</td>'
            f'<td class="n">± {cue.sigma_deg:.2f}°</td><td>{escape(cue.note)}</td></tr>'
        )
    return (
        f"<h2>Gravity</h2><div class='card scroll'><p>Gravity is known to ± "
        f"{gravity.sigma_deg:.2f}° (1 sigma); reference photo "
        f"{escape(gravity.reference_photo)}.</p><table><tr><th>cue</th><th>believed</th>"
        "<th class='n'>off the result</th><th class='n'>its own sigma</th><th>note</th></tr>"
        f"{''.join(rows)}</table></div>"
    )


def background_section(values: SceneValues) -> str:
    """Return what was taken out of the background and what was filled."""
    background = values.background
    if background is None:
        return ""
    removed = ", ".join(f"{escape(n)}: {c:,}" for n, c in background.removed.items())
    return (
        f"<h2>Background</h2><div class='card'><p>{len(background.points_gv):,} points; removed "
        f"{removed or 'nothing'}; {int(background.filled.sum()):,} points fill the holes that the "
        "objects left on what carries them.</p></div>"
    )


def points_section(values: SceneValues) -> str:
    """Return the point cloud turned upright, to be turned with the mouse."""
    if values.background is not None:
        points = values.background.points_gv
    elif values.reconstruction is not None and values.gravity_view is not None:
        points = _in_gv(values)
    else:
        return ""
    packed, scale = pack_points(points, POINTS_SHOWN)
    data = base64.b64encode(packed).decode()
    return (
        "<h2>Points, upright</h2><p class='dim'>Drag to turn, wheel to zoom, shift-drag to "
        f"move. Down is gravity.</p><canvas id='points' data-scale='{scale:.6f}'></canvas>"
        f"<script type='text/plain' id='points-data'>{data}</script>"
    )


def pack_points(points: PointCloud, limit: int) -> tuple[bytes, float]:
    """Pack at most ``limit`` points as low bytes, high bytes and colours (9 bytes each).

    Returns the bytes and the shown points' spacing as a share of half the cube's side.
    """
    keep = np.linspace(0, len(points) - 1, min(limit, len(points))).astype(int)
    xyz = points.xyz[keep]
    low, high = np.percentile(xyz, [1, 99], axis=0)
    half = max(float((high - low).max()) / 2, 1e-6)
    level = np.clip((xyz - (low + high) / 2) / half, -1, 1)
    quantised = np.round((level + 1) / 2 * 65535).astype(np.uint16)
    packed = np.concatenate(
        [(quantised & 255).astype(np.uint8), (quantised >> 8).astype(np.uint8), points.rgb[keep]],
        axis=1,
    )
    thinning = np.sqrt(len(points) / max(len(keep), 1))
    return packed.tobytes(), float(np.median(points.spacing[keep]) * thinning / half)


def _in_gv(values: SceneValues) -> PointCloud:
    from dataclasses import replace

    from garden_models.geometry.rigid import transform_points

    assert values.reconstruction is not None
    assert values.gravity_view is not None
    points = values.reconstruction.points_world
    return replace(points, xyz=transform_points(values.gravity_view.gv_from_world, points.xyz))


def _figures(pictures: list[tuple[str, np.ndarray]], long_side: int) -> str:
    return "".join(
        f'<figure><img loading="lazy" src="{data_uri(rgb, long_side)}" alt=""><figcaption>'
        f"{escape(name)}</figcaption></figure>"
        for name, rgb in pictures
    )
