"""Have a vision-language model propose the targets (paper, supplement). Seconds, network.

Two steps, one a query, so that a check that could not be made costs no second proposal.
They run where the run was started: that is where the key is. Neither the key nor the
server's address is part of a step's key or of its record; the model, the goal, the
questions' wording and the box convention are.
"""

from __future__ import annotations

from collections.abc import Callable

from garden_models.progress import Progress, silent
from garden_models.scene import Capture
from garden_models.targets.config import ProposeTargets, api_of, boxes_of
from garden_models.targets.proposal import TargetProposal
from garden_models.targets.vlm_model import AskVlm
from tasks.step import StepFailed, step
from tasks.vlm import ModelUnavailable, asker

_SKIP = tuple(
    f"config.{name}" for name in ("address", "key_variable", "timeout_s", "tries", "pause_s")
)


def _backend(config: ProposeTargets, **_others: object) -> str:
    """Name the model and how it is asked."""
    from garden_models.targets.prompts import PROMPTS_VERSION

    return f"{config.model} ({api_of(config)}, {boxes_of(config)}, prompts {PROMPTS_VERSION})"


@step(
    version=1,
    packages=("numpy", "opencv-python-headless"),
    backend=_backend,
    skip=_SKIP,
    retries=0,
    cores=0,
    memory_gb=0.5,
    here=True,
)
def propose_targets(
    capture: Capture,
    leave_out: tuple[str, ...],
    config: ProposeTargets,
    progress: Progress = silent,
) -> TargetProposal:
    """Return what the model proposes; the photos in ``leave_out`` are not shown."""
    from garden_models.targets.propose import propose_targets as run

    return _asked("propose_targets", config, progress, lambda a: run(capture, leave_out, config, a))


@step(
    version=1,
    packages=("numpy", "opencv-python-headless"),
    backend=_backend,
    skip=_SKIP,
    retries=0,
    cores=0,
    memory_gb=0.5,
    here=True,
)
def check_targets(
    capture: Capture,
    leave_out: tuple[str, ...],
    proposal: TargetProposal,
    config: ProposeTargets,
    progress: Progress = silent,
) -> TargetProposal:
    """Return the proposal as the model repairs it when it is shown its boxes."""
    from garden_models.targets.propose import check_targets as run

    return _asked(
        "check_targets", config, progress, lambda a: run(capture, leave_out, proposal, config, a)
    )


def _asked(
    step_name: str,
    config: ProposeTargets,
    progress: Progress,
    run: Callable[[AskVlm], TargetProposal],
) -> TargetProposal:
    """Run with the model at hand; a server that gives no answer fails the step for good."""
    try:
        return run(asker(config, progress))
    except ModelUnavailable as error:
        raise StepFailed(
            step_name, "", str(error), kind="ModelUnavailable", retryable=error.transient
        ) from None
