"""``garden benchmark classifier``: the point classifier beside what needs no training."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from flows.command import EXIT_FAILED, EXIT_OK, print_json, say
from flows.command.store_option import open_store
from storage import Store

PRESETS = ("smoke", "cpu", "paper")


def configure(name: str, parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        "captures",
        nargs="*",
        type=Path,
        metavar="FOLDER",
        help="score on captures with truth like the sample, instead of held-out pairs",
    )
    parser.add_argument("--weights", metavar="FILE", type=Path, help="a checkpoint (the shipped)")
    parser.add_argument(
        "--preset", choices=PRESETS, default="cpu", help="whose held-out pairs (cpu)"
    )
    parser.add_argument(
        "--ablation",
        action="store_true",
        help="train a network of the preset without each augmentation in turn",
    )
    parser.add_argument(
        "--speed", action="store_true", help="time a crop of 200,000 points and count operations"
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
    if options.speed:
        return _speed(options)
    if options.captures:
        return _on_sample(options, store)
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


def _on_sample(options: argparse.Namespace, store: Store) -> int:
    """Print the scores on captures with truth like ``tests/scenes/corner``."""
    from flows.benchmark.captures import table
    from flows.benchmark.classifier_on_sample import sample_rows

    rows = []
    for folder in options.captures:
        rows += sample_rows(folder, store, str(options.weights or ""))
    if options.json:
        print_json({"benchmark": "classifier", "rows": rows})
    else:
        print(table(rows))
    return EXIT_OK


def _speed(options: argparse.Namespace) -> int:
    """Print the time of one large crop beside a plain form of the network and the machine."""
    from garden_models.disentanglement.evaluation.speed import measure
    from garden_models.disentanglement.network.classify import load

    speed = measure(load(str(options.weights or "")).model)
    if options.json:
        print_json({**dataclasses.asdict(speed), "gflops": round(speed.gflops, 1)})
        return EXIT_OK
    print(
        f"{speed.points} points in {speed.seconds:.2f} s with {speed.threads} threads ("
        f"{speed.processor_s:.2f} s of processor time)\n"
        f"the network alone {speed.network_s:.2f} s, written plainly {speed.plain_s:.2f} s\n"
        f"{speed.giga_operations:.1f} billion operations, {speed.gflops:.0f} billion a second; "
        f"products of large matrices reach {speed.machine_gflops:.0f}\n"
        f"labels that differ between the two forms: {speed.most_label_changes:.4%}"
    )
    return EXIT_OK
