"""The job of a collection's worker that runs one simulated scene."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from flows.benchmark.orchestration.simulated_scene import simulated_scene
from flows.collection.job import JobOrder, JobRun, Report
from storage import Store
from tasks.step import RunContext, run_context


@dataclass(frozen=True)
class SimulatedJob:
    """Plan and run scene ``number`` with so many objects."""

    name: str
    number: int
    objects: int

    def plan(self, store: Store) -> Report | None:
        """Return the report of a scene all of whose steps are in the store."""
        with run_context(RunContext(store, self.name, "plan")) as context:
            simulated_scene(self.number, self.objects)
        if any(entry.action != "cached" for entry in context.plan):
            return None
        return {"status": "ok", "executed": 0, "cached": len(context.plan)}

    def run(self, store: Store, events: JobRun) -> Report:
        """Run the scene, as a flow run if the collection is one."""
        context = RunContext(store, self.name, events.engine, events=events, budget=events.budget)

        def body() -> None:
            with run_context(context):
                simulated_scene(self.number, self.objects)

        if events.engine == "prefect":
            from flows.prefect_flow import scene_flow

            scene_flow(self.name)(body)()
        else:
            body()
        outcomes = Counter(event.outcome for event in context.outcomes)
        return {
            "status": "ok",
            "executed": outcomes["executed"],
            "cached": outcomes["cached"],
            "peak_mb": max(event.peak_mb for event in context.outcomes),
        }


def simulated_orders(scenes: int, objects: int) -> list[JobOrder]:
    """Return the orders of a collection of simulated scenes."""
    job = "flows.benchmark.orchestration.simulated_job:SimulatedJob"
    names = [f"scene_{number:06}" for number in range(scenes)]
    return [
        JobOrder(name, job, {"name": name, "number": number, "objects": objects})
        for number, name in enumerate(names)
    ]
