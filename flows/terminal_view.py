"""Show a running scene in the terminal: steps, targets, what is running, and the time.

On a terminal one live table is redrawn; elsewhere (a pipe, a log) each finished step is
one line. Everything goes to standard error, so that standard output stays for results.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field
from types import TracebackType
from typing import Self

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from tasks.step import StepEvent

MARKS = {"executed": "✓", "cached": "=", "failed": "✗"}
COLOURS = {"ok": "green", "degraded": "yellow", "failed": "red"}


@dataclass
class _Row:
    step: str
    label: str
    started: float
    share: float = 0.0
    doing: str = ""
    finished: StepEvent | None = None


@dataclass
class TerminalView:
    """A sink for step events that draws them; use it as a context manager."""

    title: str
    console: Console = field(default_factory=lambda: Console(stderr=True))
    _rows: dict[tuple[str, str], _Row] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _started: float = field(default_factory=time.monotonic)
    _live: Live | None = None

    def __enter__(self) -> Self:
        """Start drawing."""
        if self.console.is_terminal:
            self._live = Live(get_renderable=self._draw, console=self.console, refresh_per_second=4)
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop drawing; the last state stays on the screen."""
        if self._live is not None:
            self._live.stop()

    def __call__(self, event: StepEvent) -> None:
        """Take one event, from any thread."""
        key = (event.step, event.label or "")
        with self._lock:
            row = self._rows.setdefault(key, _Row(*key, started=time.monotonic()))
            if event.kind == "progress":
                row.share, row.doing = event.share or 0.0, event.doing
            elif event.kind == "finished":
                row.finished = event
                if self._live is None:
                    self.console.print(_line(row), highlight=False, soft_wrap=True)

    def _draw(self) -> Group:
        table = Table.grid(padding=(0, 2))
        for width in (2, 26, 26, 9):
            table.add_column(min_width=width)
        table.add_column(ratio=1)
        with self._lock:
            for row in self._rows.values():
                table.add_row(*_cells(row))
        elapsed = time.monotonic() - self._started
        return Group(Text(f"{self.title}   {elapsed:.0f} s", style="bold"), table)


def _name(row: _Row) -> str:
    return f"{row.step}[{row.label}]" if row.label else row.step


def _cells(row: _Row) -> tuple[Text | ProgressBar, ...]:
    event = row.finished
    if event is None:
        elapsed = time.monotonic() - row.started
        bar = ProgressBar(total=1.0, completed=row.share, width=24)
        return Text("▸", "cyan"), Text(_name(row)), bar, Text(f"{elapsed:.1f} s"), Text(row.doing)
    colour = "red" if event.outcome == "failed" else COLOURS.get(event.status or "ok", "green")
    return (
        Text(MARKS.get(event.outcome or "", " "), colour),
        Text(_name(row)),
        Text(event.outcome or "", colour),
        Text(f"{event.seconds.total:.1f} s" if event.outcome != "cached" else ""),
        Text(_remark(event), "dim"),
    )


def _line(row: _Row) -> Text:
    event = row.finished
    assert event is not None
    mark = MARKS.get(event.outcome or "", " ")
    seconds = "" if event.outcome == "cached" else f"{event.seconds.total:6.1f} s"
    return Text(f"{mark} {_name(row):<28} {event.outcome:<9} {seconds:>9}  {_remark(event)}")


def _remark(event: StepEvent) -> str:
    if event.error:
        return event.error
    if event.reasons and event.status != "ok":
        return f"{event.status}: {event.reasons[0]}"
    # What a step that went well remarks is for the user too: it changed or assumed something.
    why = (event.why.sentence,) if event.why else ()
    return "; ".join((*why, *event.reasons))
