"""Say how targets are proposed: by a vision-language model, or by text labels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from garden_models.scene import BadInput
from garden_models.targets.box_convention import CONVENTIONS, BoxConvention, convention_of

GOAL = (
    "someone rearranges the loose objects of the scene: picks them up, pushes them, and puts "
    "them down somewhere else"
)

Api = Literal["gemini", "openai"]


@dataclass(frozen=True)
class ProposeTargets:
    """Ask a vision-language model for boxes and have it check them (paper, supplement)."""

    model: str = ""
    """Its name as its server knows it, such as gemini-3-flash-preview; empty: ask none."""

    goal: str = GOAL
    """What the simulation is for; it decides which objects matter."""

    api: Literal["auto", "gemini", "openai"] = "auto"
    """How its server is spoken to: Google's way, or as an OpenAI-compatible one.

    ``auto`` is Google's for models called gemini-..., else OpenAI's.
    """

    boxes: Literal["auto", BoxConvention] = "auto"
    """How it writes boxes; ``auto`` knows the Gemini, Gemma and Qwen-VL families."""

    critic: bool = True
    """Ask a second time, to check and repair the boxes."""

    max_targets: int = 12
    max_photos: int = 12
    """Photos that are sent, evenly over the capture."""

    photo_side: int = 1024
    """Long side in pixels of the photos that are sent."""

    structured: bool = True
    """Have the server hold the answer to a JSON schema."""

    temperature: float | None = None
    """Randomness of the answer; the server's own if not given."""

    thinking: Literal["", "minimal", "low", "medium", "high"] = ""
    """How much a model may think before it answers; as much as it likes if not given."""

    attempt: int = 1
    """Another number asks again although the answer is in the store; --force does not, since
    the first result counts.
    """

    address: str = ""
    """The server, such as http://localhost:8000/v1; the API's own if not given."""

    key_variable: str = ""
    """Environment variable with the server's key, if not the API's usual one."""

    timeout_s: float = 120.0
    """How long one answer may take."""

    tries: int = 3
    """Requests before a server that is busy, slow or broken is given up."""

    pause_s: float = 2.0
    """Before the second request; doubles with each, unless the server says how long."""


@dataclass(frozen=True)
class GroundTargets:
    """Find objects by their names in the photos, with an open-vocabulary detector."""

    model: str = ""
    """The detector, such as grounding_dino; empty: ask none."""

    labels: tuple[str, ...] = ()
    """What to look for, such as mug and chair."""

    min_score: float = 0.3
    """Detections below are left out (0..1)."""

    max_per_label: int = 8
    max_photos: int = 12
    """Photos that are looked at, evenly over the capture."""

    max_overlap: float = 0.7
    """Of two boxes of one photo that overlap more (intersection over union), the better stays."""


def api_of(config: ProposeTargets) -> Api:
    """Return which API the model's server speaks."""
    if config.api != "auto":
        return config.api
    return "gemini" if config.model.startswith("gemini") else "openai"


def boxes_of(config: ProposeTargets) -> BoxConvention:
    """Return how the model writes boxes; BadInput if that is not known."""
    if config.boxes != "auto":
        return config.boxes
    known = convention_of(config.model)
    if known is None:
        raise BadInput(
            f"how {config.model} writes boxes is not known: set propose.boxes to one of "
            f"{', '.join(CONVENTIONS)}"
        )
    return known


def check_proposing(config: ProposeTargets) -> None:
    """Raise BadInput for options with which no model can be asked."""
    boxes_of(config)
    for name in ("max_targets", "max_photos", "tries", "attempt"):
        if getattr(config, name) < 1:
            raise BadInput(f"propose.{name} must be at least 1, got {getattr(config, name)}")
    if config.photo_side < 224:
        raise BadInput(f"propose.photo_side must be at least 224, got {config.photo_side}")
    if not config.timeout_s > 0:
        raise BadInput(f"propose.timeout_s must be positive, got {config.timeout_s}")
    if not config.pause_s >= 0:
        raise BadInput(f"propose.pause_s must not be negative, got {config.pause_s}")
    if config.temperature is not None and not 0 <= float(config.temperature) <= 2:
        raise BadInput(f"propose.temperature must be from 0 to 2, got {config.temperature}")
    if not config.goal.strip():
        raise BadInput("propose.goal is empty: say what the simulation is for")


def check_grounding(config: GroundTargets) -> None:
    """Raise BadInput for options with which nothing can be looked for."""
    if not config.labels:
        raise BadInput(f"{config.model} is not told what to look for: name it with ground.labels")
    for label in config.labels:
        if not any(character.isalnum() for character in label) or "." in label:
            raise BadInput(f"the label {label!r} names no object: use words without full stops")
    if config.max_photos < 1 or config.max_per_label < 1:
        raise BadInput("ground.max_photos and ground.max_per_label must be at least 1")
