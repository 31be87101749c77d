"""Let a scene settle under gravity in MuJoCo and say how every body moved (paper, section 3.4)."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
from jaxtyping import Float

from garden_models.geometry.rotation import angle_between_deg, matrix_from_quaternion
from garden_models.physics.config import TIMESTEP, Simulation
from garden_models.physics.mjcf import is_free, write_mjcf
from garden_models.physics.mujoco_warnings import collect_warnings
from garden_models.physics.poses import body_poses
from garden_models.progress import Progress, silent
from garden_models.scene import OK, Body, BodyMotion, SimScene, Trajectory, Verdict

UNSTABLE = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)
"""What MuJoCo warns of when it resets a state that is no state any more."""


@collect_warnings()
def compile_scene(scene: SimScene) -> mujoco.MjModel:
    """Return the MuJoCo model of a scene in Gravity-View (gravity +y)."""
    mjcf = write_mjcf(scene.bodies, scene.supports, np.eye(3))
    return mujoco.MjModel.from_xml_string(mjcf.xml, mjcf.asset_bytes)


def simulate(
    scene: SimScene,
    config: Simulation = Simulation(),
    progress: Progress = silent,
) -> Trajectory:
    """Simulate and return poses, motions and a verdict.

    The first frame is the start. A body that tilts, drifts or falls is ``degraded``, as is a
    simulation that MuJoCo warns of; one that diverges is ``failed`` and its trajectory ends
    there.
    """
    with collect_warnings() as warned:
        trajectory = _simulate(scene, config, progress)
    if not warned.reasons:
        return trajectory
    verdict = trajectory.verdict.worst(Verdict("degraded", warned.reasons))
    return replace(trajectory, verdict=verdict)


def _simulate(scene: SimScene, config: Simulation, progress: Progress) -> Trajectory:
    """Simulate; the verdict is what the motions say."""
    model = compile_scene(scene)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    steps = max(1, round(1 / (config.frames_per_second * TIMESTEP)))
    frames = max(1, round(config.seconds / (steps * TIMESTEP)))
    times = [0.0]
    poses = [body_poses(model, data, scene.bodies)]
    diverged = False
    for frame in range(1, frames + 1):
        mujoco.mj_step(model, data, nstep=steps)
        diverged = bool(
            any(data.warning[kind].number for kind in UNSTABLE) or not np.isfinite(data.qpos).all()
        )
        if diverged:
            break
        # MuJoCo warns of a thing once and then counts; from 0 on, it warns again.
        for warning in data.warning:
            warning.number = 0
        times.append(frame * steps * TIMESTEP)
        poses.append(body_poses(model, data, scene.bodies))
        if frame % max(1, frames // 20) == 0:
            progress(frame / frames, f"{times[-1]:.1f} s of {config.seconds:g} s")
    positions = np.stack([pose[0] for pose in poses])
    quaternions = np.stack([pose[1] for pose in poses])
    mujoco.mj_forward(model, data)
    penetrations = _penetrations(model, data, scene.bodies)
    times_s = np.array(times)
    motions = tuple(
        _motion(scene, i, times_s, positions[:, i], quaternions[:, i], penetrations[i], config)
        for i in range(len(scene.bodies))
    )
    verdict = OK
    if diverged:
        reason = f"the simulation diverged after {times[-1]:.2f} s: bodies overlap or are too thin"
        verdict = Verdict("failed", (reason,))
    for motion in motions:
        verdict = verdict.worst(motion.verdict)
    return Trajectory(times_s, positions, quaternions, motions, verdict)


def _penetrations(
    model: mujoco.MjModel, data: mujoco.MjData, bodies: tuple[Body, ...]
) -> Float[np.ndarray, " b"]:
    """Return each body's deepest contact in metres."""
    deepest = np.zeros(len(bodies))
    owner = {model.body(body.name).id: i for i, body in enumerate(bodies)}
    for contact in data.contact:
        for geom in contact.geom:
            i = owner.get(int(model.geom_bodyid[geom]), -1)
            if i >= 0:
                deepest[i] = max(deepest[i], -contact.dist)
    return deepest


def _motion(
    scene: SimScene,
    index: int,
    times_s: Float[np.ndarray, " t"],
    positions: Float[np.ndarray, "t 3"],
    quaternions: Float[np.ndarray, "t 4"],
    penetration_m: float,
    config: Simulation,
) -> BodyMotion:
    """Measure one body's motion and judge it."""
    body = scene.bodies[index]
    rotations = np.stack([matrix_from_quaternion(q) for q in quaternions])
    centres = positions + rotations @ body.centre_of_mass
    tilt = angle_between_deg(rotations[0][:, 1], rotations[-1][:, 1])
    drift = float(np.linalg.norm(centres[-1] - centres[0]))
    window = times_s >= times_s[-1] - config.rest_window_s
    moved = float(np.linalg.norm(centres[window] - centres[-1], axis=1).max())
    turned = max(_turn_deg(rotation, rotations[-1]) for rotation in rotations[window])
    at_rest = moved < config.rest_drift_m and turned < config.rest_turn_deg
    size = float(np.ptp(body.vertices, axis=0).max())
    reasons = []
    if is_free(body):
        if _is_off(scene, body, centres):
            fell = float(centres[-1, 1] - centres[0, 1])
            reasons.append(f"{body.name} fell {fell:.3g} m off {body.supported_by}")
        if tilt > config.most_tilt_deg:
            reasons.append(
                f"{body.name} tilted {tilt:.1f} degrees (more than {config.most_tilt_deg:g})"
            )
        if drift > config.most_drift * size:
            reasons.append(
                f"{body.name} drifted {drift:.3g} m, {drift / size:.0%} of its size "
                f"(more than {config.most_drift:.0%})"
            )
        if not at_rest:
            reasons.append(f"{body.name} still moves after {times_s[-1]:.1f} s")
    verdict = Verdict("degraded", tuple(reasons)) if reasons else OK
    return BodyMotion(body.name, tilt, drift, float(penetration_m), at_rest, verdict)


def _is_off(scene: SimScene, body: Body, centres: Float[np.ndarray, "t 3"]) -> bool:
    """Tell whether a body's centre of mass ended below what carried it at the start."""
    heights = {support.name: support.height_gv for support in scene.supports}
    lowest = body.vertices @ body.gv_from_body[1, :3] + body.gv_from_body[1, 3]
    return bool(centres[-1, 1] > heights.get(body.supported_by, float(lowest.max())))


def _turn_deg(a: Float[np.ndarray, "3 3"], b: Float[np.ndarray, "3 3"]) -> float:
    """Return the angle between two rotations in degrees, exact for small ones."""
    half_chord = float(np.linalg.norm(a - b)) / (2 * np.sqrt(2))
    return float(np.degrees(2 * np.arcsin(min(1.0, half_chord))))
