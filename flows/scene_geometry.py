"""From photos to an upright reconstruction: by GARDEN's own geometry or by a model's."""

from __future__ import annotations

from flows.preset import Preset
from garden_models.reconstruction.photo_geometry_config import EMBEDDED
from tasks.align_gravity import align_gravity
from tasks.align_gravity_by_tokens import align_gravity_by_tokens
from tasks.clean_gaussians import clean_gaussians
from tasks.fuse_prediction import fuse_prediction
from tasks.predict_geometry import predict_geometry
from tasks.predicted_cameras import predicted_cameras
from tasks.step import Ref


def by_model(preset: Preset) -> bool:
    """Tell whether a model predicts cameras and depth."""
    return preset.geometry.method != EMBEDDED


def prediction_and_cameras(capture: Ref, preset: Preset) -> tuple[Ref, Ref]:
    """Return a model's prediction and the cameras that it is made of."""
    prediction = predict_geometry(capture, preset.geometry)
    return prediction, predicted_cameras(capture, prediction)


def fused_prediction(capture: Ref, cameras: Ref, prediction: Ref, preset: Preset) -> Ref:
    """Return the reconstruction of what photos confirm of a prediction."""
    return fuse_prediction(capture, cameras, prediction, preset.fusion)


def predicted_gravity(reconstruction: Ref, prediction: Ref, preset: Preset) -> Ref:
    """Return the Gravity-View frame, from camera tokens too if a decoder of them is given."""
    if not preset.token_gravity.weights:
        return align_gravity(reconstruction, preset.gravity)
    return align_gravity_by_tokens(reconstruction, prediction, preset.gravity, preset.token_gravity)


def background_gaussians(
    reconstruction: Ref,
    gravity_view: Ref,
    prediction: Ref | None,
    labels: tuple[Ref, ...],
    preset: Preset,
) -> Ref | None:
    """Return the predicted Gaussians without the objects', None if none were predicted."""
    if prediction is None or not preset.geometry.gaussians:
        return None
    return clean_gaussians(reconstruction, gravity_view, prediction, labels, preset.splats)
