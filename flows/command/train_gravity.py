"""``garden train gravity``: train the Gravity-View decoder, with its record."""

from __future__ import annotations

import argparse
from pathlib import Path

from flows.command import EXIT_FAILED, EXIT_OK, print_json, say
from flows.command.store_option import open_store


def train_gravity(options: argparse.Namespace) -> int:
    """Run the command; return the exit code."""
    from flows.benchmark.captures import table
    from flows.terminal_view import TerminalView
    from flows.training.gravity_command import decoder_preset, train_and_score
    from flows.training.gravity_record import score_rows
    from flows.training.gravity_tokens import token_data
    from tasks.step import StepFailed

    preset = decoder_preset(options.preset, options.seed, options.device)
    tokens = None
    if options.backbone is not None:
        tokens = token_data(options.backbone, options.data, preset.optimisation.device)
    folder = options.out or Path("trained") / f"gravity-{preset.name}"
    try:
        with TerminalView(f"garden train gravity --preset {preset.name}") as view:
            record, scores = train_and_score(
                preset, tokens, folder, open_store(options), view, options.engine
            )
    except StepFailed as failure:
        say(f"garden: {failure}")
        return EXIT_FAILED
    if options.json:
        print_json(record)
    else:
        for setting, rows in scores.items():
            print(f"{setting}\n{table(score_rows(rows))}\n")
    say(f"{folder}: {record['checkpoint']['bytes']} bytes, digest {record['checkpoint']['digest']}")
    return EXIT_OK
