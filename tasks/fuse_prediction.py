"""Check predicted depth between photos and fuse it to points. Seconds to a minute, CPU.

Degraded where photos confirm little of it, or match better with depths of another scale.
"""

from __future__ import annotations

from garden_models.progress import Progress, silent
from garden_models.reconstruction.fuse_prediction_config import FusePrediction
from garden_models.reconstruction.geometry_model import GeometryPrediction
from garden_models.scene import Capture, Reconstruction, SparseModel
from tasks.step import step


@step(
    version=1,
    packages=("torch", "numpy", "opencv-python-headless", "scipy"),
    isolated=True,
    time_limit_s=3600,
    memory_limit_gb=16,
    cores="all",
    memory_gb=4.0,
)
def fuse_prediction(
    capture: Capture,
    cameras: SparseModel,
    prediction: GeometryPrediction,
    config: FusePrediction,
    progress: Progress = silent,
) -> Reconstruction:
    """Return the views with confirmed depth and the fused points."""
    from garden_models.reconstruction.fuse_prediction import fuse_prediction as run

    return run(capture, cameras, prediction, config, progress)
