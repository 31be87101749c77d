"""The job of a collection's worker that factorizes one capture."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flows.collection.job import JobOrder, JobRun, Report
from flows.collection.passes import stops_of
from flows.licence import models_of
from flows.model_check import check_runnable
from flows.preset import Preset
from flows.scene_run import SceneRequest, is_finished, plan_scene, run_scene
from flows.target_proposal import check_askable
from garden_models.scene import Target
from storage import Store
from tasks.ingest import CaptureSource
from tasks.step import Postponed
from tasks.step.wire import plain_from_json, plain_to_json

_PLAIN: dict[str, Any] = {
    "source": CaptureSource,
    "targets": tuple[Target, ...],
    "preset": Preset,
    "remarks": tuple[str, ...],
}


@dataclass(frozen=True)
class SceneJob:
    """Plan and factorize one scene and write its package.

    ``models_here`` says whether the models that it asks run on this machine.
    """

    request: SceneRequest
    models_here: bool = True

    def plan(self, store: Store) -> Report | None:
        """Return the row of a finished scene, whose package is left as it is.

        Raises BadInput if what has to run would ask a model that cannot be asked.
        """
        planned, plan = plan_scene(self.request, store)
        if not is_finished(plan, planned):
            check_askable(plan, self.request.preset)
            if self.models_here:
                check_runnable(plan, self.request.preset)
            return None
        document = json.loads((self.request.package / "report.json").read_bytes())
        return scene_report(document, self.request.package) | {"executed": 0, "cached": len(plan)}

    def run(self, store: Store, events: JobRun) -> Report:
        """Factorize the scene; one that fails has a package too, of what was computed."""
        from flows.package.write import write_scene_package

        result = run_scene(
            self.request,
            store,
            events,
            events.engine,
            events.budget,
            events.elsewhere,
            events.postponed,
        )
        if isinstance(result.refs.failure, Postponed):
            return {"postponed": result.refs.failure.step}
        return scene_report(write_scene_package(result, store), self.request.package)


def scene_order(request: SceneRequest, *, models_here: bool = True) -> JobOrder:
    """Return the order that makes a scene's job in a worker."""
    arguments: dict[str, Any] = {
        name: plain_to_json(getattr(request, name)) for name in ("name", *_PLAIN)
    }
    arguments |= {"package": str(request.package), "force": sorted(request.force)}
    arguments["models_here"] = models_here
    return JobOrder(
        request.name,
        "flows.collection.scene_job:scene_job",
        arguments,
        models=models_of(request.preset),
        stops=() if request.force else stops_of(request.preset),
    )


def scene_job(
    name: Any, package: str, force: list[str], models_here: bool, **plain: Any
) -> SceneJob:
    """Make the job that ``scene_order`` describes."""
    values = {key: plain_from_json(plain[key], hint) for key, hint in _PLAIN.items()}
    return SceneJob(
        SceneRequest(
            name=plain_from_json(name, str),
            package=Path(package),
            force=frozenset(force),
            **values,
        ),
        models_here,
    )


def scene_report(document: dict[str, Any], package: Path) -> Report:
    """Return what a row takes from a scene's ``report.json``."""
    outcomes = Counter(step["outcome"] for step in document["steps"])
    step_seconds: dict[str, float] = {}
    for step in document["steps"]:
        spent = sum(v or 0.0 for k, v in step["seconds"].items() if k != "wait")
        step_seconds[step["step"]] = step_seconds.get(step["step"], 0.0) + spent
    objects = document["objects"]
    return {
        "status": document["status"],
        "reasons": document["reasons"],
        "executed": outcomes["executed"],
        "cached": outcomes["cached"],
        "package": package.name,
        "peak_mb": document["peak_mb"],
        "photos": [document["photos"]["given"], document["photos"]["registered"]],
        "objects": [len(objects), sum("placement" in entry for entry in objects)],
        "step_seconds": {name: round(seconds, 3) for name, seconds in step_seconds.items()},
    }
