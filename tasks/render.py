"""Draw the scene at the photos' cameras, before and after the simulation. Seconds, CPU.

Only the report and evaluations need it.
"""

from __future__ import annotations

from garden_models.progress import Progress, silent
from garden_models.rendering.config import RenderViews
from garden_models.scene import (
    Background,
    GravityView,
    Reconstruction,
    Renders,
    SimScene,
    Trajectory,
)
from tasks.step import step


@step(version=1, packages=("numpy",), memory_gb=1.5)
def render(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    background: Background,
    scene: SimScene,
    trajectory: Trajectory,
    photos: tuple[str, ...],
    config: RenderViews,
    progress: Progress = silent,
) -> Renders:
    """Return the renders; those of ``photos`` (the targets') come first."""
    from garden_models.rendering.views import render_views

    return render_views(
        scene, trajectory, background, reconstruction, gravity_view, photos, config, progress
    )
