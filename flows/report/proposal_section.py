"""Show what was proposed as targets, what its check changed, and the answers themselves."""

from __future__ import annotations

from html import escape

from flows.report.pictures import Picture, draw_box, figure
from flows.report.proposal_document import ANSWER_SHOWN
from flows.report.values import SceneValues
from garden_models.scene import Photo, Target
from garden_models.targets.proposal import Query, TargetChange, TargetProposal

BEFORE, AFTER = (150, 150, 150), (255, 90, 30)


def proposal_section(values: SceneValues) -> str:
    """Return the section; empty if targets were given."""
    proposal = values.proposal
    if proposal is None:
        return ""
    reasons = "".join(f"<p>{escape(reason)}</p>" for reason in proposal.verdict.reasons)
    return (
        f'<div class="card">{_head(proposal)}{reasons}{_changes(proposal)}{_photos(values)}'
        f"{''.join(_answer(query) for query in proposal.queries)}</div>"
    )


def _head(proposal: TargetProposal) -> str:
    goal = f" for the goal: {escape(proposal.goal)}" if proposal.goal else ""
    found = ", ".join(target.name for target in proposal.targets)
    return f"<p>{escape(proposal.model)} proposed {escape(found)}{goal}.</p>"


def _changes(proposal: TargetProposal) -> str:
    if len(proposal.queries) < 2:
        return ""
    if not proposal.changes:
        return '<p class="dim">Its check changed nothing.</p>'
    rows = "".join(_row(change) for change in proposal.changes)
    return (
        '<div class="scroll"><table><tr><th>the check</th><th>before</th><th>after</th>'
        f"<th>why</th></tr>{rows}</table></div>"
    )


def _row(change: TargetChange) -> str:
    cells = (change.kind, _place(change.before), _place(change.after), change.why)
    return "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"


def _place(target: Target | None) -> str:
    if target is None:
        return ""
    return f"{target.name} in {target.photo}: {', '.join(f'{v:.0f}' for v in target.box)}"


def _photos(values: SceneValues) -> str:
    assert values.proposal is not None
    before, after = values.proposal.proposed, values.proposal.targets
    named = {target.photo for target in (*before, *after)}
    figures = []
    for photo in values.capture.photos if values.capture else ():
        if photo.name not in named:
            continue
        picture = _drawn(photo, [t for t in before if t not in after], BEFORE)
        picture = _drawn(photo, after, AFTER, picture)
        inside = ", ".join(t.name for t in after if t.photo == photo.name) or "none left"
        caption = f"{photo.name}: {inside}"
        figures.append(figure(picture, caption, f"boxes in {caption}", 460))
    if not figures:
        return ""
    legend = '<p class="dim">Grey boxes are those that the check changed or removed.</p>'
    grey = legend if set(before) - set(after) else ""
    return f'<div class="row four">{"".join(figures)}</div>{grey}'


def _drawn(
    photo: Photo,
    targets: tuple[Target, ...] | list[Target],
    colour: tuple[int, int, int],
    on: Picture | None = None,
) -> Picture:
    picture = photo.rgb.copy() if on is None else on
    factor = photo.rgb.shape[1] / photo.original_size[0]
    for target in targets:
        if target.photo == photo.name:
            x0, y0, x1, y1 = (factor * v for v in target.box)
            picture = draw_box(picture, (x0, y0, x1, y1), colour)
    return picture


def _answer(query: Query) -> str:
    counts = [
        f"{count:,} tokens {word}"
        for count, word in ((query.input_tokens, "asked"), (query.output_tokens, "answered"))
        if count is not None
    ]
    cost = f", {' and '.join(counts)}" if counts else ""
    title = {"propose": "the proposal", "critic": "its check"}[query.purpose]
    cut = query.answer[:ANSWER_SHOWN] + (" ..." if len(query.answer) > ANSWER_SHOWN else "")
    return (
        f"<details><summary>{title}: {escape(query.model)} on {len(query.photos)} photos{cost}"
        f'</summary><pre class="scroll">{escape(cut)}</pre></details>'
    )
