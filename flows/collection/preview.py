"""Tell what a batch would run, and why, from the store alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from flows.collection.definition import Collection
from flows.scene_run import SceneRequest, is_finished, plan_scene
from storage import Store
from tasks.step import PlanEntry, step_name


@dataclass(frozen=True)
class ScenePreview:
    """What would run for one scene; ``reason`` is that of one that cannot run."""

    name: str
    finished: bool
    plan: tuple[PlanEntry, ...] = ()
    reason: str = ""

    @property
    def to_run(self) -> tuple[PlanEntry, ...]:
        """The steps that would run."""
        return tuple(entry for entry in self.plan if entry.action == "would run")

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON."""
        return {
            "name": self.name,
            "finished": self.finished,
            "reason": self.reason,
            "would_run": len(self.to_run),
            "cached": len(self.plan) - len(self.to_run),
            "steps": [
                {
                    "step": entry.step,
                    "target": entry.label or None,
                    "why": entry.why.sentence,
                    "why_code": entry.why.code,
                }
                for entry in self.to_run
            ],
        }

    def line(self) -> str:
        """Return one line: how many steps, and the reasons of those that come first."""
        if self.reason:
            return f"{self.name:<24} cannot run: {self.reason}"
        if self.finished:
            return f"{self.name:<24} nothing to do"
        if not self.to_run:
            return f"{self.name:<24} only its package would be written"
        causes = [e for e in self.to_run if e.why.code != "upstream"] or list(self.to_run)
        told = "; ".join(f"{step_name(e.step, e.label)}: {e.why.sentence}" for e in causes[:3])
        more = f"; and {len(causes) - 3} more" if len(causes) > 3 else ""
        return f"{self.name:<24} {len(self.to_run)} of {len(self.plan)} steps: {told}{more}"


def preview(collection: Collection, store: Store, names: frozenset[str]) -> list[ScenePreview]:
    """Return what would run for the scenes of these names, in their order."""
    previews = [_of_scene(scene, store) for scene in collection.scenes if scene.name in names]
    previews += [
        ScenePreview(scene.name, finished=False, reason=scene.reason)
        for scene in collection.unreadable
        if scene.name in names
    ]
    return sorted(previews, key=lambda p: p.name)


def _of_scene(scene: SceneRequest, store: Store) -> ScenePreview:
    result, plan = plan_scene(scene, store)
    return ScenePreview(scene.name, is_finished(plan, result), tuple(plan))
