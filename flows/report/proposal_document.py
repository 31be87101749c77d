"""Say in the report what was proposed as targets, by whom, and what its check changed."""

from __future__ import annotations

from typing import Any

from garden_models.scene import Target
from garden_models.targets.proposal import Query, TargetChange, TargetProposal

ANSWER_SHOWN = 4000
"""Characters of a raw answer; all of it is in the store."""

Json = dict[str, Any]


def proposal_document(proposal: TargetProposal) -> Json:
    """Return the report's ``proposal``."""
    scores = proposal.scores or (None,) * len(proposal.targets)
    return {
        "model": proposal.model,
        "goal": proposal.goal,
        "targets": [
            {**_target(target), "score": score}
            for target, score in zip(proposal.targets, scores, strict=True)
        ],
        "proposed": [_target(target) for target in proposal.proposed],
        "changes": [_change(change) for change in proposal.changes],
        "queries": [_query(query) for query in proposal.queries],
        "tokens": {
            "input": _sum([query.input_tokens for query in proposal.queries]),
            "output": _sum([query.output_tokens for query in proposal.queries]),
        },
        "status": proposal.verdict.status,
        "reasons": list(proposal.verdict.reasons),
    }


def _target(target: Target) -> Json:
    return {"name": target.name, "photo": target.photo, "box": list(target.box)}


def _change(change: TargetChange) -> Json:
    return {
        "kind": change.kind,
        "before": _target(change.before) if change.before else None,
        "after": _target(change.after) if change.after else None,
        "why": change.why,
    }


def _query(query: Query) -> Json:
    cut = len(query.answer) > ANSWER_SHOWN
    return {
        "purpose": query.purpose,
        "model": query.model,
        "photos": list(query.photos),
        "answer": query.answer[:ANSWER_SHOWN] + (" ..." if cut else ""),
        "input_tokens": query.input_tokens,
        "output_tokens": query.output_tokens,
    }


def _sum(counts: list[int | None]) -> int | None:
    known = [count for count in counts if count is not None]
    return sum(known) if known else None
