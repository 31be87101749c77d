"""Take the cameras that a model predicted, in metres, with points that photos agree on. Seconds.

Failed where hardly a photo's depth agrees with another's.
"""

from __future__ import annotations

from garden_models.progress import Progress, silent
from garden_models.reconstruction.geometry_model import GeometryPrediction
from garden_models.scene import Capture, SparseModel
from tasks.step import step


@step(version=1, packages=("numpy", "opencv-python-headless", "pycolmap"), memory_gb=2.0)
def predicted_cameras(
    capture: Capture, prediction: GeometryPrediction, progress: Progress = silent
) -> SparseModel:
    """Return the cameras and sparse points, or a verdict that says what was wrong."""
    from garden_models.reconstruction.predicted_cameras import predicted_cameras as run

    return run(capture, prediction)
