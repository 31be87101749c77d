"""Let the scene settle in MuJoCo for ten seconds (paper, section 4.1). Seconds, CPU.

Degraded when something tilts, drifts or falls; failed when the simulation breaks down.
"""

from __future__ import annotations

from garden_models.physics.config import Simulation
from garden_models.progress import Progress, silent
from garden_models.scene import SimScene, Trajectory
from tasks.step import step


@step(
    version=1,
    packages=("mujoco", "numpy", "scipy", "trimesh", "opencv-python-headless"),
    memory_gb=0.5,
)
def simulate(scene: SimScene, config: Simulation, progress: Progress = silent) -> Trajectory:
    """Return the bodies' poses over time and how they moved."""
    from garden_models.physics.simulate import simulate as run

    return run(scene, config, progress)
