"""``garden status``: tell how a collection stands, also while it runs elsewhere."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from flows.collection.overview import (
    counts,
    model_lines,
    running_line,
    scene_line,
    seconds_left,
    summary,
)
from flows.collection.row import WORST_FIRST, worst_status
from flows.collection.state import STATE, CollectionState, read_state
from flows.command import EXIT_OK, print_json
from flows.wrong_use import WrongUse

DESCRIPTION = """\
Tell how a collection stands: what runs and how far it is, what failed and why, and about
how long it takes still. Give the folder its packages go to, or the collection itself."""

WATCH_EVERY_S = 2.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.description = DESCRIPTION
    parser.add_argument(
        "place",
        nargs="?",
        type=Path,
        default=Path("scenes"),
        metavar="OUT|COLLECTION",
        help="the collection's packages, file or folder (default: scenes)",
    )
    parser.add_argument("--watch", action="store_true", help="tell again until it has ended")


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit code."""
    out = _out(options.place)
    state = _read(out)
    if options.watch:
        _watch(out)
        state = _read(out)
    if options.json:
        print_json(_document(state))
    elif not options.watch:
        print("\n".join(_lines(state)))
    return EXIT_OK


def _out(place: Path) -> Path:
    """Return the folder that holds the state."""
    from flows.collection.definition import SCENES

    if (place / STATE).is_file():
        return place
    if place.is_file():
        from flows.collection.collection_file import read_file

        return read_file(place, None, None).out
    state = read_state(SCENES) if place.is_dir() else None
    is_its = state is not None and Path(state.source).resolve() == place.resolve()
    return SCENES if is_its else place


def _read(out: Path) -> CollectionState:
    state = read_state(out)
    if state is None:
        raise WrongUse(f"there is no {out / STATE}: give the folder that `garden batch` writes to")
    return state


def _document(state: CollectionState) -> dict[str, Any]:
    left = seconds_left(state)
    return {
        **state.to_json(),
        "alive": state.phase == "running",
        "status": worst_status(state.rows.values()),
        "counts": counts(state),
        "seconds_left": None if left is None else round(left, 1),
    }


def _lines(state: CollectionState) -> list[str]:
    """Return the worst first, then what runs, then the whole in one line."""
    rows = sorted(state.rows.values(), key=lambda row: (WORST_FIRST.index(row.status), row.name))
    lines = [scene_line(row) for row in rows if row.status not in ("running", "waiting")]
    lines += [running_line(row) for row in rows if row.status == "running"]
    if state.phase == "running" and state.owner is not None:
        age = time.time() - state.updated
        lines.append(
            f"process {state.owner.pid} on {state.owner.host}, last heard of {age:.0f} s ago"
        )
    return [*lines, *model_lines(state), summary(state)]


def _watch(out: Path) -> None:
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    def draw() -> Text:
        return Text("\n".join(_lines(_read(out))))

    console = Console(stderr=True)
    if not console.is_terminal:
        while True:
            console.print(draw(), highlight=False, soft_wrap=True)
            if _read(out).phase != "running":
                return
            time.sleep(WATCH_EVERY_S)
    with Live(get_renderable=draw, console=console, refresh_per_second=1 / WATCH_EVERY_S):
        while _read(out).phase == "running":
            time.sleep(WATCH_EVERY_S)
