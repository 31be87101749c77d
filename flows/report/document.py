"""Build ``report.json`` (schema ``garden.report/1``, described in docs/report.md)."""

from __future__ import annotations

from typing import Any

import numpy as np

from flows.report.proposal_document import proposal_document
from flows.report.support_document import support_document
from flows.report.values import ObjectValues, SceneValues
from flows.scene_run import SceneResult
from garden_models.scene import (
    BodyMotion,
    GravityView,
    PlacementHypothesis,
    SparseModel,
    Verdict,
)
from storage.redact import redacted
from tasks.step import Ref, StepEvent

SCHEMA = "garden.report/1"
Json = dict[str, Any]


def scene_verdict(result: SceneResult) -> Verdict:
    """Return the worst verdict of all steps; a failed target makes the scene degraded."""
    refs = result.refs
    if refs.failure is not None:
        return Verdict("failed", (refs.failure.reason,))
    verdict = Verdict()
    singles = (
        refs.capture, refs.prediction, refs.cameras, refs.proposal, refs.reconstruction,
        refs.gravity_view, refs.background, refs.gaussians, refs.scene, refs.trajectory,
        refs.renders,
    )  # fmt: skip
    for ref in singles:
        if ref is not None:
            verdict = verdict.worst(_ref_verdict(ref))
    for factored in refs.objects:
        for ref in (factored.masks, factored.mesh, factored.placement, factored.labels):
            own = _ref_verdict(ref)
            reasons = tuple(f"{factored.target.name}: {reason}" for reason in own.reasons)
            verdict = verdict.worst(Verdict(_softened(own.status), reasons))
    for target, failure in refs.failed_targets:
        verdict = verdict.worst(Verdict("degraded", (f"{target.name}: {failure.reason}",)))
    return verdict


def scene_remarks(result: SceneResult) -> list[str]:
    """Return what the user and the steps that went well have to say."""
    remarks = list(result.request.remarks)
    for event in result.outcomes:
        if event.status == "ok":
            label = f"{event.label}: " if event.label else ""
            remarks += [label + reason for reason in event.reasons]
    return remarks


def object_verdict(values: ObjectValues, motion: BodyMotion | None) -> Verdict:
    """Return the worst verdict of one object's artifacts and of its motion."""
    verdict = values.masks.verdict
    for own in (values.mesh.verdict, values.placement.verdict, values.labels.verdict):
        verdict = verdict.worst(own)
    return verdict if motion is None else verdict.worst(motion.verdict)


def report_document(values: SceneValues) -> Json:
    """Return the report as a JSON value."""
    verdict = scene_verdict(values.result)
    return redacted(
        {
            "schema": SCHEMA,
            "scene": values.result.request.name,
            "status": verdict.status,
            "reasons": list(verdict.reasons),
            "remarks": scene_remarks(values.result),
            "photos": _photos(values),
            "scale": _scale(values),
            "cameras": _cameras(values.cameras),
            "gravity": _gravity(values.gravity_view),
            "proposal": proposal_document(values.proposal) if values.proposal else None,
            "supports": [support_document(s) for s in values.scene.supports]
            if values.scene
            else [],
            "objects": _objects(values),
            "background": _background(values),
            **run_section(values.result),
        }
    )


def run_section(result: SceneResult) -> Json:
    """Return the part of the report that tells of this run: the steps and the time."""
    steps = [_step(event) for event in result.outcomes]
    return redacted(
        {
            "steps": steps,
            "executed": result.executed,
            "seconds": round(result.seconds, 3),
            "peak_mb": max((s["peak_mb"] for s in steps), default=0.0),
        }
    )


def _ref_verdict(ref: Ref) -> Verdict:
    """Return a step's verdict with its reasons; what an ``ok`` step remarks is none."""
    return Verdict(ref.status, tuple(ref.reasons) if ref.status != "ok" else ())


def _softened(status: str) -> Any:
    return "degraded" if status == "failed" else status


def _photos(values: SceneValues) -> Json:
    given = [p.name for p in values.capture.photos] if values.capture else []
    registered = [c.photo for c in values.cameras.cameras] if values.cameras else []
    unregistered = list(values.cameras.unregistered) if values.cameras else given
    return {
        "given": len(given),
        "registered": len(registered),
        "names": given,
        "unregistered": unregistered,
    }


def _scale(values: SceneValues) -> Json | None:
    scale = values.cameras.scale if values.cameras else None
    if scale is None:
        return None
    return {
        "source": scale.source,
        "metres_per_unit": scale.metres_per_unit,
        "note": scale.note,
    }


def _cameras(cameras: SparseModel | None) -> Json | None:
    if cameras is None:
        return None
    attempts = [
        {
            "name": a.name,
            "registered": a.registered,
            "points": a.points,
            "mean_reprojection_px": _number(a.mean_reprojection_px),
            "seconds": _number(a.seconds),
            "chosen": a.chosen,
            "note": a.note,
        }
        for a in cameras.attempts
    ]
    return {"source": cameras.cameras_source, "attempts": attempts}


