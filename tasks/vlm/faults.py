"""Tell from a server's refusal what is wrong, what to do, and whether to ask again."""

from __future__ import annotations

import email.utils
import json
import re
import time
from collections.abc import Mapping
from typing import Any

from garden_models.targets.answer_json import shortened
from tasks.vlm.server import Server
from tasks.vlm.unavailable import ModelUnavailable

_LASTING = ("insufficient_quota", "billing")


def refusal(
    status: int, headers: Mapping[str, str], body: bytes, server: Server, model: str
) -> ModelUnavailable:
    """Return the error that a status of 300 or more means."""
    text = body.decode("utf-8", "replace")
    said = server.clean(shortened(_message(text) or text, 200))
    where = f"({status}: {said})" if said else f"({status})"
    if status in (401, 403) or (status == 400 and "API_KEY_INVALID" in text):
        return ModelUnavailable(_refused_key(server, where))
    if status == 404:
        return ModelUnavailable(
            f"{server.shown} knows no model {model} {where}: check propose.model and "
            "propose.address"
        )
    if status == 429:
        return ModelUnavailable(
            f"{server.shown} takes no more requests for now {where}: start the run again later, "
            "what was done is kept",
            transient=not any(word in text.lower() for word in _LASTING),
            wait_s=_wait(headers, text),
        )
    if status == 408 or (status >= 500 and status != 501):
        return ModelUnavailable(
            f"{server.shown} failed {where}: start the run again later, what was done is kept",
            transient=True,
            wait_s=_wait(headers, text),
        )
    if status < 400:
        return ModelUnavailable(
            f"{server.shown} sends on to another address {where}: give that as propose.address"
        )
    return ModelUnavailable(
        f"{server.shown} refused the question to {model} {where}: if it does not know "
        "structured answers, set propose.structured = false"
    )


def _refused_key(server: Server, where: str) -> str:
    if server.key:
        return (
            f"{server.shown} refused the key in {server.key_variable} {where}: put a valid key "
            "there"
        )
    return (
        f"{server.shown} asks for a key {where}: name the environment variable that holds it as "
        "propose.key_variable"
    )


def _message(text: str) -> str:
    """Return the sentence in an error's JSON, empty if there is none."""
    found = _error(text)
    if isinstance(found, dict):
        found = found.get("message")
    return found if isinstance(found, str) else ""


def _error(text: str) -> Any:
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if isinstance(document, list) and document:
        document = document[0]
    return document.get("error", document) if isinstance(document, dict) else None


def _wait(headers: Mapping[str, str], text: str) -> float | None:
    """Return the seconds that a server asks to wait: ``Retry-After``, or Google's detail."""
    given = headers.get("retry-after", "").strip()
    if re.fullmatch(r"\d{1,7}(\.\d+)?", given):
        return float(given)
    if given:
        try:
            return max(0.0, email.utils.parsedate_to_datetime(given).timestamp() - time.time())
        except (TypeError, ValueError, OverflowError):
            return None
    error = _error(text)
    details = error.get("details") if isinstance(error, dict) else None
    for detail in details if isinstance(details, list) else []:
        delay = detail.get("retryDelay") if isinstance(detail, dict) else None
        if isinstance(delay, str) and re.fullmatch(r"\d{1,7}(\.\d+)?s", delay):
            return float(delay[:-1])
    return None
