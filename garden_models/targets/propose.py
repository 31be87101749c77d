"""Have a vision-language model propose targets, then check and repair them.

Paper, supplement: the first query shows the photos and the goal of the simulation and asks
for boxes; the second shows them the boxes and asks to repair what is obviously wrong or
missing.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Literal

from garden_models.scene import BadInput, Capture, Target, Verdict
from garden_models.targets.answer_json import shortened
from garden_models.targets.answered_targets import Answer, AnsweredTarget, read_answer
from garden_models.targets.config import ProposeTargets, boxes_of
from garden_models.targets.critic import Checked, apply_check
from garden_models.targets.prompts import (
    critic_prompt,
    critic_schema,
    proposal_prompt,
    proposal_schema,
)
from garden_models.targets.proposal import Query, TargetChange, TargetProposal
from garden_models.targets.repeats import without_repeats
from garden_models.targets.shown_photos import ShownPhoto, choose_photos, pictures, shown_photos
from garden_models.targets.vlm_model import AskVlm, VlmAnswer, VlmRequest


def propose_targets(
    capture: Capture, leave_out: Sequence[str], config: ProposeTargets, ask: AskVlm
) -> TargetProposal:
    """Return what the first query gives; photos in ``leave_out`` are not shown.

    Raises BadInput if it gives no target that can be used.
    """
    photos, convention = _shown(capture, leave_out, config), boxes_of(config)
    prompt = proposal_prompt(photos, config.goal, convention, config.max_targets)
    reply = ask(VlmRequest(prompt, pictures(photos), proposal_schema(convention)))
    answer = _read(reply, photos, config)
    answered, repeats = without_repeats(answer.targets)
    answered, surplus = answered[: config.max_targets], answered[config.max_targets :]
    if not answered:
        reasons = "; ".join(answer.dropped[:3]) or f"for the goal: {shortened(config.goal)}"
        raise BadInput(f"{config.model} proposed no target that can be used ({reasons})")
    targets = tuple(one.target for one in answered)
    verdict = _verdict(answer, answered, [*repeats, *_left_out(surplus, config)], reply)
    return TargetProposal(
        model=reply.model or config.model,
        goal=config.goal,
        targets=targets,
        proposed=targets,
        queries=(_query("propose", prompt, reply, photos),),
        verdict=verdict,
    )


def check_targets(
    capture: Capture,
    leave_out: Sequence[str],
    proposal: TargetProposal,
    config: ProposeTargets,
    ask: AskVlm,
) -> TargetProposal:
    """Return the proposal as the second query repairs it.

    What the first answer lacked the check can add, so what is said of it becomes a remark.
    An answer that cannot be read leaves the proposal as it is, and degrades it.
    Raises BadInput if the check leaves no target.
    """
    photos, convention = _shown(capture, leave_out, config), boxes_of(config)
    prompt = critic_prompt(photos, config.goal, convention, config.max_targets, proposal.targets)
    shown = pictures(photos, proposal.targets)
    reply = ask(VlmRequest(prompt, shown, critic_schema(convention)))
    queries = (*proposal.queries, _query("critic", prompt, reply, photos))
    try:
        answer = _read(reply, photos, config)
    except BadInput as error:
        unread = Verdict(
            "degraded", (f"the boxes were not checked (propose.attempt asks again): {error}",)
        )
        verdict = proposal.verdict.worst(unread)
        return dataclasses.replace(proposal, queries=queries, verdict=verdict)
    checked = apply_check(proposal.targets, answer)
    if not checked.targets:
        raise BadInput(f"the critic removed all targets that {config.model} proposed")
    surplus = checked.targets[config.max_targets :]
    notes = [*checked.notes, *_left_out(surplus, config)]
    remarks = Verdict("ok", proposal.verdict.reasons)
    return dataclasses.replace(
        proposal,
        targets=checked.targets[: config.max_targets],
        changes=_kept_changes(checked, surplus),
        queries=queries,
        verdict=remarks.worst(_verdict(answer, answer.targets, notes, reply)),
    )


def _shown(
    capture: Capture, leave_out: Sequence[str], config: ProposeTargets
) -> tuple[ShownPhoto, ...]:
    photos = choose_photos(capture, leave_out, config.max_photos)
    return shown_photos(photos, config.photo_side, boxes_of(config))


def _read(reply: VlmAnswer, photos: Sequence[ShownPhoto], config: ProposeTargets) -> Answer:
    try:
        return read_answer(reply.text, photos, boxes_of(config))
    except BadInput as error:
        raise BadInput(f"what {config.model} answered cannot be used: {error}") from error


def _verdict(
    answer: Answer, answered: Sequence[AnsweredTarget], notes: Sequence[str], reply: VlmAnswer
) -> Verdict:
    """Return ok with what was mended, degraded if something could not be or is missing."""
    mended = [f"{one.target.name}: {'; '.join(one.mended)}" for one in answered if one.mended]
    cut = ["the server cut the answer before its end: ask for fewer targets"] if reply.cut else []
    lost = [f"left out {reason}" for reason in answer.dropped]
    reasons = (*cut, *lost, *answer.notes, *notes, *mended)
    broken = bool(cut or lost or answer.notes)
    return Verdict("degraded" if broken else "ok", tuple(dict.fromkeys(reasons)))


def _left_out(surplus: Sequence[AnsweredTarget | Target], config: ProposeTargets) -> list[str]:
    if not surplus:
        return []
    names = [one.name if isinstance(one, Target) else one.target.name for one in surplus]
    return [f"{', '.join(names)}: beyond propose.max_targets = {config.max_targets}, left out"]


def _kept_changes(checked: Checked, surplus: Sequence[Target]) -> tuple[TargetChange, ...]:
    names = {target.name for target in surplus}
    return tuple(c for c in checked.changes if c.after is None or c.after.name not in names)


def _query(
    purpose: Literal["propose", "critic"],
    prompt: str,
    reply: VlmAnswer,
    photos: Sequence[ShownPhoto],
) -> Query:
    return Query(
        purpose=purpose,
        prompt=prompt,
        answer=reply.text,
        model=reply.model,
        photos=tuple(photo.name for photo in photos),
        input_tokens=reply.input_tokens,
        output_tokens=reply.output_tokens,
    )