def _gravity(gravity_view: GravityView | None) -> Json | None:
    if gravity_view is None:
        return None
    evidence = [
        {
            "method": e.method,
            "direction_world": _vector(e.down_world),
            "sigma_deg": _number(e.sigma_deg),
            "accepted": e.accepted,
            "note": e.note,
        }
        for e in gravity_view.evidence
    ]
    return {
        "direction_world": _vector(gravity_view.down_world),
        "sigma_deg": _number(gravity_view.sigma_deg),
        "confidence": _number(_confidence(gravity_view.sigma_deg)),
        "reference_photo": gravity_view.reference_photo,
        "status": gravity_view.verdict.status,
        "reasons": list(gravity_view.verdict.reasons),
        "evidence": evidence,
    }


def _confidence(sigma_deg: float, within_deg: float = 2.0) -> float:
    """Return the probability that the error is within 2 degrees (Rayleigh)."""
    return float(1 - np.exp(-0.5 * (within_deg / max(sigma_deg, 1e-6)) ** 2))


def _objects(values: SceneValues) -> list[Json]:
    motions = {m.name: m for m in values.trajectory.motions} if values.trajectory else {}
    bodies = {b.name: b for b in values.scene.bodies} if values.scene else {}
    factored = {o.target.name: o for o in values.objects}
    failed = {t.name: (t, f) for t, f in values.result.refs.failed_targets}
    documents = []
    for target in values.result.refs.targets:
        if target.name in factored:
            documents.append(
                _object(factored[target.name], motions.get(target.name), bodies.get(target.name))
            )
        else:
            reason = failed[target.name][1].reason if target.name in failed else "not reached"
            earlier = _doubts(values.result, target.name)
            documents.append(
                {
                    "name": target.name,
                    "photo": target.photo,
                    "box": list(target.box),
                    "status": "failed",
                    "reasons": [reason, *earlier],
                }
            )
    return documents


def _doubts(result: SceneResult, target: str) -> list[str]:
    """Return what the steps that did come out said of a target: often why a later one failed."""
    return [
        f"{event.step}: {reason}"
        for event in result.outcomes
        if event.label == target and event.status == "degraded"
        for reason in event.reasons
    ]


def _object(values: ObjectValues, motion: BodyMotion | None, body: Any) -> Json:
    verdict = object_verdict(values, motion)
    mesh, placement = values.mesh, values.placement
    extent = np.ptp(mesh.vertices, axis=0) * placement.best.scale
    document: Json = {
        "name": values.target.name,
        "photo": values.target.photo,
        "box": list(values.target.box),
        "status": verdict.status,
        "reasons": list(verdict.reasons),
        "seen_in": int(sum(m.any() for m in values.masks.masks)),
        "support": support_document(values.masks.support) if values.masks.support else None,
        "mesh": {
            "vertices": len(mesh.vertices),
            "faces": len(mesh.faces),
            "watertight": mesh.watertight,
            "observed_share": _number(float(mesh.observed.mean())),
            "completion": list(mesh.completion),
            "size_m": _vector(extent),
        },
        "placement": {
            "chosen": placement.best.name,
            "why": placement.why,
            "gv_from_object": placement.best.gv_from_object.tolist(),
            "hypotheses": [_hypothesis(h) for h in placement.hypotheses],
        },
        "removed_points": int((values.labels.probability >= values.labels.threshold).sum()),
        "labelled_by": values.labels.method,
    }
    if body is not None:
        document["physics"] = {
            "mass_kg": _number(body.mass_kg),
            "friction": _number(body.friction),
            "colliders": len(body.colliders),
            "lifted_m": _number(body.lifted_m),
            "supported_by": body.supported_by,
            "note": body.physics_note,
        }
    if motion is not None:
        document |= {
            "tilt_deg": _number(motion.tilt_deg),
            "drift_m": _number(motion.drift_m),
            "penetration_m": _number(motion.penetration_m),
            "at_rest": motion.at_rest,
        }
    return document


def _hypothesis(hypothesis: PlacementHypothesis) -> Json:
    return {
        "name": hypothesis.name,
        "gv_from_object": hypothesis.gv_from_object.tolist(),
        "scale": _number(hypothesis.scale),
        "scores": {name: _number(score) for name, score in hypothesis.scores.items()},
    }


def _background(values: SceneValues) -> Json | None:
    if values.background is None:
        return None
    return {
        "points": len(values.background.points_gv),
        "filled": int(values.background.filled.sum()),
        "removed": dict(values.background.removed),
    }


def _step(event: StepEvent) -> Json:
    ref = event.ref
    return {
        "step": event.step,
        "target": event.label or None,
        "backend": event.backend,
        "outcome": event.outcome,
        "status": event.status or ("failed" if event.outcome == "failed" else "ok"),
        "reasons": list(event.reasons) or ([event.error] if event.error else []),
        "why": event.why.sentence if event.why else "",
        "why_code": event.why.code if event.why else "",
        "seconds": {
            "load": _number(event.seconds.load),
            "compute": _number(event.seconds.compute),
            "publish": _number(event.seconds.publish),
            "wait": _number(event.seconds.wait),
        },
        "peak_mb": _number(event.peak_mb or 0.0),
        "key": ref.key if ref else "",
        "content": ref.content if ref else "",
    }


def _number(value: float) -> float | None:
    return float(f"{value:.6g}") if np.isfinite(value) else None


def _vector(vector: np.ndarray) -> list[float]:
    return [float(f"{x:.9g}") for x in vector]
