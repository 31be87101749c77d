"""Find a bucket from its address and the environment that the usual S3 tools read.

``AWS_ACCESS_KEY_ID``, ``AWS_SECRET_ACCESS_KEY``, ``AWS_SESSION_TOKEN``, ``AWS_REGION`` and
``AWS_ENDPOINT_URL`` are read where the requests are made; none of them is kept here.
"""

from __future__ import annotations

import ipaddress
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import timedelta
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from storage.errors import StoreFormatError

if TYPE_CHECKING:
    from obstore.store import S3Store

SCHEME = "s3://"
_BUCKET = re.compile(r"[a-z0-9][a-z0-9.-]{1,61}[a-z0-9]")
_PREFIX = re.compile(r"[A-Za-z0-9!_.*'()=/-]*")
RETRY_TIMEOUT_S = 30.0
_RETRIES = 8
_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.1, 4.0


@dataclass(frozen=True)
class BucketAddress:
    """Where a store is: ``s3://bucket/prefix``. ``prefix`` may be empty."""

    bucket: str
    prefix: str

    def __str__(self) -> str:
        return f"{SCHEME}{self.bucket}/{self.prefix}".rstrip("/")

    @classmethod
    def parse(cls, text: str) -> BucketAddress:
        """Read an address; StoreFormatError if it is none."""
        bucket, _, prefix = text.removeprefix(SCHEME).partition("/")
        parts = [part for part in prefix.split("/") if part]
        fits = _BUCKET.fullmatch(bucket) and _PREFIX.fullmatch(prefix)
        if not text.startswith(SCHEME) or not fits or ".." in parts or "." in parts:
            # The text itself stays out of the message: someone may have put a secret in it.
            raise StoreFormatError(
                "a store in a bucket is addressed as s3://BUCKET/PREFIX, with a bucket name in"
                " lower case and nothing before it; credentials belong in AWS_ACCESS_KEY_ID and"
                " AWS_SECRET_ACCESS_KEY, the server in AWS_ENDPOINT_URL"
            )
        return cls(bucket, "/".join(parts))


def connect(address: BucketAddress) -> S3Store:
    """Return a client of the bucket; nothing is sent yet.

    Raises:
        StoreFormatError: the environment names a server that must not be used.
    """
    from obstore.store import S3Store

    endpoint = endpoint_of(os.environ)
    given: dict[str, Any] = {} if endpoint is None else {"endpoint": endpoint}
    return S3Store(
        address.bucket,
        prefix=address.prefix or None,
        client_options={
            "allow_http": endpoint is not None and endpoint.startswith("http://"),
            "connect_timeout": "5s",
            "read_timeout": "30s",
            "timeout": "5m",
        },
        retry_config={
            "max_retries": _RETRIES,
            "retry_timeout": timedelta(seconds=RETRY_TIMEOUT_S),
            "backoff": {
                "init_backoff": timedelta(seconds=_FIRST_PAUSE_S),
                "max_backoff": timedelta(seconds=_LONGEST_PAUSE_S),
                "base": 2,
            },
        },
        **given,
    )


def endpoint_of(environment: Mapping[str, str]) -> str | None:
    """Return the server's address, None for Amazon's own.

    Raises:
        StoreFormatError: it is plain HTTP to another machine, on which anybody could read
            and change what passes, and ``AWS_ALLOW_HTTP`` does not ask for that.
    """
    names = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT")
    endpoint = next((environment[name] for name in names if environment.get(name)), None)
    if endpoint is None:
        return None
    parts = urlsplit(endpoint)
    host = parts.hostname
    if parts.scheme not in ("http", "https") or not host or "@" in parts.netloc:
        raise StoreFormatError(
            "AWS_ENDPOINT_URL is no server's address: give https://HOST, without credentials"
        )
    allowed = environment.get("AWS_ALLOW_HTTP", "").lower() in ("1", "true", "yes")
    if parts.scheme == "http" and not allowed and not _is_loopback(host):
        raise StoreFormatError(
            f"AWS_ENDPOINT_URL is plain HTTP to {host}: use https, or set AWS_ALLOW_HTTP=true"
            " on a network that you trust"
        )
    return endpoint.rstrip("/")


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
