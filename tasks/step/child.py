"""Compute one isolated step: ``python -m tasks.step.child PIPE PARENT``.

The order is a JSON line on standard input (``tasks.step.isolate``), which may come long after the
start, or never; answers are JSON lines on descriptor ``PIPE``. What libraries print goes to
the standard streams and never into the answers.
"""

from __future__ import annotations

import dataclasses
import json
import os
import sys
import traceback
from typing import Any

from tasks.parent_process import Answers, die_with


def main() -> None:
    """Do what the order says."""
    descriptor, parent = int(sys.argv[1]), int(sys.argv[2])
    die_with(parent)
    os.set_inheritable(descriptor, False)
    answers = Answers(descriptor)
    try:
        import_ahead()
        order = sys.stdin.readline()
        if not order:
            return
        leave_input()
        answers.send({"done": obey(json.loads(order), answers)})
    except Exception as error:
        answers.send({"error": describe(error)})
        raise SystemExit(1) from error


def import_ahead() -> None:
    """Import what every order needs, while there is none yet."""
    import tasks.step.compute
    import tasks.step.order  # noqa: F401
    from storage.codec.ahead import import_codec

    import_codec()


def leave_input() -> None:
    """Have libraries that read from standard input find nothing there."""
    with open(os.devnull) as nothing:  # noqa: PTH123
        os.dup2(nothing.fileno(), sys.stdin.fileno())


def obey(order: dict[str, Any], answers: Answers) -> dict[str, Any]:
    """Compute and publish; return the parts of ``Done`` as JSON."""
    sys.path[:] = order["path"]
    if order["gpus"]:
        os.environ["CUDA_VISIBLE_DEVICES"] = ",".join(order["gpus"])
    from tasks.step.compute import compute
    from tasks.step.order import open_store, read_order
    from tasks.step.run import RunContext, run_context

    step, arguments = read_order(order)
    store = open_store(order)
    context = RunContext(store, order["scene"], run_id=order["run_id"], isolate=False)
    with run_context(context):
        done = compute(context, step, arguments, answers.progress, answers.waiting)
    return dataclasses.asdict(done)


def describe(error: Exception) -> dict[str, Any]:
    """Return an error as JSON."""
    from storage.redact import redact

    described: dict[str, Any] = {
        "kind": type(error).__name__,
        "message": redact(str(error)),
        "traceback": redact("".join(traceback.format_exception(error))),
    }
    if isinstance(error, OSError) and error.errno is not None:
        described |= {"errno": error.errno, "message": redact(error.strerror or str(error))}
    for name, attribute in (("object", "object_digest"), ("reason", "reason")):
        if hasattr(error, attribute):
            described[name] = getattr(error, attribute)
    return described


if __name__ == "__main__":
    main()
