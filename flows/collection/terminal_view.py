"""Show a running batch in the terminal: a line for every scene that ends, and what runs.

On a terminal the running scenes are redrawn below the lines; elsewhere there are only the
lines. Everything goes to standard error.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from flows.collection.overview import running_line, scene_line, summary
from flows.collection.run import RowEvent
from flows.collection.state import CollectionState, read_state

COLOURS = {"ok": "green", "degraded": "yellow", "failed": "red"}


@dataclass
class BatchView:
    """A sink for a batch's events; use it as a context manager."""

    out: Path
    console: Console = field(default_factory=lambda: Console(stderr=True))
    _live: Live | None = None

    def __enter__(self) -> Self:
        """Start drawing."""
        if self.console.is_terminal:
            self._live = Live(
                get_renderable=lambda: draw(read_state(self.out)),
                console=self.console,
                refresh_per_second=2,
                transient=True,
            )
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop drawing."""
        if self._live is not None:
            self._live.stop()

    def __call__(self, event: RowEvent) -> None:
        """Take one event."""
        if event.kind == "finished":
            line = Text(scene_line(event.row), COLOURS.get(event.row.status, ""))
            self.console.print(line, highlight=False, soft_wrap=True)


def draw(state: CollectionState | None) -> Group:
    """Return the lines on what runs, and one on the whole."""
    if state is None:
        return Group()
    running = [row for row in state.rows.values() if row.status == "running"]
    lines = [Text(running_line(row), "cyan", no_wrap=True, overflow="ellipsis") for row in running]
    return Group(*lines, Text(summary(state), "bold"))
