"""Make inputs again that another process found damaged or gone when it wanted to read them.

The other process has put a damaged object into quarantine, but only the run knows by which
steps the inputs were made.
"""

from __future__ import annotations

from storage import CorruptArtifact, MissingArtifact
from tasks.step.inputs import Arguments, each
from tasks.step.ref import Ref
from tasks.step.run import RunContext


def make_again(context: RunContext, arguments: Arguments) -> bool:
    """Make what is lost among the arguments with the steps that made it in this run.

    False if nothing is lost, a maker is unknown, or something came out different.

    Raises:
        StepFailed: a maker failed.
    """
    refs = [ref for value in arguments.refs.values() for ref in each(value)]
    lost = [ref for ref in refs if _is_lost(context, ref)]
    if not lost or any(ref.object not in context.producers for ref in lost):
        return False
    return all(context.producers[ref.object]("corrupt").content == ref.content for ref in lost)


def _is_lost(context: RunContext, ref: Ref) -> bool:
    try:
        context.store.manifest(ref.object)
    except (CorruptArtifact, MissingArtifact):
        return True
    return False
