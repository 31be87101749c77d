"""Plan a scene from the store with a clock at every look-up."""

from __future__ import annotations

import time
from dataclasses import dataclass

from flows.scene_run import SceneRequest, SceneResult, is_finished, plan_scene
from storage import ActionRecord, Store
from tasks.step import PlanEntry


class TimedStore(Store):
    """A store that notes how long each look-up took, in seconds by action key."""

    def __init__(self, store: Store) -> None:
        super().__init__(store.medium, verify=store.verify_level)
        self.lookup_s: dict[str, float] = {}

    def lookup(self, key: str, *, mend: bool = True) -> tuple[ActionRecord | None, str]:
        """Look up as ``Store.lookup`` does."""
        begun = time.perf_counter()
        found = super().lookup(key, mend=mend)
        self.lookup_s[key] = time.perf_counter() - begun
        return found


@dataclass(frozen=True)
class TimedPlan:
    """A scene's plan, whether there is nothing to do, and how long it took to know."""

    result: SceneResult
    plan: list[PlanEntry]
    finished: bool
    wall_s: float
    lookup_s: dict[str, float]


def timed_plan(request: SceneRequest, store: Store) -> TimedPlan:
    """Plan the scene and check its package, as a rerun does first; nothing is executed."""
    timed = TimedStore(store)
    begun = time.perf_counter()
    result, plan = plan_scene(request, timed)
    finished = is_finished(plan, result)
    return TimedPlan(result, plan, finished, time.perf_counter() - begun, timed.lookup_s)
