"""Speak Google's ``generateContent``."""

from __future__ import annotations

import base64
from typing import Any
from urllib.parse import quote

from garden_models.targets.config import ProposeTargets
from garden_models.targets.vlm_model import VlmAnswer, VlmRequest

Json = dict[str, Any]


def path(model: str) -> str:
    """Return the address below the server's."""
    return f"/v1beta/models/{quote(model, safe='')}:generateContent"


def headers(key: str) -> dict[str, str]:
    """Return the headers that carry the key."""
    return {"x-goog-api-key": key} if key else {}


def body(request: VlmRequest, config: ProposeTargets) -> Json:
    """Return the request's JSON: each picture after its label, the question at the end."""
    parts: list[Json] = []
    for image in request.images:
        data = base64.b64encode(image.jpeg).decode()
        parts += [
            {"text": f"{image.label}:"},
            {"inlineData": {"mimeType": "image/jpeg", "data": data}},
        ]
    parts.append({"text": request.prompt})
    settings: Json = {}
    if config.structured:
        settings["responseMimeType"] = "application/json"
        settings["responseSchema"] = _google_schema(request.schema)
    if config.temperature is not None:
        settings["temperature"] = config.temperature
    if config.thinking:
        settings["thinkingConfig"] = {"thinkingLevel": config.thinking.upper()}
    return {"contents": [{"role": "user", "parts": parts}], "generationConfig": settings}


def read(document: Json, model: str) -> tuple[VlmAnswer, str]:
    """Return the answer, and why it ended (for an empty one).

    Raises LookupError, TypeError or AttributeError for another form.
    """
    usage = document.get("usageMetadata") or {}
    refused = document.get("promptFeedback")
    candidates = document["candidates"] if refused is None else document.get("candidates")
    first = candidates[0] if candidates else {}
    feedback = (refused or {}).get("blockReason")
    reason = str(first.get("finishReason") or feedback or "")
    parts = (first.get("content") or {}).get("parts") or []
    text = "".join(part.get("text", "") for part in parts if not part.get("thought"))
    thoughts = usage.get("thoughtsTokenCount") or 0
    written = usage.get("candidatesTokenCount")
    answer = VlmAnswer(
        text=text,
        model=str(document.get("modelVersion") or model),
        cut=reason == "MAX_TOKENS",
        input_tokens=usage.get("promptTokenCount"),
        output_tokens=None if written is None else written + thoughts,
    )
    return answer, reason


def _google_schema(schema: Json) -> Json:
    """Return a JSON schema in the part of OpenAPI's that the API takes."""
    known: Json = {}
    for name, value in schema.items():
        if name == "type":
            known[name] = value.upper()
        elif name == "properties":
            known[name] = {key: _google_schema(inner) for key, inner in value.items()}
        elif name == "items":
            known[name] = _google_schema(value)
        elif name != "additionalProperties":
            known[name] = value
    return known
