"""Write a call of a step as JSON that another process can obey, and read it there.

Only references go into it, never the arrays: whoever obeys reads them from the store.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from storage import Store
from tasks.step.inputs import Arguments
from tasks.step.run import RunContext
from tasks.step.wire import plain_from_json, plain_to_json, refs_from_json, refs_to_json

if TYPE_CHECKING:
    from tasks.step import Step

Order = dict[str, Any]


def write_order(context: RunContext, step: Step, arguments: Arguments, label: str) -> Order:
    """Return the call as plain JSON."""
    return {
        "module": step.fn.__module__,
        "name": step.fn.__qualname__,
        "label": label,
        "code": step.code().digest,
        "store": context.store.address,
        "durability": "full" if context.store.durable else "none",
        "verify": context.store.verify_level,
        "scene": context.scene,
        "run_id": context.run_id,
        "plain": {name: plain_to_json(value) for name, value in arguments.plain.items()},
        "refs": {name: refs_to_json(value) for name, value in arguments.refs.items()},
    }


def read_order(order: Order) -> tuple[Step, Arguments]:
    """Return the step, imported by name, and its arguments.

    Raises:
        TypeError: the order names something that is no step.
        CodeDiffers: this process has other code than the one that wrote the order.
    """
    from tasks.step import Step

    step: Any = importlib.import_module(order["module"])
    for name in order["name"].split("."):
        step = getattr(step, name)
    if not isinstance(step, Step):
        raise TypeError(f"{order['module']}.{order['name']} is no step")
    if step.code().digest != order["code"]:
        raise CodeDiffers
    hints = step.hints()
    return step, Arguments(
        {name: refs_from_json(document) for name, document in order["refs"].items()},
        {name: plain_from_json(d, hints.get(name, object)) for name, d in order["plain"].items()},
    )


def open_store(order: Order) -> Store:
    """Open the store that the order names, which is there."""
    return Store.open(
        order["store"], create=False, durability=order["durability"], verify=order["verify"]
    )


class CodeDiffers(RuntimeError):
    """The code that would compute is not the code that was asked for."""

    def __init__(self) -> None:
        super().__init__("the code was changed while the run was going on: start it again")
