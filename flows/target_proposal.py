"""Have targets proposed where none were given: by a language model, or by their names."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from concurrent.futures import Future, wait
from contextlib import contextmanager
from typing import Any, cast

from flows.preset import Preset
from garden_models.scene import BadInput, SparseModel, Target
from garden_models.targets.config import ProposeTargets, check_grounding, check_proposing
from garden_models.targets.proposal import TargetProposal
from tasks.ground_targets import ground_targets
from tasks.model.weights import weight_files
from tasks.propose_targets import check_targets, propose_targets
from tasks.step import PlanEntry, Ref, load
from tasks.vlm.server import server_of


def proposes(preset: Preset) -> bool:
    """Tell whether a preset names who proposes targets."""
    return bool(preset.propose.model or preset.ground.model)


def check_proposal(preset: Preset) -> None:
    """Raise BadInput if the preset's options of proposing do not go together."""
    if preset.propose.model and preset.ground.model:
        raise BadInput(
            f"targets come either from {preset.propose.model} or from {preset.ground.model}: "
            "leave out propose.model or ground.model"
        )
    if preset.propose.model:
        check_proposing(preset.propose)
    if preset.ground.model:
        check_grounding(preset.ground)


def check_askable(plan: list[PlanEntry], preset: Preset) -> None:
    """Raise BadInput if a model would be asked whose key or weights are missing."""
    steps = {entry.step for entry in plan if entry.action == "would run"}
    if steps & {propose_targets.name, check_targets.name}:
        server_of(preset.propose)
    if ground_targets.name in steps:
        weight_files(preset.ground.model)


def without_proposal(preset: Preset) -> Preset:
    """Return the preset with nobody asked to propose."""
    if not proposes(preset):
        return preset
    return dataclasses.replace(
        preset,
        propose=dataclasses.replace(preset.propose, model=""),
        ground=dataclasses.replace(preset.ground, model=""),
    )


@contextmanager
def looking_for_targets(
    capture: Ref, cameras: Ref, preset: Preset
) -> Iterator[Callable[[], Ref | None]]:
    """Look for targets in the registered photos while what stands inside goes on.

    Gives what waits for the proposal; it gives None if nobody is asked. A language model is
    asked at once, its server computes; a detector only when it is waited for, since it takes
    this machine. An answer that is on its way is kept also if what goes on fails.
    """
    if preset.ground.model:
        yield lambda: ground_targets(capture, _unregistered(cameras), preset.ground)
        return
    if not preset.propose.model:
        yield lambda: None
        return
    asked = _ask(capture, _unregistered(cameras), preset.propose)
    try:
        yield asked.result
    except Exception:
        wait([asked])
        raise


def _ask(capture: Ref, leave_out: Any, config: ProposeTargets) -> Future[Ref]:
    proposal = propose_targets.submit(capture, leave_out, config)
    if not config.critic:
        return proposal
    return check_targets.submit(capture, leave_out, proposal, config)


def _unregistered(cameras: Ref) -> Any:
    """Return the photos not to look at; in a plan that does not know them, what tells them."""
    if cameras.pending:
        return cameras
    return load(cameras, SparseModel, fields=("unregistered",))["unregistered"]


def targets_of(proposal: Ref) -> tuple[tuple[Target, ...], tuple[Target, ...]]:
    """Return the targets to work on, and those that are known.

    They are the same but in a plan in which the proposal would run first: there the pending
    reference stands for all targets, so that what follows is planned to run after it.
    """
    if proposal.pending:
        return (cast(Target, proposal),), ()
    targets: tuple[Target, ...] = load(proposal, TargetProposal).targets
    return targets, targets
