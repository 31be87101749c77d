"""What a vision-language model is asked and answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class LabelledImage:
    """A JPEG picture and the label by which the text speaks of it."""

    label: str
    jpeg: bytes


@dataclass(frozen=True)
class VlmRequest:
    """A question about pictures; ``schema`` is the JSON schema that the answer should have."""

    prompt: str
    images: tuple[LabelledImage, ...]
    schema: dict[str, Any]


@dataclass(frozen=True)
class VlmAnswer:
    """The answer's text; ``cut`` tells that the server ended it before it was finished.

    ``model`` is the name under which the server answered. Tokens are None if not counted.
    """

    text: str
    model: str
    cut: bool = False
    input_tokens: int | None = None
    output_tokens: int | None = None


AskVlm = Callable[[VlmRequest], VlmAnswer]
