"""Write ``report.html``: one file that opens alone in a browser, without a network."""

from __future__ import annotations

import re
from html import escape
from importlib.resources import files

from flows.report.document import Json, object_verdict
from flows.report.object_section import object_section
from flows.report.scene_section import (
    background_section,
    depth_section,
    gravity_section,
    photo_section,
    points_section,
)
from flows.report.values import SceneValues

STEPS_START, STEPS_END = "<!-- steps -->", "<!-- /steps -->"


def report_page(values: SceneValues, document: Json) -> str:
    """Return the whole page."""
    motions = {m.name: m for m in values.trajectory.motions} if values.trajectory else {}
    sections = [
        _head(document),
        _facts(document),
        photo_section(values),
        *(
            object_section(o, values, object_verdict(o, motions.get(o.target.name)))
            for o in values.objects
        ),
        _failed_objects(document),
        background_section(values),
        points_section(values),
        gravity_section(values),
        depth_section(values),
        STEPS_START + steps_section(document) + STEPS_END,
    ]
    style = files("flows.report").joinpath("page.css").read_text("utf-8")
    script = files("flows.report").joinpath("points_viewer.js").read_text("utf-8")
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(document['scene'])} · GARDEN</title><style>{style}</style></head>"
        f"<body><main>{''.join(sections)}</main><script>{script}</script></body></html>"
    )


def with_steps_of(page: str, document: Json) -> str:
    """Return the page with its table of steps replaced by that of another run."""
    pattern = re.compile(re.escape(STEPS_START) + ".*?" + re.escape(STEPS_END), re.DOTALL)
    section = STEPS_START + steps_section(document) + STEPS_END
    return pattern.sub(lambda _: section, page)


def steps_section(document: Json) -> str:
    """Return the table of steps: backend, outcome, verdict, why, and time."""
    rows = []
    for step in document["steps"]:
        target = f"[{escape(step['target'])}]" if step["target"] else ""
        seconds = step["seconds"]
        total = sum(v or 0.0 for v in seconds.values())
        detail = ", ".join(f"{name} {value or 0:.2f}" for name, value in seconds.items())
        rows.append(
            f"<tr><td>{escape(step['step'])}{target}</td><td>{escape(step['backend'] or '')}</td>"
            f"<td>{escape(step['outcome'] or '')}</td><td>{_badge(step['status'])}</td>"
            f'<td class="n" title="{detail} s">{total:.2f}</td>'
            f'<td class="n">{step["peak_mb"] or 0:.0f}</td>'
            f"<td>{escape('; '.join(step['reasons']))} "
            f'<span class="dim">{escape(step["why"])}</span></td></tr>'
        )
    return (
        f"<h2>Steps</h2><p class='dim'>{document['executed']} executed in this run, "
        f"{document['seconds']:.1f} s in all. Seconds are those of the run that computed the "
        "artifact.</p><div class='card scroll'><table><tr><th>step</th><th>backend</th>"
        "<th>outcome</th><th>verdict</th><th class='n'>seconds</th><th class='n'>peak MB</th>"
        f"<th>reasons, and why it ran or not</th></tr>{''.join(rows)}</table></div>"
    )


def _badge(status: str) -> str:
    return f'<span class="verdict {status}">{status}</span>'


def _head(document: Json) -> str:
    reasons = "".join(f"<p>{escape(reason)}</p>" for reason in document["reasons"])
    remarks = "".join(f"<p class='dim'>{escape(remark)}</p>" for remark in document["remarks"])
    return f"<h1>{escape(document['scene'])} {_badge(document['status'])}</h1>{reasons}{remarks}"


def _facts(document: Json) -> str:
    photos, scale, gravity = document["photos"], document["scale"], document["gravity"]
    facts = [("photos registered", f"{photos['registered']} of {photos['given']}")]
    if gravity:
        facts.append(("gravity known to", f"± {gravity['sigma_deg']:.2f}°"))
    if scale:
        facts.append(("scale", f"{escape(scale['source'])}"))
    facts.append(("objects", str(len(document["objects"]))))
    if document["background"]:
        facts.append(("background points", f"{document['background']['points']:,}"))
    facts.append(("this run", f"{document['seconds']:.0f} s"))
    cells = "".join(f"<div><b>{value}</b>{name}</div>" for name, value in facts)
    notes = []
    if photos["unregistered"] and photos["given"]:
        names = ", ".join(escape(name) for name in photos["unregistered"])
        notes.append(f"<p>Not registered: {names}</p>")
    if scale and scale["note"]:
        notes.append(f'<p class="dim">Scale: {escape(scale["note"])}</p>')
    return f'<div class="facts">{cells}</div>{"".join(notes)}'


def _failed_objects(document: Json) -> str:
    return "".join(
        f'<h2>{escape(o["name"])} {_badge("failed")}</h2><div class="card">'
        f"<p>{escape('; '.join(o['reasons']))}</p></div>"
        for o in document["objects"]
        if "placement" not in o
    )
