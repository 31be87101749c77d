"""A store that knows a whole scene, with chosen seconds and without any work."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np
from PIL import Image

from flows.preset import Preset
from flows.scene_request import SceneOptions, read_scene
from flows.scene_run import SceneRequest, package_key, plan_scene
from garden_models.scene import Target
from storage import ActionRecord, Output, Store
from storage.formats.package import write_package
from tasks.step import PlanEntry

TARGETS = tuple(Target(name, "a.jpg", (1.0, 1.0, 30.0, 30.0)) for name in ("mug", "jar"))


@dataclass(frozen=True)
class Tiny:
    SCHEMA: ClassVar[str] = "test.Tiny/1"
    text: str


@dataclass(frozen=True)
class Cost:
    """What a record says a step took: when it started, after which wait, and its parts."""

    started: float
    load: float = 0.5
    compute: float = 2.0
    publish: float = 0.25
    wait: float = 0.125
    peak_mb: float = 100.0
    run_id: str = "run"
    host: str = "elsewhere"


@dataclass
class Clock:
    """Give each step a cost: by default one after the other, with round numbers."""

    costs: dict[str, Cost] = field(default_factory=dict)
    now: float = 1_000_000.0

    def __call__(self, entry: PlanEntry) -> Cost:
        self.now += 10.0
        name = f"{entry.step}[{entry.label}]" if entry.label else entry.step
        return self.costs.setdefault(name, Cost(self.now))


def capture(folder: Path) -> Path:
    """Make a folder of three small photos."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(list(folder.name.encode()))  # no two scenes share a photo
    for name in ("a.jpg", "b.jpg", "c.jpg"):
        pixels = rng.integers(0, 256, (40, 60, 3)).astype(np.uint8)
        Image.fromarray(pixels).save(folder / name)
    return folder


def request(
    tmp_path: Path, name: str = "desk", targets: tuple[Target, ...] = TARGETS
) -> SceneRequest:
    """Return the request of a scene of its own."""
    place = tmp_path / "captures" / name
    photos = place if place.exists() else capture(place)
    preset = Preset()
    return read_scene(SceneOptions(photos, tmp_path / "scenes", preset, targets=targets))


def fill(
    store: Store,
    wanted: SceneRequest,
    cost: Callable[[PlanEntry], Cost],
    leave_out: tuple[str, ...] = (),
) -> None:
    """Record every step of the scene but those left out, and what would need them."""
    while True:
        _result, plan = plan_scene(wanted, store)
        open_now = [
            e for e in plan if e.action == "would run" and e.ref.key and e.step not in leave_out
        ]
        if not open_now:
            return
        for entry in open_now:
            _record(store, wanted.name, entry, cost(entry))


def pack(store: Store, wanted: SceneRequest, report: bytes | None = None) -> None:
    """Write a package that is up to date with the store."""
    result, _plan = plan_scene(wanted, store)
    said = report or json.dumps({"scene": wanted.name}).encode()
    files = {"report.json": said, "report.html": b"<html></html>"}
    write_package(wanted.package, files, package_key(result))


def _record(store: Store, scene: str, entry: PlanEntry, cost: Cost) -> None:
    made = store.publish(Tiny(f"{scene} {entry.step} {entry.label}"))
    store.record(
        ActionRecord(
            key=entry.ref.key,
            step=entry.step,
            scene=scene,
            label=entry.label,
            outputs={"value": Output(made.object, made.content, made.kind, made.bytes)},
            verdict={"status": "ok", "reasons": []},
            seconds={
                "load": cost.load,
                "compute": cost.compute,
                "publish": cost.publish,
                "wait": cost.wait,
            },
            peak_mb=cost.peak_mb,
            started=cost.started,
            parts={},
            backend="embedded",
            host=cost.host,
            run_id=cost.run_id,
        )
    )
