"""``garden plan``: tell what would run and why, from the store alone."""

from __future__ import annotations

import argparse

from flows.command import EXIT_OK, print_json
from flows.command.scene_options import add_scene_options, scene_request
from flows.command.store_option import open_store
from flows.scene_run import is_finished, plan_scene


def configure(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.description = "Tell which steps factorize would run, and why. Executes nothing."
    add_scene_options(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit code."""
    request = scene_request(options)
    result, plan = plan_scene(request, open_store(options))
    finished = is_finished(plan, result)
    if options.json:
        print_json(
            {
                "scene": request.name,
                "finished": finished,
                "steps": [
                    {
                        "step": entry.step,
                        "target": entry.label or None,
                        "action": entry.action,
                        "why": entry.why.sentence,
                        "why_code": entry.why.code,
                    }
                    for entry in plan
                ],
            }
        )
        return EXIT_OK
    for entry in plan:
        name = f"{entry.step}[{entry.label}]" if entry.label else entry.step
        print(f"{entry.action:<10} {name:<30} {entry.why.sentence}")
    if finished:
        print(f"nothing to do: {request.package} is up to date")
    return EXIT_OK
