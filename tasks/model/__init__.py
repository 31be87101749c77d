"""Ask the paper's models, each wherever and however this machine runs it.

@step(version=1, backend=..., weights=...)      # backend_of(name), weights_of(name)
def segment(...):
    with predictor("sam3") as predict:
        answer = predict(MaskRequest(rgb, boxes))
"""

from tasks.model.predictor import predictor
from tasks.model.weights import backend_of, weights_of

__all__ = ["backend_of", "predictor", "weights_of"]
