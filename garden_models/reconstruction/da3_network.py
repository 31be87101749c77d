"""Load a network of Depth-Anything-3, and watch what it does not return."""

from __future__ import annotations

import importlib
import importlib.util
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from garden_models.reconstruction.load_network_class import read_weights
from garden_models.scene import BadInput

STRATEGY = "saddle_balanced"
"""How the model chooses its reference view."""
FEWEST_TO_CHOOSE = 3
"""With fewer views the first one is the reference."""
GAUSSIAN_PARTS = ("gs_head", "gs_adapter")
GAUSSIAN_IMPORTS = ("evo", "e3nn")


@dataclass(frozen=True)
class Da3Network:
    """A loaded network. ``net`` is the whole one, ``anyview`` the part that reads many views
    together (the same unless nested); ``kind`` is the name of its configuration.
    """

    net: Any
    kind: str

    @property
    def anyview(self) -> Any:
        """The part that predicts cameras."""
        return self.net.da3 if self.nested else self.net

    @property
    def nested(self) -> bool:
        """Whether a second network tells metres."""
        return hasattr(self.net, "da3")

    @property
    def poses(self) -> bool:
        """Whether it predicts cameras."""
        return self.anyview.cam_dec is not None

    @property
    def gaussians(self) -> bool:
        """Whether it predicts Gaussians."""
        return self.anyview.gs_head is not None

    @property
    def device(self) -> torch.device:
        """Where its weights lie."""
        return next(iter(self.net.parameters())).device


def load_network(folder: Path, device: str) -> Da3Network:
    """Return the network of a weight folder (``config.json``, ``model.safetensors``).

    The head of Gaussians is left out where ``evo`` and ``e3nn``, which it needs, are not
    installed. Raises BadInput if a file or the package is missing, or the weights do not fit.
    """
    kind = model_name(folder)
    try:
        cfg = importlib.import_module("depth_anything_3.cfg")
        registry = importlib.import_module("depth_anything_3.registry").MODEL_REGISTRY
    except ImportError as error:
        raise BadInput(
            "Depth-Anything-3 is not installed: pip install --no-deps depth-anything-3, with "
            f"omegaconf, addict and einops ({error})"
        ) from error
    if kind not in registry:
        raise BadInput(f"{folder}: Depth-Anything-3 has no model called {kind}")
    config = cfg.load_config(registry[kind])
    weights = {k.removeprefix("model."): w for k, w in read_weights(folder).items()}
    if not gaussians_installed():
        for part in (config, config.get("anyview")):
            for name in GAUSSIAN_PARTS:
                if part is not None:
                    part.pop(name, None)
        weights = {k: w for k, w in weights.items() if not k.removeprefix("da3.").startswith("gs_")}
    net = cfg.create_object(config).eval().requires_grad_(False)
    try:
        net.load_state_dict(weights, strict=True)
    except RuntimeError as error:
        raise BadInput(f"{folder}: the weights do not fit {kind}: {error}") from error
    return Da3Network(net.to(device), kind)


def gaussians_installed() -> bool:
    """Tell whether what the head of Gaussians imports is there."""
    return all(importlib.util.find_spec(name) for name in GAUSSIAN_IMPORTS)


def model_name(folder: Path) -> str:
    """Return which network a weight folder is for; raise BadInput if it does not say."""
    try:
        return str(json.loads((folder / "config.json").read_text("utf-8"))["model_name"])
    except (OSError, ValueError, KeyError) as error:
        raise BadInput(f"{folder}: no config.json with a model_name ({error})") from error


@dataclass
class Watched:
    """What a run of the network showed: the camera decoder's input (views, c) and the index
    of the reference view.
    """

    tokens: list[Tensor] = field(default_factory=list)
    class_tokens: list[Tensor] = field(default_factory=list)

    def reference(self, views: int, cameras_given: bool) -> int:
        """Return the reference view: the first one unless the model could choose."""
        if views < FEWEST_TO_CHOOSE or cameras_given:
            return 0
        module = importlib.import_module("depth_anything_3.model.reference_view_selector")
        before = self.class_tokens[0].reshape(1, views, 1, -1)
        return int(module.select_reference_view(before, STRATEGY)[0])


@contextmanager
def watching(network: Da3Network) -> Iterator[Watched]:
    """Record what the network's parts read while it runs.

    The reference view is chosen by the class tokens before the first block that sees all
    views; the camera decoder reads the camera tokens. Gaussians are left in the world of the
    predicted cameras: the network would else shift them towards given ones, by a factor that
    it does not return.
    """
    watched = Watched()
    hooks = []
    part = network.anyview
    if network.poses:
        vit = part.backbone.pretrained
        chooser = vit.blocks[vit.alt_start - 2]
        hooks.append(
            chooser.register_forward_hook(
                lambda _m, _i, out: watched.class_tokens.append(out[:, :1].clone())
            )
        )
        hooks.append(
            part.cam_dec.register_forward_pre_hook(
                lambda _m, inputs: watched.tokens.append(inputs[0][0])
            )
        )
    if network.gaussians:
        hooks.append(
            part.gs_adapter.register_forward_pre_hook(
                lambda _m, args, kwargs: (args, kwargs | {"gt_extrinsics": None}), with_kwargs=True
            )
        )
    try:
        with torch.inference_mode():
            yield watched
    finally:
        for hook in hooks:
            hook.remove()
