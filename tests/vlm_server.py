"""A model's HTTP server on loopback that gives the answers it was told to, one after the other.

It speaks both APIs: what was asked tells which. It notes every request as it came.
"""

from __future__ import annotations

import base64
import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

KEY = "k3y-that/must+never=be seen"
KEY_VARIABLE = "GARDEN_TEST_DOOR"
"""No name by which a secret is known: only whoever asks the model knows that it holds one."""

MODEL = "gemini-3-flash-preview"
LOCAL_MODEL = "qwen3-vl-8b"


@dataclass(frozen=True)
class Reply:
    """What to give: a model's text, or (with ``body``) these very bytes.

    ``delay_s`` passes before; ``hang_up`` closes the connection in the place of an answer.
    ``finish`` is why it ended, in the API's words; ``cut`` becomes these.
    """

    text: str = ""
    status: int = 200
    body: bytes | None = None
    headers: dict[str, str] = field(default_factory=dict)
    finish: str = ""
    delay_s: float = 0.0
    hang_up: bool = False


@dataclass(frozen=True)
class Asked:
    """One request as it came."""

    path: str
    headers: dict[str, str]
    document: dict[str, Any]

    @property
    def texts(self) -> list[str]:
        return [p["text"] for p in self._parts() if "text" in p]

    @property
    def prompt(self) -> str:
        return self.texts[-1]

    @property
    def pictures(self) -> list[bytes]:
        found = []
        for part in self._parts():
            if "inlineData" in part:
                found.append(base64.b64decode(part["inlineData"]["data"]))
            if "image_url" in part:
                head, _, data = part["image_url"]["url"].partition(",")
                assert head == "data:image/jpeg;base64"
                found.append(base64.b64decode(data))
        return found

    def _parts(self) -> list[dict[str, Any]]:
        if "contents" in self.document:
            parts: list[dict[str, Any]] = self.document["contents"][0]["parts"]
            return parts
        content: list[dict[str, Any]] = self.document["messages"][0]["content"]
        return content


class VlmServer:
    """A running server; ``say`` queues replies, ``asked`` is what came."""

    def __init__(self) -> None:
        self.asked: list[Asked] = []
        self._replies: list[Reply] = []
        self._http = ThreadingHTTPServer(("127.0.0.1", 0), _handler(self))
        self._http.daemon_threads = True
        self._thread = threading.Thread(target=self._http.serve_forever, args=(0.02,))
        self._thread.start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._http.server_port}"

    def say(self, *replies: Reply | str) -> None:
        self._replies += [Reply(r) if isinstance(r, str) else r for r in replies]

    def next_reply(self, asked: Asked) -> Reply:
        self.asked.append(asked)
        return self._replies.pop(0) if self._replies else Reply(status=500, body=b"nothing to say")

    def stop(self) -> None:
        self._http.shutdown()
        self._thread.join()
        self._http.server_close()


@contextmanager
def vlm_server() -> Iterator[VlmServer]:
    server = VlmServer()
    try:
        yield server
    finally:
        server.stop()


def targets_json(*entries: tuple[str, str, list[float]], key: str = "box_2d", **more: Any) -> str:
    """Return what a model that does as it is told would answer."""
    targets = [{"name": n, "photo": p, key: b, "why": "needed"} for n, p, b in entries]
    return json.dumps({"targets": targets, **more})


def _body(reply: Reply, asked: Asked) -> bytes:
    if reply.body is not None:
        return reply.body
    google = {"": "STOP", "cut": "MAX_TOKENS"}.get(reply.finish, reply.finish)
    others = {"": "stop", "cut": "length"}.get(reply.finish, reply.finish)
    if "generateContent" in asked.path:
        thought = {"text": '{"targets": "a thought"}', "thought": True}
        parts = [thought, {"text": reply.text}] if reply.text else []
        document = {
            "candidates": [
                {"content": {"parts": parts}, "finishReason": google}
            ],
            "usageMetadata": {
                "promptTokenCount": 1200, "candidatesTokenCount": 80, "thoughtsTokenCount": 20,
            },
            "modelVersion": MODEL,
        }  # fmt: skip
    else:
        document = {
            "model": LOCAL_MODEL,
            "choices": [
                {"message": {"role": "assistant", "content": reply.text},
                 "finish_reason": others}
            ],
            "usage": {"prompt_tokens": 1200, "completion_tokens": 100},
        }  # fmt: skip
    return json.dumps(document).encode()


def _handler(server: VlmServer) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            data = self.rfile.read(int(self.headers["Content-Length"]))
            headers = {k.lower(): v for k, v in self.headers.items()}
            asked = Asked(self.path, headers, json.loads(data))
            reply = server.next_reply(asked)
            time.sleep(reply.delay_s)
            if reply.hang_up:
                self.close_connection = True
                return
            body = _body(reply, asked)
            try:
                self.send_response(reply.status)
                for name, value in reply.headers.items():
                    self.send_header(name, value)
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)
            except OSError:  # who asked has gone
                pass

        def log_message(self, format: str, *args: Any) -> None:
            pass

    return Handler
