"""Kill a whole batch at random moments: what was published is never computed again, and the
end is that of a batch that nobody disturbed.

    python -m tests.faults.batch_kills SETTING.json      # runs one batch, to be killed
"""

from __future__ import annotations

import dataclasses
import json
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from flows.benchmark.orchestration.simulated_job import simulated_orders
from flows.collection.definition import Collection
from flows.collection.job import JobOrder
from flows.collection.run import Options, RowEvent, run_jobs
from flows.collection.scene_job import scene_order
from flows.preset import read_preset
from flows.scene_request import SceneOptions, read_scene
from garden_models.targets.boxes import parse_targets
from storage import Store
from tests.faults.part import Count, part

CORNER = Path(__file__).parents[1] / "scenes" / "corner"
SMALL = ["ingest.max_size=640", "reconstruct.long_side=256"]
LONGEST_S = 1800.0

Contents = dict[tuple[str, str, str], str]
"""The content digest of each scene's step and target."""


@dataclass(frozen=True)
class Setting:
    """One batch: where it works and what it runs."""

    store: str
    out: str
    trace: str
    scenes: Literal["simulated", "real"]
    engine: Literal["prefect", "local"]
    count: int


def orders(setting: Setting) -> list[JobOrder]:
    """Return the scenes: simulated ones, or the sample capture with one object each."""
    if setting.scenes == "simulated":
        return simulated_orders(setting.count, objects=5)
    document = json.loads((CORNER / "targets.json").read_text())
    preset = read_preset("embedded", SMALL)
    return [
        scene_order(
            read_scene(
                SceneOptions(CORNER, Path(setting.out), preset, target.name, targets=(target,))
            )
        )
        for target in parse_targets(document)[: setting.count]
    ]


def run_batch(setting: Setting) -> None:
    """Run the batch in this process; every step that is computed is a line of the trace."""
    with Path(setting.trace).open("a", buffering=1) as trace:

        def note(event: RowEvent) -> None:
            for running in event.row.running:
                trace.write(json.dumps([event.row.name, running.step, running.target]) + "\n")

        collection = Collection("night", (), Path(setting.out), "kills")
        result = run_jobs(collection, orders(setting), setting.store, Options(setting.engine), note)
    failed = [(row.name, row.reasons) for row in result.rows if row.status == "failed"]
    if failed:
        raise SystemExit(f"failed: {failed}")


def kill_a_batch(
    folder: Path, setting: Setting, kills: int, seed: int
) -> tuple[Count, Count, Count]:
    """Kill one batch so many times, each time going on; compare with one left alone."""
    alone = dataclasses.replace(
        setting,
        store=str(folder / "alone"),
        out=str(folder / "alone-out"),
        trace=str(folder / "alone.trace"),
    )
    started = time.monotonic()
    _start(folder, alone).wait(LONGEST_S)
    whole_s = time.monotonic() - started
    rng = random.Random(seed)
    repeated: list[str] = []
    broken: list[str] = []
    for trial in range(kills + 1):
        published = set(contents(setting.store)) if trial else set()
        Path(setting.trace).unlink(missing_ok=True)
        process = _start(folder, setting)
        if trial < kills:
            # Most of the way is done after a few: later ones die while they find results.
            _kill_after(process, rng.uniform(0.05, 0.5) * whole_s)
        elif process.wait(LONGEST_S) != 0:
            broken.append(f"the last run ended with {process.returncode}")
        repeated += [f"kill {trial}: {name}" for name in _traced(setting) if name in published]
        broken += [f"kill {trial}: {p}" for p in Store.open(setting.store).verify("full")]
    name = f"{setting.scenes} batch, {setting.engine}"
    differ = _differences(contents(alone.store), contents(setting.store))
    return (
        Count(f"{name}: killed, whole store sound", kills, tuple(broken)),
        Count(f"{name}: published steps not repeated", kills, tuple(repeated)),
        Count(f"{name}: results as undisturbed", len(contents(alone.store)), tuple(differ)),
    )


def contents(store: str) -> Contents:
    """Return what stands in a store, by scene, step and target."""
    return {
        (record.scene, record.step, record.label): record.outputs["value"].content
        for record in Store.open(store).actions()
    }


def _differences(alone: Contents, killed: Contents) -> Iterable[str]:
    """Compare by step and content: which of two scenes computed what they share may differ."""
    results = {(step, label, content) for (_scene, step, label), content in killed.items()}
    for (scene, step, label), content in alone.items():
        if (step, label, content) not in results:
            yield f"{scene} {step} {label}: not {content[:15]}"


def _start(folder: Path, setting: Setting) -> subprocess.Popen[bytes]:
    order = folder / "setting.json"
    order.write_text(json.dumps(dataclasses.asdict(setting)))
    command = [sys.executable, "-m", "tests.faults.batch_kills", str(order)]
    with (folder / "output.txt").open("ab") as printed:
        return subprocess.Popen(
            command, stdout=printed, stderr=subprocess.STDOUT, cwd=Path(__file__).parents[2]
        )


def _kill_after(process: subprocess.Popen[bytes], seconds: float) -> None:
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _traced(setting: Setting) -> set[tuple[str, str, str]]:
    trace = Path(setting.trace)
    lines = trace.read_text().splitlines() if trace.exists() else []
    whole = [line for line in lines if line.endswith("]")]  # the last one may be cut
    return {(scene, step, target or "") for scene, step, target in map(json.loads, whole)}


def _fresh(folder: Path, name: str, **values: object) -> tuple[Path, Setting]:
    place = folder / name
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    paths = {key: str(place / key) for key in ("store", "out", "trace")}
    return place, Setting(**paths, **values)  # type: ignore[arg-type]


@part("batch kills")
def batch_kills(folder: Path) -> Iterable[Count]:
    """Twenty kills of simulated scenes, twenty of real ones, five under Prefect."""
    place, setting = _fresh(folder, "simulated", scenes="simulated", engine="local", count=60)
    yield from kill_a_batch(place, setting, kills=20, seed=1)
    place, setting = _fresh(folder, "prefect", scenes="simulated", engine="prefect", count=20)
    yield from kill_a_batch(place, setting, kills=5, seed=2)
    place, setting = _fresh(folder, "real", scenes="real", engine="local", count=3)
    yield from kill_a_batch(place, setting, kills=20, seed=3)


if __name__ == "__main__":
    run_batch(Setting(**json.loads(Path(sys.argv[1]).read_text())))
