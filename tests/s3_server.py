"""An S3-compatible server on loopback, which counts requests and fails when told to.

``python -m tests.s3_server PORT`` serves moto's implementation. Moto looks at a put's
condition and writes in two moments; here one lock makes these one, as S3 promises. Requests
to ``/~/`` control the server itself.
"""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from obstore.store import S3Store

BUCKET = "garden"
CONTROL = "/~/"
WRITES = ("PUT", "POST", "DELETE")
HERE = Path(__file__).resolve().parents[1]
ENVIRONMENT = {
    "AWS_ACCESS_KEY_ID": "AKIATESTTESTTEST",
    "AWS_SECRET_ACCESS_KEY": "a/secret/that/must/not/be/seen",
    "AWS_REGION": "us-east-1",
}


@dataclass
class S3Server:
    """A running server. ``stop`` and ``start`` again to lose what it holds."""

    port: int
    process: subprocess.Popen[bytes] | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def environment(self) -> dict[str, str]:
        return ENVIRONMENT | {"AWS_ENDPOINT_URL": self.url}

    def start(self) -> None:
        command = [sys.executable, "-m", "tests.s3_server", str(self.port)]
        self.process = subprocess.Popen(
            command, cwd=HERE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        deadline = time.monotonic() + 120
        while True:
            try:
                self.ask("PUT", f"/{BUCKET}")
                return
            except OSError:
                if time.monotonic() > deadline or self.process.poll() is not None:
                    raise
                time.sleep(0.05)

    def stop(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process = None

    def ask(self, method: str, path: str, data: bytes = b"") -> bytes:
        request = urllib.request.Request(self.url + path, data or None, method=method)
        with urllib.request.urlopen(request, timeout=30) as answer:
            return bytes(answer.read())

    def fail(self, times: int = 1, **fault: Any) -> None:
        """Have requests fail: ``method``, ``path`` (a part of it), ``status``, ``code``.

        Status 0 closes the connection before anything is done, status 1 after it was done;
        status 200 does the request ``delay`` seconds later. ``times=0`` ends all faults.
        """
        self.ask("POST", CONTROL + "fail", json.dumps({"times": times} | fault).encode())

    def counted(self) -> list[dict[str, Any]]:
        """Return the requests since the last call.

        Each has method, path, status, sent (bytes), and how many were going on at_once.
        """
        found: list[dict[str, Any]] = json.loads(self.ask("POST", CONTROL + "log"))
        return found

    # -- what stands in the bucket, behind the store's back -----------------------------------

    def bucket(self) -> S3Store:
        from obstore.store import S3Store

        return S3Store(
            BUCKET,
            endpoint=self.url,
            access_key_id=ENVIRONMENT["AWS_ACCESS_KEY_ID"],
            secret_access_key=ENVIRONMENT["AWS_SECRET_ACCESS_KEY"],
            client_options={"allow_http": True},
        )

    def names(self, prefix: str = "") -> list[str]:
        return sorted(meta["path"] for meta in self.bucket().list(prefix.rstrip("/")).collect())

    def get(self, name: str) -> bytes:
        return bytes(self.bucket().get(name).bytes())

    def put(self, name: str, data: bytes) -> None:
        self.bucket().put(name, data)

    def delete(self, name: str) -> None:
        self.bucket().delete(name)

    def age(self, hours: float) -> None:
        """Make all that is in the bucket older."""
        self.ask("POST", CONTROL + "age", json.dumps({"hours": hours}).encode())


@contextmanager
def s3_server() -> Iterator[S3Server]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        server = S3Server(probe.getsockname()[1])
    try:
        server.start()
        yield server
    finally:
        server.stop()


# -- the server's process ---------------------------------------------------------------------


@dataclass
class Counting:
    """Put moto behind a lock, a log and a list of faults to come."""

    app: Callable[..., Iterable[bytes]]
    log: list[dict[str, Any]] = field(default_factory=list)
    faults: list[dict[str, Any]] = field(default_factory=list)
    writing: threading.Lock = field(default_factory=threading.Lock)
    guard: threading.Lock = field(default_factory=threading.Lock)
    active: int = 0

    def __call__(self, environ: dict[str, Any], start: Callable[..., Any]) -> Iterable[bytes]:
        method, path = environ["REQUEST_METHOD"], environ["PATH_INFO"]
        if path.startswith(CONTROL):
            return self._control(path.removeprefix(CONTROL), environ, start)
        fault = self._fault(method, path)
        if fault is not None and fault["status"] not in (1, 200):
            self._note(method, path, fault["status"], 0)
            return _failed(fault, environ, start)
        with self.guard:
            self.active += 1
        if fault is not None and fault["status"] == 200:
            time.sleep(fault["delay"])
        try:
            return self._serve(environ, start, fault)
        finally:
            with self.guard:
                self.active -= 1

    def _serve(
        self, environ: dict[str, Any], start: Callable[..., Any], fault: dict[str, Any] | None
    ) -> Iterable[bytes]:
        method, path = environ["REQUEST_METHOD"], environ["PATH_INFO"]
        status: list[str] = []

        def started(text: str, headers: list[Any], *rest: Any) -> Any:
            status.append(text)
            return start(text, headers, *rest)

        if method in WRITES:
            with self.writing:
                body = b"".join(self.app(environ, started))
        else:
            body = b"".join(self.app(environ, started))
        self._note(method, path, int(status[0].split()[0]), len(body))
        if fault is not None and fault["status"] == 1:
            return _failed(fault, environ, start)
        return [body]

    def _fault(self, method: str, path: str) -> dict[str, Any] | None:
        with self.guard:
            for fault in self.faults:
                fits = fault.get("method", method) == method and fault.get("path", "") in path
                if fits and fault["times"] > 0:
                    fault["times"] -= 1
                    return fault
        return None

    def _note(self, method: str, path: str, status: int, sent: int) -> None:
        with self.guard:
            note = {"method": method, "path": path, "status": status, "sent": sent}
            self.log.append(note | {"at_once": self.active})

    def _control(
        self, what: str, environ: dict[str, Any], start: Callable[..., Any]
    ) -> Iterable[bytes]:
        body = environ["wsgi.input"].read(int(environ.get("CONTENT_LENGTH") or 0))
        answer: object = {}
        with self.guard:
            if what == "log":
                answer, self.log = self.log, []
            elif what == "fail":
                fault = json.loads(body)
                self.faults = [] if fault["times"] == 0 else [*self.faults, fault]
            elif what == "age":
                _age(json.loads(body)["hours"])
        start("200 OK", [("Content-Type", "application/json")])
        return [json.dumps(answer).encode()]


def _age(hours: float) -> None:
    import datetime

    from moto.s3.models import s3_backends

    for backend in s3_backends["123456789012"].values():
        for bucket in backend.buckets.values():
            for key in bucket.keys.values():
                key.last_modified -= datetime.timedelta(hours=hours)


def _failed(
    fault: dict[str, Any], environ: dict[str, Any], start: Callable[..., Any]
) -> Iterable[bytes]:
    if fault["status"] in (0, 1):
        environ["werkzeug.socket"].shutdown(socket.SHUT_RDWR)
        raise ConnectionError
    code = fault.get("code", "Whatever")
    secret = "<AWSAccessKeyId>" + ENVIRONMENT["AWS_ACCESS_KEY_ID"] + "</AWSAccessKeyId>"
    body = f"<Error><Code>{code}</Code><Message>no</Message>{secret}</Error>".encode()
    start(f"{fault['status']} Failed", [("Content-Type", "application/xml")])
    return [body]


def main() -> None:
    from moto.server import DomainDispatcherApplication, create_backend_app
    from werkzeug.serving import run_simple

    app = Counting(DomainDispatcherApplication(create_backend_app))
    run_simple("127.0.0.1", int(sys.argv[1]), app, threaded=True)


if __name__ == "__main__":
    main()
