"""``garden benchmark classifier``: the point classifier beside what needs no training."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from flows.command import EXIT_FAILED, EXIT_OK, print_json, say
from flows.command.store_option import open_store

PRESETS = ("smoke", "cpu", "paper")


def configure(name: str, parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("--weights", metavar="FILE", type=Path, help="a checkpoint (the shipped)")
    parser.add_argument(
        "--preset", choices=PRESETS, default="cpu", help="whose held-out pairs (cpu)"
    )
    parser.add_argument(
        "--ablation",
        action="store_true",
        help="train a network of the preset without each augmentation in turn",
    )


def run(options: argparse.Namespace) -> int:
    """Print the supplement's table and what it leaves out; return the exit code."""
    from flows.benchmark.captures import table
    from flows.terminal_view import TerminalView
    from flows.training.command import classifier_preset, score_ablations, score_checkpoint
    from flows.training.record import range_rows, score_rows
    from garden_models.disentanglement.network.shipped import checkpoint_file
    from tasks.step import StepFailed

    store = open_store(options)
    preset = classifier_preset(options.preset)
    path = options.weights or checkpoint_file()
    try:
        with TerminalView("garden benchmark classifier") as view:
            if options.ablation:
                rows = score_ablations(preset, store, view)
                scores = {}
            else:
                data = None if path is None else path.read_bytes()
                scores = score_checkpoint(preset, data, store, view)
                rows = score_rows(scores)
    except StepFailed as failure:
        say(f"garden: {failure}")
        return EXIT_FAILED
    if path is None and not options.ablation:
        say("no checkpoint is shipped and none was given (--weights): baselines only")
    if options.json:
        document = {setting: dataclasses.asdict(s) for setting, s in scores.items()}
        print_json({"benchmark": "classifier", "rows": rows, "scores": document})
        return EXIT_OK
    print(table(rows))
    for title, name in (("height above the support", "by_height"), ("object size", "by_size")):
        if scores:
            print(f"\nF1 by {title}")
            print(table(range_rows(scores, name)))
    return EXIT_OK
