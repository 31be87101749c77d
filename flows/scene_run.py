"""Run one scene: plan it from the store, execute what is missing, write its package."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from flows.factorize import SceneRefs, factorize_scene
from flows.licence import models_of
from flows.preset import Preset
from flows.step_runner import AT_ONCE_ELSEWHERE, Elsewhere
from garden_models.scene import Target
from storage import Store
from storage.codec.ahead import import_codec_meanwhile
from storage.formats.package import check_writable, package_source
from tasks.ingest import CaptureSource
from tasks.step import (
    Budget,
    PlanEntry,
    Ref,
    RunContext,
    SpareChild,
    StepEvent,
    StepFailed,
    run_context,
)

AT_ONCE_A_CORE = 2
"""Targets that are on their way: while one waits for a core, another one's step runs."""


@dataclass(frozen=True)
class SceneRequest:
    """What the user asked for: one scene."""

    name: str
    source: CaptureSource
    targets: tuple[Target, ...]
    preset: Preset
    package: Path
    remarks: tuple[str, ...] = ()
    force: frozenset[str] = frozenset()


@dataclass
class SceneResult:
    """What came of it: the artifacts, every step's outcome, and the seconds it took."""

    request: SceneRequest
    refs: SceneRefs
    outcomes: list[StepEvent] = field(default_factory=list)
    seconds: float = 0.0

    @property
    def executed(self) -> int:
        """Return how many steps were executed (not served from the store)."""
        return sum(event.outcome == "executed" for event in self.outcomes)


def plan_scene(request: SceneRequest, store: Store) -> tuple[SceneResult, list[PlanEntry]]:
    """Tell what would run and why, from the store alone; nothing is executed."""
    context = RunContext(store=store, scene=request.name, engine="plan", force=request.force)
    result = _run(request, context)
    result.outcomes = [_as_event(entry, request.name) for entry in context.plan]
    return result, context.plan


def is_finished(plan: list[PlanEntry], result: SceneResult) -> bool:
    """Tell whether every step is in the store and the package was made from just these."""
    nothing_to_run = all(entry.action == "cached" for entry in plan)
    return nothing_to_run and package_source(result.request.package) == package_key(result)


def run_scene(
    request: SceneRequest,
    store: Store,
    events: Callable[[StepEvent], None],
    engine: Literal["prefect", "local"] = "prefect",
    budget: Budget | None = None,
    elsewhere: Elsewhere = None,
    postponed: frozenset[str] = frozenset(),
) -> SceneResult:
    """Execute the scene's flow with Prefect (or ``local``, in this process without it).

    Steps start when the ``budget`` (of the whole machine if not given) has room for them;
    ``elsewhere`` computes them on other machines (``flows.step_runner``). Before a step that is
    ``postponed`` the scene stops, with Postponed as its failure. Models that it asks are
    loaded once for all its steps.

    A scene that fails comes back with ``refs.failure`` set and all that was computed.
    """
    check_writable(request.package)
    budget = budget or Budget.of_machine()
    context = _context(request, store, engine, events, budget, elsewhere, postponed)
    import_codec_meanwhile()
    with _spare_child(context), _models_loaded_once(request, budget, elsewhere):
        return _run(request, context) if engine == "local" else _run_as_flow(request, context)


@contextmanager
def _spare_child(context: RunContext) -> Iterator[None]:
    """Have a child process ready for the run's isolated steps, if they run on this machine."""
    if context.elsewhere is not None:
        yield
        return
    with closing(SpareChild(context.store)) as context.spare:
        context.spare.prepare()
        yield


def _run_as_flow(request: SceneRequest, context: RunContext) -> SceneResult:
    from flows.prefect_server import at_server, begin_server

    begin_server()
    from flows.prefect_flow import PrefectProgress, scene_flow

    context.events = PrefectProgress(context.events)
    with at_server():
        result: SceneResult = scene_flow(request.name)(_run)(request, context)
    return result


@contextmanager
def _models_loaded_once(
    request: SceneRequest, budget: Budget, elsewhere: Elsewhere
) -> Iterator[None]:
    """Have the scene's steps ask their models of one keeper, if they ask any on this machine."""
    if elsewhere is not None or not models_of(request.preset):
        yield
        return
    from tasks.model.keeper_process import is_wanted, model_keeper

    with model_keeper(budget) if is_wanted() else nullcontext():
        yield


def _context(
    request: SceneRequest,
    store: Store,
    engine: Literal["prefect", "local"],
    events: Callable[[StepEvent], None],
    budget: Budget,
    elsewhere: Elsewhere,
    postponed: frozenset[str],
) -> RunContext:
    return RunContext(
        store=store,
        scene=request.name,
        engine=engine,
        events=events,
        force=request.force,
        workers=AT_ONCE_A_CORE * len(budget.cores) if elsewhere is None else AT_ONCE_ELSEWHERE,
        budget=budget,
        elsewhere=elsewhere,
        postponed=postponed,
    )


def package_key(result: SceneResult) -> str:
    """Identify what a package is made from: all artifacts' contents, targets and name."""
    from flows.package import PACKAGE_VERSION
    from storage.digest import digest_value

    refs = result.refs
    contents = [
        ref.content if ref else None
        for ref in (
            refs.capture, refs.cameras, refs.reconstruction, refs.gravity_view, refs.background,
            refs.scene, refs.trajectory, refs.renders, *_predicted(refs),
        )
    ]  # fmt: skip
    objects = [
        [o.target.name, o.masks.content, o.mesh.content, o.placement.content, o.labels.content]
        for o in refs.objects
    ]
    failed = [[target.name, failure.reason] for target, failure in refs.failed_targets]
    made_from = PACKAGE_VERSION, result.request.name, contents, objects, failed
    proposal = () if refs.proposal is None else (refs.proposal.content,)
    return digest_value((*made_from, result.request.remarks, *proposal), domain="garden.package/1")


def _predicted(refs: SceneRefs) -> list[Ref | None]:
    """Return what only a model's geometry has, nothing without one."""
    return [] if refs.prediction is None else [refs.prediction, refs.gaussians]


def _as_event(entry: PlanEntry, scene: str) -> StepEvent:
    ref = entry.ref
    return StepEvent(
        "finished",
        entry.step,
        entry.label,
        scene,
        time.time(),
        outcome="cached" if entry.action == "cached" else None,
        backend=ref.backend,
        seconds=ref.seconds,
        peak_mb=ref.peak_mb,
        status=ref.status,
        reasons=ref.reasons,
        why=entry.why,
        ref=ref,
    )


def _run(request: SceneRequest, context: RunContext) -> SceneResult:
    started = time.monotonic()
    refs = SceneRefs(request.targets)
    with run_context(context):
        try:
            factorize_scene(request.source, request.targets, request.preset, refs)
        except StepFailed as failure:
            refs.failure = failure
    return SceneResult(request, refs, list(context.outcomes), time.monotonic() - started)
