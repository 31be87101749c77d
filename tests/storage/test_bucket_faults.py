"""A bucket whose server is busy, answers late, loses answers, refuses, or goes away."""

from __future__ import annotations

import dataclasses
import traceback
from collections.abc import Iterator

import pytest

from storage import Store, StoreDenied, StoreFull, StoreReadOnly
from storage.digest import digest_value
from tests.s3_server import ENVIRONMENT, S3Server, s3_server
from tests.storage.media import behind
from tests.storage.samples import Scene, same, scene
from tests.storage.test_bucket import IN_A_BUCKET
from tests.storage.test_store import record_of

KEY = digest_value("key", domain="test/1")
BUSY = {"status": 503, "code": "SlowDown"}
CONFLICT = {"status": 409, "code": "ConditionalRequestConflict"}
UNHEARD, UNANSWERED = {"status": 0}, {"status": 1}


@IN_A_BUCKET
@pytest.mark.parametrize("fault", [BUSY, UNHEARD, UNANSWERED], ids=["busy", "deaf", "dumb"])
def test_faults_that_pass_are_not_noticed(
    store: Store, s3: S3Server, fault: dict[str, object]
) -> None:
    for method in ("PUT", "GET", "HEAD", "POST", "DELETE"):
        s3.fail(2, method=method, **fault)
    record = store.record(record_of(store))
    assert store.lookup(record.key) == (record, "hit")
    assert same(store.read(record.outputs["value"].object, Scene), scene())
    assert behind(store).names("conflicts/") == []
    assert store.verify("full") == []


@IN_A_BUCKET
@pytest.mark.parametrize("fault", [UNANSWERED, CONFLICT], ids=["unanswered", "conflict"])
def test_of_creators_one_wins_also_if_its_answer_is_lost(
    store: Store, s3: S3Server, fault: dict[str, object]
) -> None:
    s3.fail(1, method="PUT", path="pins/a", **fault)
    assert store.medium.create("pins/a", b"same")
    assert not store.medium.create("pins/a", b"same")


@IN_A_BUCKET
@pytest.mark.parametrize("fault", [UNANSWERED, CONFLICT], ids=["unanswered", "conflict"])
def test_a_lease_is_held_also_if_an_answer_is_lost(
    store: Store, s3: S3Server, fault: dict[str, object]
) -> None:
    s3.fail(1, method="PUT", path="leases/", **fault)
    lease = store.acquire(KEY)
    assert lease is not None
    longer = dataclasses.replace(lease, expires_at=lease.expires_at + 10)
    s3.fail(1, method="PUT", path="leases/", **fault)
    assert store.leases._exchange(KEY, lambda current: current == lease, longer)
    assert store.leases.holder(KEY) == longer
    assert Store.open(store.address).acquire(KEY) is None
    store.leases.release(lease)
    assert behind(store).names("leases/") == []


@IN_A_BUCKET
def test_who_lost_a_lease_takes_none_away(store: Store) -> None:
    """A worker that was suspended past its term comes back and releases."""
    late = Store.open(store.address, lease_s=0.01)
    lost = late.acquire(KEY)
    assert lost is not None
    late.leases.abandon_all()
    while (taken := store.acquire(KEY)) is None:
        pass
    late.leases.release(lost)
    assert store.leases.holder(KEY) == taken
    assert not late.leases._exchange(KEY, lambda current: current == lost, lost)
    assert store.leases.holder(KEY) == taken


@IN_A_BUCKET
def test_a_refusal_to_read_says_what_to_do_and_breaks_nothing(store: Store, s3: S3Server) -> None:
    record = store.record(record_of(store))
    for code in ("AccessDenied", "ExpiredToken", "SignatureDoesNotMatch"):
        for path in ("/actions/", "/manifest.json"):
            s3.fail(1, method="GET", path=path, status=403, code=code)
            with pytest.raises(StoreDenied, match=f"403 {code}; check AWS_ACCESS_KEY_ID"):
                store.lookup(record.key)
    assert store.lookup(record.key) == (record, "hit")
    assert behind(store).names("quarantine/") == []


@IN_A_BUCKET
def test_fail_loud_a_bucket_that_may_not_be_written_or_is_full(store: Store, s3: S3Server) -> None:
    s3.fail(1, method="PUT", path="/objects/", status=403, code="AccessDenied")
    with pytest.raises(StoreReadOnly, match="PutObject"):
        store.publish(scene())
    s3.fail(1, method="PUT", path="/actions/", status=403, code="AccessDenied")
    with pytest.raises(StoreReadOnly, match="--store"):
        store.record(record_of(store))
    s3.fail(1, method="PUT", path="/objects/", status=400, code="QuotaExceeded")
    with pytest.raises(StoreFull, match="quota"):
        store.publish(scene(1))
    assert list(store.actions()) == []
    assert store.verify() == []


@IN_A_BUCKET
def test_no_secret_reaches_a_message(store: Store, s3: S3Server) -> None:
    """The server's own texts name the access key; ours do not, nor do their tracebacks."""
    s3.fail(1, method="GET", status=403, code="SignatureDoesNotMatch")
    s3.fail(1, method="PUT", status=403, code="InvalidAccessKeyId")
    for act in (lambda: store.lookup(KEY), lambda: store.publish(scene())):
        with pytest.raises((StoreDenied, StoreReadOnly)) as caught:
            act()
        told = "".join(traceback.format_exception(caught.value)) + repr(caught.value)
        assert ENVIRONMENT["AWS_ACCESS_KEY_ID"] not in told
        assert ENVIRONMENT["AWS_SECRET_ACCESS_KEY"] not in told
    assert not any(
        ENVIRONMENT["AWS_SECRET_ACCESS_KEY"].encode() in behind(store).get(name)
        for name in behind(store).names("")
    )


@pytest.fixture
def own_server(monkeypatch: pytest.MonkeyPatch) -> Iterator[S3Server]:
    with s3_server() as server:
        for name, value in server.environment.items():
            monkeypatch.setenv(name, value)
        yield server


@pytest.mark.slow
def test_a_server_that_goes_away_is_told_and_one_that_comes_back_is_used(
    own_server: S3Server,
) -> None:
    store = Store.open("s3://garden/x")
    record = store.record(record_of(store))
    own_server.stop()
    for act in (
        lambda: store.lookup(record.key),
        lambda: store.read(record.outputs["value"].object, Scene),
        lambda: store.publish(scene(1)),
    ):
        with pytest.raises(ConnectionError, match="cannot be reached"):
            act()
    own_server.start()
    again = Store.open("s3://garden/x")
    assert again.lookup(record.key) == (None, "absent")  # the test's server forgets; ours goes on
    assert store.record(record_of(store)).key == record.key
