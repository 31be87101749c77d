"""Turn a typed function from nouns to nouns into a cached, timed, explained step.

    @step(version=1)
    def align_gravity(reconstruction: Reconstruction, config: AlignGravity) -> GravityView:
        ...

    with run_context(RunContext(store=Store.open("store"), scene="kitchen")):
        ref = align_gravity(reconstruction_ref, AlignGravity())

Inside a run a step takes references (``Ref``) for nouns and gives a reference back; the
shell looks the action up, loads, computes, publishes and records. ``align_gravity.fn`` is
the pure function.
"""

from tasks.step.budget import Budget, Need
from tasks.step.decorator import Step, StepSpec, step
from tasks.step.ref import (
    Cancelled,
    PendingValue,
    PlanEntry,
    Postponed,
    Ref,
    Seconds,
    StepEvent,
    StepFailed,
    Why,
    step_name,
)
from tasks.step.run import RunContext, current_run, load, run_context, step_scratch
from tasks.step.start_child import SpareChild
from tasks.step.submit import fan_out

__all__ = [
    "Budget",
    "Cancelled",
    "Need",
    "PendingValue",
    "PlanEntry",
    "Postponed",
    "Ref",
    "RunContext",
    "Seconds",
    "SpareChild",
    "Step",
    "StepEvent",
    "StepFailed",
    "StepSpec",
    "Why",
    "current_run",
    "fan_out",
    "load",
    "run_context",
    "step",
    "step_name",
    "step_scratch",
]
