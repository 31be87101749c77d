"""Write ``report.html``: one file that opens alone in a browser, without a network."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from importlib.resources import files

from flows.report.document import Json, object_verdict
from flows.report.object_section import object_section
from flows.report.points_section import points_section
from flows.report.proposal_section import proposal_section
from flows.report.scene_section import (
    background_section,
    depth_section,
    gravity_section,
    photo_section,
)
from flows.report.values import SceneValues


@dataclass(frozen=True)
class Section:
    """A part of the page with a heading, found from the list at its top."""

    title: str
    body: str
    status: str = ""


def report_page(values: SceneValues, document: Json) -> str:
    """Return the whole page."""
    sections = [section for section in _sections(values, document) if section.body]
    links = " · ".join(
        f'<a href="#part-{i}">{escape(section.title)}</a>' for i, section in enumerate(sections)
    )
    parts = [
        _head(document),
        _marked("run", run_line(document)),
        _facts(document),
        f"<nav>{links}</nav>",
        *(
            f'<section id="part-{i}"><h2>{escape(section.title)} {_badge(section.status)}</h2>'
            f"{section.body}</section>"
            for i, section in enumerate(sections)
        ),
    ]
    style = files("flows.report").joinpath("page.css").read_text("utf-8")
    script = files("flows.report").joinpath("points_viewer.js").read_text("utf-8")
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<link rel="icon" href="data:,"><title>{escape(document["scene"])} · GARDEN</title>'
        f"<style>{style}</style></head>"
        f"<body><main>{''.join(parts)}</main><script>{script}</script></body></html>"
    )


def _sections(values: SceneValues, document: Json) -> list[Section]:
    motions = {m.name: m for m in values.trajectory.motions} if values.trajectory else {}
    objects = []
    for factored in values.objects:
        name = factored.target.name
        verdict = object_verdict(factored, motions.get(name))
        objects.append(Section(name, object_section(factored, values, verdict), verdict.status))
    return [
        Section("Photos and renders" if values.renders else "Photos", photo_section(values)),
        Section("Proposed targets", proposal_section(values), _status(values)),
        Section("The scene, upright", points_section(values)),
        *objects,
        *_failed_objects(document),
        Section("Background", background_section(values)),
        Section("Gravity", gravity_section(values)),
        Section("Depth", depth_section(values)),
        Section("Steps", _marked("steps", steps_section(document))),
    ]


def _status(values: SceneValues) -> str:
    return values.proposal.verdict.status if values.proposal else ""


def _marked(name: str, html: str) -> str:
    return f"<!-- {name} -->{html}<!-- /{name} -->"


def with_steps_of(page: str, document: Json) -> str:
    """Return the page with what it tells of a run replaced by another run's."""
    for name, html in (("run", run_line(document)), ("steps", steps_section(document))):
        start, end = _marked(name, "|").split("|")
        before, _, rest = page.partition(start)
        page = before + _marked(name, html) + rest.partition(end)[2]
    return page


def run_line(document: Json) -> str:
    """Return what this run did in one sentence."""
    outcomes = [step["outcome"] for step in document["steps"]]
    counts = [
        f"{outcomes.count(outcome)} {words}"
        for outcome, words in (
            ("executed", "executed"),
            ("cached", "found in the store"),
            ("failed", "failed"),
        )
        if outcomes.count(outcome)
    ]
    seconds = document["seconds"]
    return f'<p class="dim">Steps: {", ".join(counts) or "none"}, in {seconds:.1f} s.</p>'


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
            f"<td class='why'>{escape('; '.join(step['reasons']))} "
            f'<span class="dim">{escape(step["why"])}</span></td></tr>'
        )
    return (
        f"<p class='dim'>{document['executed']} executed in this run, {document['seconds']:.1f} s "
        "in all. Seconds and memory are those of the run that computed the result.</p>"
        "<div class='card scroll'><table><tr><th>step</th><th>backend</th><th>outcome</th>"
        "<th>verdict</th><th class='n'>seconds</th><th class='n'>peak MB</th>"
        f"<th>reasons, and why it ran or not</th></tr>{''.join(rows)}</table></div>"
    )


def _badge(status: str) -> str:
    return f'<span class="verdict {status}">{status}</span>' if status else ""


def _head(document: Json) -> str:
    return (
        f"<h1>{escape(document['scene'])} {_badge(document['status'])}</h1>"
        f"{_paragraphs(document['reasons'], 'reason')}{_paragraphs(document['remarks'], 'dim')}"
    )


def _facts(document: Json) -> str:
    photos, scale, gravity = document["photos"], document["scale"], document["gravity"]
    facts = [("photos registered", f"{photos['registered']} of {photos['given']}")]
    if gravity:
        facts.append(("gravity known to", f"± {gravity['sigma_deg']:.2f}°"))
    if scale:
        source = "assumed" if scale["source"] == "unknown" else scale["source"].replace("_", " ")
        facts.append(("scale", escape(source)))
    placed = sum("placement" in o for o in document["objects"])
    asked = len(document["objects"])
    facts.append(("objects factored out", f"{placed} of {asked}") if asked else ("targets", "none"))
    if document["background"]:
        facts.append(("background points", f"{document['background']['points']:,}"))
    cells = "".join(f"<div><b>{value}</b>{name}</div>" for name, value in facts)
    notes = []
    if photos["unregistered"] and photos["given"]:
        names = ", ".join(escape(name) for name in photos["unregistered"])
        notes.append(f"<p>Not registered: {names}</p>")
    if scale and scale["note"]:
        notes.append(f'<p class="dim">Scale: {escape(scale["note"])}</p>')
    return f'<div class="facts">{cells}</div>{"".join(notes)}'


def _failed_objects(document: Json) -> list[Section]:
    return [
        Section(o["name"], f'<div class="card">{_paragraphs(o["reasons"])}</div>', "failed")
        for o in document["objects"]
        if "placement" not in o
    ]


def _paragraphs(sentences: list[str], style: str = "") -> str:
    return "".join(f'<p class="{style}">{escape(sentence)}</p>' for sentence in sentences)
