"""Write the record of a gravity decoder's training: what went in, how it went, what came out."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flows.training.gravity import TrainedDecoder
from flows.training.hardware import hardware, hours
from flows.training.pages import facts, loss_chart, page, section, table
from flows.training.run import write_whole
from garden_models.gravity.training.calibrated import Calibrated
from garden_models.metrics.gravity import MethodErrors
from garden_models.training.state import TrainingState
from tasks.step import load

CHECKPOINT, RECORD, PAGE = "gravity_decoder.safetensors", "record.json", "record.html"
SHARES = (0.5, 0.68, 0.9, 0.95)

Scores = dict[str, tuple[MethodErrors, ...]]


def write_record(
    folder: Path, trained: TrainedDecoder, checkpoint: bytes, scores: Scores
) -> dict[str, Any]:
    """Write checkpoint, ``record.json`` and ``record.html``; return the record."""
    from garden_models.training.weights_file import weights_digest

    state: TrainingState = load(trained.state, TrainingState)
    known = None if trained.calibrated is None else load(trained.calibrated, Calibrated)
    record = {
        "schema": "garden.training-record/1",
        "checkpoint": {
            "file": CHECKPOINT,
            "digest": weights_digest(checkpoint),
            "bytes": len(checkpoint),
        },
        "preset": dataclasses.asdict(trained.preset),
        "seed": trained.preset.optimisation.seed,
        "data": {
            "train": [ref.content for ref in trained.data],
            "validation": [ref.content for ref in trained.validation],
        },
        "hardware": hardware(),
        "hours": hours((*trained.data, *trained.validation), trained.states),
        "steps": state.step,
        "last_loss": round(float(np.mean(state.losses[-50:])), 6) if state.step else None,
        "calibration": None if known is None else coverage_rows(known),
        "scores": {setting: score_rows(rows) for setting, rows in scores.items()},
    }
    write_whole(folder / CHECKPOINT, checkpoint)
    write_whole(folder / RECORD, json.dumps(record, indent=1).encode())
    write_whole(folder / PAGE, _page(record, state, known).encode())
    return record


def score_rows(scored: Sequence[MethodErrors]) -> list[dict[str, Any]]:
    """Return the paper's gravity table: one row a method, degrees and shares."""
    return [
        {
            "method": row.method,
            "mean deg": round(row.mean_deg, 2),
            "P90 deg": round(row.p90_deg, 2),
            "fail@10 %": round(100 * row.failure_rate(), 1),
            "error/sigma": round(row.calibration, 2),
            "scenes": len(row.scenes),
        }
        for row in scored
    ]


def coverage_rows(known: Calibrated) -> list[dict[str, Any]]:
    """Return how many validation errors lie within the radii that should hold a share."""
    from garden_models.gravity.decoder.uncertainty import coverage

    sigma = np.array([known.calibration.sigma(float(c)) for c in known.claimed_rad])
    return [
        {"should hold": share, "holds": round(coverage(sigma, known.error_rad, share), 3)}
        for share in SHARES
    ]


def _page(record: dict[str, Any], state: TrainingState, known: Calibrated | None) -> str:
    preset = record["preset"]
    parts = [
        facts(
            {
                "steps": record["steps"],
                "tokens a batch": preset["optimisation"]["tokens_a_batch"],
                "hours": record["hours"]["total"],
                "threads": preset["optimisation"]["threads"],
                "machine": record["hardware"]["gpu"] or record["hardware"]["processor"],
                "checkpoint": f"{record['checkpoint']['bytes'] / 1e6:.2f} MB",
            }
        ),
        section("Loss", loss_chart(state.losses)),
    ]
    parts += [
        section(f"Test scenes, {name}", table(rows)) for name, rows in record["scores"].items()
    ]
    if known is not None:
        error = np.degrees(known.error_rad)
        parts.append(
            section(
                "Validation scenes",
                facts(
                    {
                        "mean error": f"{error.mean():.2f} deg",
                        "median": f"{np.median(error):.2f} deg",
                        "P90": f"{np.quantile(error, 0.9):.2f} deg",
                        "above 10 deg": f"{(error > 10).mean():.1%}",
                        "spoilt": f"{known.calibration.spoilt:.1%}",
                    }
                ),
                table(record["calibration"]),
            )
        )
    parts.append(section("Record", f"<pre>{json.dumps(record, indent=1)}</pre>"))
    return page(f"Gravity decoder, preset {preset['name']}", parts)
