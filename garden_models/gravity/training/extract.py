"""Run a backbone over scenes of a data set and keep its camera tokens with the truth."""

from __future__ import annotations

from pathlib import Path
from zlib import crc32

import cv2
import numpy as np

from garden_models.gravity.training.datasets.read import read_dataset
from garden_models.gravity.training.token_shard import TokenShard
from garden_models.gravity.training.windows import Windows, windows_of
from garden_models.progress import Progress, silent
from garden_models.reconstruction.da3_camera_tokens import camera_tokens
from garden_models.reconstruction.da3_network import load_network
from garden_models.scene import BadInput


def extract_tokens(
    dataset: str,
    root: Path,
    sequence: str,
    backbone: Path,
    windows: Windows,
    device: str,
    progress: Progress = silent,
) -> TokenShard:
    """Return the tokens of the scenes of one sequence.

    Raises BadInput for a sequence or a photo that is not there, or weights that do not fit.
    """
    known = {found.name: found for found in read_dataset(dataset, root)}
    if sequence not in known:
        raise BadInput(f"{root} holds no sequence called {sequence}")
    own = known[sequence]
    true = own.gv_from_camera()
    network = load_network(backbone, device)
    scenes = windows_of(len(own), windows, crc32(sequence.encode()))
    if not scenes:
        raise BadInput(f"{sequence} has {len(own)} photos: too few for a scene")
    tokens, references = [], []
    for k, chosen in enumerate(scenes):
        progress(k / len(scenes), f"{sequence}, scene {k} of {len(scenes)}")
        found, reference = camera_tokens(network, [_photo(own.photos[i]) for i in chosen])
        tokens.append(found.astype(np.float16))
        references.append(reference)
    return TokenShard(
        network.kind,
        np.concatenate(tokens),
        np.concatenate([true[chosen] for chosen in scenes]).astype(np.float32),
        np.array(references),
        np.concatenate([[0], np.cumsum([len(chosen) for chosen in scenes])]),
    )


def _photo(path: Path) -> np.ndarray:
    bgr = cv2.imread(str(path))
    if bgr is None:
        raise BadInput(f"{path} is no picture")
    return np.ascontiguousarray(bgr[..., ::-1])
