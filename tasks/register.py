"""Find the cameras of the photos (structure from motion). Tens of seconds, CPU.

Fails on photos that overlap too little; the value then still holds what was found, so
that it stays in the store. A foreign library that may hang: it runs in a child process.
"""

from __future__ import annotations

from garden_models.progress import Progress, silent
from garden_models.reconstruction.registration_config import Registration
from garden_models.scene import Capture, SparseModel
from tasks.step import step, step_scratch


@step(
    version=1,
    packages=("pycolmap", "numpy", "scipy", "torch", "opencv-python-headless"),
    isolated=True,
    time_limit_s=3600,
    memory_limit_gb=6,
    cores="all",
    memory_gb=2.0,
)
def register(capture: Capture, config: Registration, progress: Progress = silent) -> SparseModel:
    """Return the cameras and sparse points, or a verdict that names what was missing."""
    from garden_models.reconstruction.registration import register as run

    with step_scratch() as workspace:
        return run(capture, config, workspace, progress)
