"""Find depth in every photo and fuse it to coloured points. About a minute, CPU.

Inputs: photos and their cameras. Degraded where little depth is valid. Memory grows with
the number of photos: it runs in a child process with a cap.
"""

from __future__ import annotations

from garden_models.progress import Progress, silent
from garden_models.reconstruction.dense_stereo import DenseStereo
from garden_models.scene import Capture, Reconstruction, SparseModel
from tasks.step import step


@step(
    version=1,
    packages=("torch", "numpy", "opencv-python-headless", "scipy"),
    isolated=True,
    time_limit_s=3600,
    memory_limit_gb=6,
    cores="all",
    memory_gb=2.0,
)
def reconstruct(
    capture: Capture, cameras: SparseModel, config: DenseStereo, progress: Progress = silent
) -> Reconstruction:
    """Return the views with depth and the fused points."""
    from garden_models.reconstruction.densify import densify

    return densify(capture, cameras, config, progress)
