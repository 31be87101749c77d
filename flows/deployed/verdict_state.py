"""Turn a verdict into the state that Prefect shows for a flow run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from prefect.states import Completed, Failed, State

from storage.redact import redact


def verdict_state(status: str, reasons: Sequence[str], data: dict[str, Any]) -> State[Any]:
    """Return Completed for ``ok``, Completed called Degraded, else Failed, with the reasons."""
    message = redact("; ".join(reasons))
    if status == "ok":
        return Completed(message=message or None, data=data)
    if status == "degraded":
        return Completed(name="Degraded", message=message, data=data)
    return Failed(message=message or f"{status}, without a reason")
