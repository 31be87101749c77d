"""Say what a bucket's server answered as an OSError, in words that hold no secret.

The server's own texts and the client's dumps of requests may name access keys, so nothing
of them is passed on but the status and the error's code.
"""

from __future__ import annotations

import errno
import re
from collections.abc import Iterator
from contextlib import contextmanager

from storage.errors import StoreDenied, StoreError, StoreMissing

_STATUS = re.compile(r"status code: (\d{3})")
_CODE = re.compile(r"<Code>([A-Za-z]{1,64})</Code>")
_FULL = {"QuotaExceeded", "XMinioStorageFull", "InsufficientStorage", "EntityTooLarge"}
_DENIED = (401, 403)
_WRITES = ("write", "change", "remove", "copy")


@contextmanager
def translated(address: str, doing: str, what: str) -> Iterator[None]:
    """Raise what the client raises inside as an error that callers of a medium expect.

    Args:
        address: the store's.
        doing: a verb: read, list, write, change, remove, copy.
        what: the name of the document or member.

    Raises:
        FileNotFoundError: there is no such thing.
        ConnectionError, TimeoutError: the server does not answer, or is busy; retried before.
        PermissionError: it refuses a change.
        StoreDenied: it refuses to show something.
        StoreMissing: there is no such bucket.
        OSError: anything else; ENOSPC for a full server.
    """
    from obstore.exceptions import BaseError

    try:
        yield
    except FileNotFoundError as error:
        if "NoSuchBucket" in str(error):
            raise missing_bucket(address) from None
        raise FileNotFoundError(errno.ENOENT, f"no {what} in {address}") from None
    except (BaseError, PermissionError) as error:
        raise _explained(error, address, doing, what) from None


def missing_bucket(address: str) -> StoreMissing:
    """Return the error for a bucket that the server does not know."""
    return StoreMissing(
        f"there is no bucket for the store {address}: create it, or correct the address or"
        " AWS_ENDPOINT_URL and AWS_REGION"
    )


def _explained(error: Exception, address: str, doing: str, what: str) -> Exception:
    text = str(error)
    status = int(found[1]) if (found := _STATUS.search(text)) else 0
    code = found[1] if (found := _CODE.search(text)) else ""
    answer = f"{status} {code}".strip()
    task = f"could not {doing} {what} in {address}"
    if code == "NoSuchBucket":
        return missing_bucket(address)
    denied = status in _DENIED or isinstance(error, PermissionError)
    if denied or "credential" in text.lower():
        return _refusal(answer or "no credentials", task, what if doing in _WRITES else "")
    if code in _FULL or status == 507:
        return OSError(errno.ENOSPC, f"{answer} on {what}", address)
    if "timed out" in text or "TimedOut" in text or "kind: Timeout" in text:
        return TimeoutError(errno.ETIMEDOUT, f"{task}: no answer in time")
    if status >= 500 or status == 429:
        return ConnectionResetError(errno.ECONNRESET, f"{task}: {answer}")
    if "kind: Connect" in text:
        return ConnectionRefusedError(errno.ECONNREFUSED, f"{task}: its server cannot be reached")
    if status == 0:
        return ConnectionResetError(errno.ECONNRESET, f"{task}: the connection broke off")
    return OSError(errno.EIO, f"{task}: {answer}")


def _refusal(answer: str, task: str, written: str) -> OSError | StoreError:
    if written:
        return PermissionError(errno.EACCES, f"{answer} on {written}")
    return StoreDenied(
        f"{task}: {answer}; check AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY,"
        " AWS_SESSION_TOKEN and what they may do (GetObject, PutObject, DeleteObject, ListBucket)"
    )
