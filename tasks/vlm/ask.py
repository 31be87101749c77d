"""Ask a model: send the question, wait and ask again where that can help, read the answer."""

from __future__ import annotations

import json
import random
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from typing import Any

from garden_models.progress import Progress
from garden_models.targets.config import ProposeTargets, api_of
from garden_models.targets.vlm_model import AskVlm, VlmAnswer, VlmRequest
from tasks.vlm import gemini, openai
from tasks.vlm.faults import refusal
from tasks.vlm.server import Server, server_of
from tasks.vlm.unavailable import ModelUnavailable

LONGEST_WAIT_S = 120.0
"""Between two requests; a server that asks for more is given up."""

MAX_ANSWER_BYTES = 8_000_000
_LOOK_EVERY_S = 0.2


def asker(config: ProposeTargets, progress: Progress) -> AskVlm:
    """Return the function that asks the configured model.

    It raises ModelUnavailable if there is no answer. ``progress`` is called while it waits.
    Raises BadInput if the key or the address is missing or wrong.
    """
    server = server_of(config)

    def ask(request: VlmRequest) -> VlmAnswer:
        return _with_retries(server, config, request, progress)

    return ask


def _with_retries(
    server: Server, config: ProposeTargets, request: VlmRequest, progress: Progress
) -> VlmAnswer:
    """Ask until there is an answer; only faults that may pass are met by asking again."""
    pause = config.pause_s
    for left in range(config.tries - 1, -1, -1):
        try:
            return _stoppably(
                lambda: _ask_once(server, config, request), f"asking {config.model}", progress
            )
        except ModelUnavailable as error:
            wait_s = pause * random.uniform(0.5, 1.5) if error.wait_s is None else error.wait_s
            if not error.transient or left == 0 or wait_s > LONGEST_WAIT_S:
                raise
        _wait(wait_s, server, progress)
        pause = min(2 * pause, LONGEST_WAIT_S / 2)
    raise AssertionError("tries is at least 1")


def _stoppably(ask: Callable[[], VlmAnswer], doing: str, progress: Progress) -> VlmAnswer:
    """Return what ``ask`` gives; the user's stop does not wait for a server that is silent."""
    outcome: Future[VlmAnswer] = Future()

    def work() -> None:
        try:
            outcome.set_result(ask())
        except BaseException as error:  # noqa: BLE001 - whoever waits for it gets it
            outcome.set_exception(error)

    threading.Thread(target=work, name="ask", daemon=True).start()
    started = time.monotonic()
    while not wait([outcome], _LOOK_EVERY_S).done:
        progress(0.1, f"{doing}, {time.monotonic() - started:.0f} s")
    return outcome.result()


def _wait(seconds: float, server: Server, progress: Progress) -> None:
    """Sleep; ``progress`` is where the user's stop is noticed."""
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        progress(0.1, f"{server.shown} is busy: asking again in {left:.0f} s")
        time.sleep(min(left, _LOOK_EVERY_S))


def _ask_once(server: Server, config: ProposeTargets, request: VlmRequest) -> VlmAnswer:
    api = gemini if api_of(config) == "gemini" else openai
    body = api.body(request, config)
    headers = {"Content-Type": "application/json", **api.headers(server.key)}
    data = _post(server, api.path(config.model), headers, json.dumps(body).encode(), config)
    try:
        answer, reason = api.read(json.loads(data), config.model)
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        said = server.clean(data[:120].decode("utf-8", "replace"))
        raise ModelUnavailable(
            f"{server.shown} answered in a form that is not its API's: {' '.join(said.split())!r}"
        ) from error
    if not answer.text.strip():
        because = f" ({server.clean(reason)[:120]})" if reason else ""
        raise ModelUnavailable(f"{config.model} gave an empty answer{because}: ask it again")
    return VlmAnswer(
        server.clean(answer.text),
        server.clean(answer.model),
        answer.cut,
        _count(answer.input_tokens),
        _count(answer.output_tokens),
    )


def _post(
    server: Server, path: str, headers: dict[str, str], body: bytes, config: ProposeTargets
) -> bytes:
    """Return the body of an answer with status 200; one that grows or lasts too much ends."""
    import httpx

    deadline = time.monotonic() + config.timeout_s
    try:
        with (
            httpx.Client(timeout=config.timeout_s, follow_redirects=False) as client,
            client.stream(
                "POST", server.base + path, headers=headers, content=body, auth=server.login
            ) as response,
        ):
            data = b""
            for chunk in response.iter_bytes():
                data += chunk
                if len(data) > MAX_ANSWER_BYTES:
                    raise ModelUnavailable(f"{server.shown} sent more than an answer can be long")
                if time.monotonic() > deadline:
                    raise httpx.ReadTimeout("the answer came too slowly")
            if response.status_code != httpx.codes.OK:
                raise refusal(response.status_code, response.headers, data, server, config.model)
            return data
    except httpx.TimeoutException:
        raise ModelUnavailable(
            f"{server.shown} did not answer within {config.timeout_s:g} s: start the run again "
            "later, or give it more time as propose.timeout_s",
            transient=True,
        ) from None
    except (httpx.HTTPError, httpx.InvalidURL, OSError) as error:
        raise ModelUnavailable(
            f"{server.shown} cannot be reached ({server.clean(str(error)) or type(error).__name__})"
            ": check the network, or propose.address",
            transient=True,
        ) from None


def _count(value: Any) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) else None
