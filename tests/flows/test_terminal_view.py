"""The terminal's lines: what a step that went well remarks is shown, not only its failures."""

from __future__ import annotations

import io

from rich.console import Console

from flows.terminal_view import TerminalView
from tasks.step import StepEvent


def line_of(event: StepEvent) -> str:
    text = io.StringIO()
    with TerminalView("scene", Console(file=text, width=200)) as view:
        view(event)
    return text.getvalue()


def test_remarks_and_reasons_are_shown() -> None:
    remark = "the given focal length 585 px disagrees with the photos; 505 px used"
    done = StepEvent("finished", "register", "", "room", 0.0, outcome="executed", reasons=(remark,))
    assert remark in line_of(done)
    cached = StepEvent("finished", "register", "", "room", 0.0, outcome="cached", reasons=(remark,))
    assert remark in line_of(cached)
    degraded = StepEvent(
        "finished", "mesh_object", "mug", "room", 0.0, outcome="executed",
        status="degraded", reasons=("half of it was not seen",),
    )  # fmt: skip
    assert "degraded: half of it was not seen" in line_of(degraded)
