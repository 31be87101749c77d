"""Show the scene: photos beside renders, gravity, the background, depth maps."""

from __future__ import annotations

from html import escape

import numpy as np

from flows.report.pictures import depth_picture, draw_box, figure
from flows.report.values import SceneValues

VIEWS_SHOWN = 3
PHOTOS_SHOWN = 12


def photo_section(values: SceneValues) -> str:
    """Return photos beside the renders before and after the simulation."""
    if values.renders is None or values.reconstruction is None:
        return _photos_only(values)
    views = {view.photo: view for view in values.reconstruction.views}
    end = f"{values.trajectory.times_s[-1]:.0f} s" if values.trajectory else "the simulation"
    rows = []
    for render in values.renders.renders:
        name = render.photo
        figures = [
            figure(views[name].rgb, f"photo {name}", long_side=460),
            figure(render.before, "rendered as composed", f"render of {name} as composed", 460),
            figure(render.after, f"rendered after {end}", f"render of {name} after {end}", 460),
            figure(render.background, "background alone", f"background of {name} alone", 460),
        ]
        rows.append(f'<div class="row four">{"".join(figures)}</div>')
    first, rest = "".join(rows[:VIEWS_SHOWN]), "".join(rows[VIEWS_SHOWN:])
    count = len(rows) - VIEWS_SHOWN
    more = f"<details><summary>{count} more views</summary>{rest}</details>" if rest else ""
    return (
        '<p class="dim">Each photo beside the scene drawn by its camera; grey is where no point '
        f'was reconstructed.</p><div class="card">{first}{more}</div>'
    )


def _photos_only(values: SceneValues) -> str:
    if values.capture is None:
        return ""
    unregistered = values.cameras.unregistered if values.cameras else ()
    figures = []
    for photo in values.capture.photos[:PHOTOS_SHOWN]:
        rgb, caption = photo.rgb.copy(), photo.name
        for target in (t for t in values.result.refs.targets if t.photo == photo.name):
            factor = rgb.shape[1] / photo.original_size[0]
            x0, y0, x1, y1 = (factor * v for v in target.box)
            rgb = draw_box(rgb, (x0, y0, x1, y1))
            caption += f", box of {target.name}"
        caption += ", not registered" if photo.name in unregistered else ""
        figures.append(figure(rgb, caption, f"photo {caption}", 320))
    hidden = len(values.capture.photos) - len(figures)
    more = f"<p class='dim'>and {hidden} more photos</p>" if hidden > 0 else ""
    return f'<div class="card"><div class="row four">{"".join(figures)}</div>{more}</div>'


def depth_section(values: SceneValues) -> str:
    """Return every view's depth map."""
    if values.reconstruction is None:
        return ""
    figures = []
    for view in values.reconstruction.views:
        picture, span = depth_picture(view.depth)
        metres = f"{span[0]:.2f} to {span[1]:.2f} m" if span else "no depth"
        caption = f"{view.photo}: {metres}, {(view.depth > 0).mean():.0%} of the pixels"
        figures.append(figure(picture, caption, f"depth map of {caption}", 260))
    return (
        f"<details><summary>{len(figures)} depth maps: near is warm, grey has no depth; the "
        "colours span the metres in the captions</summary>"
        f'<div class="card row strip">{"".join(figures)}</div></details>'
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
            f"<tr><td>{escape(cue.method.replace('_', ' '))}</td>"
            f"<td>{'yes' if cue.accepted else 'no'}</td>"
            f'<td class="n">{np.degrees(np.arccos(cosine)):.2f}°</td>'
            f'<td class="n">± {cue.sigma_deg:.2f}°</td><td>{escape(cue.note)}</td></tr>'
        )
    return (
        f"<div class='card scroll'><p>Gravity is known to ± "
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
        f"<div class='card'><p>{len(background.points_gv):,} points; removed "
        f"{removed or 'nothing'}; {int(background.filled.sum()):,} points fill the holes that the "
        "objects left on what carries them.</p></div>"
    )
