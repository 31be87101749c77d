"""Say how well a settled scene kept its reconstructed poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from garden_models.scene import SimScene, Trajectory


@dataclass(frozen=True)
class Stability:
    """Over all bodies after the simulation.

    ``stable_share`` counts bodies within the limits and at rest; a body that nothing carries
    and that is therefore kept fixed is not stable. Drift is in metres and relative to the
    body's longest extent.
    """

    bodies: int
    stable_share: float
    worst_tilt_deg: float
    worst_drift_m: float
    worst_relative_drift: float
    worst_penetration_m: float


def stability(
    scene: SimScene,
    trajectory: Trajectory,
    most_tilt_deg: float = 3.0,
    most_relative_drift: float = 0.02,
) -> Stability:
    """Return the stability of a trajectory of the scene's bodies.

    Raises ValueError if there is none or it is of other bodies.
    """
    if [m.name for m in trajectory.motions] != [body.name for body in scene.bodies]:
        raise ValueError("the trajectory is of other bodies than the scene")
    if not scene.bodies:
        raise ValueError("the scene has no bodies whose stability could be measured")
    sizes = np.array([np.ptp(body.vertices, axis=0).max() for body in scene.bodies])
    tilt = np.array([motion.tilt_deg for motion in trajectory.motions])
    drift = np.array([motion.drift_m for motion in trajectory.motions])
    stable = np.array([motion.at_rest for motion in trajectory.motions])
    stable &= np.array([bool(body.supported_by) for body in scene.bodies])
    stable &= (tilt <= most_tilt_deg) & (drift <= most_relative_drift * sizes)
    return Stability(
        len(scene.bodies),
        float(stable.mean()),
        float(tilt.max()),
        float(drift.max()),
        float((drift / sizes).max()),
        float(max(motion.penetration_m for motion in trajectory.motions)),
    )
