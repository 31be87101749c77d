"""Speak the chat completions of OpenAI, vLLM, Ollama, llama.cpp and others."""

from __future__ import annotations

import base64
from typing import Any

from garden_models.targets.config import ProposeTargets
from garden_models.targets.vlm_model import VlmAnswer, VlmRequest

Json = dict[str, Any]


def path(model: str) -> str:
    """Return the address below the server's."""
    return "/chat/completions"


def headers(key: str) -> dict[str, str]:
    """Return the headers that carry the key."""
    return {"Authorization": f"Bearer {key}"} if key else {}


def body(request: VlmRequest, config: ProposeTargets) -> Json:
    """Return the request's JSON: each picture after its label, the question at the end."""
    content: list[Json] = []
    for image in request.images:
        data = base64.b64encode(image.jpeg).decode()
        content += [
            {"type": "text", "text": f"{image.label}:"},
            {"type": "image_url", "image_url": {"url": f"data:image/jpeg;base64,{data}"}},
        ]
    content.append({"type": "text", "text": request.prompt})
    messages = [{"role": "user", "content": content}]
    document: Json = {"model": config.model, "messages": messages}
    if config.structured:
        document["response_format"] = {
            "type": "json_schema",
            "json_schema": {"name": "targets", "strict": True, "schema": request.schema},
        }
    if config.temperature is not None:
        document["temperature"] = config.temperature
    if config.thinking:
        document["reasoning_effort"] = config.thinking
    return document


def read(document: Json, model: str) -> tuple[VlmAnswer, str]:
    """Return the answer, and why it ended (for an empty one).

    Raises LookupError, TypeError or AttributeError for another form.
    """
    usage = document.get("usage") or {}
    first = document["choices"][0]
    message = first["message"]
    reason = str(message.get("refusal") or first.get("finish_reason") or "")
    content = message.get("content") or ""
    if isinstance(content, list):
        content = "".join(part.get("text", "") for part in content)
    answer = VlmAnswer(
        text=content,
        model=str(document.get("model") or model),
        cut=first.get("finish_reason") == "length",
        input_tokens=usage.get("prompt_tokens"),
        output_tokens=usage.get("completion_tokens"),
    )
    return answer, reason
