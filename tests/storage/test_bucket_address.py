"""Addresses of buckets: what is one, and which server may be asked."""

from __future__ import annotations

import pytest

from storage import Store, StoreFormatError
from storage.bucket_address import BucketAddress, endpoint_of


@pytest.mark.parametrize(
    ("text", "bucket", "prefix"),
    [
        ("s3://garden", "garden", ""),
        ("s3://garden/", "garden", ""),
        ("s3://my.scenes-1/a/b", "my.scenes-1", "a/b"),
        ("s3://garden//a//b/", "garden", "a/b"),
    ],
)
def test_addresses_have_one_form(text: str, bucket: str, prefix: str) -> None:
    address = BucketAddress.parse(text)
    assert (address.bucket, address.prefix) == (bucket, prefix)
    assert BucketAddress.parse(str(address)) == address


@pytest.mark.parametrize(
    "text",
    [
        "s3://",
        "s3:///a",
        "s3://Garden/a",
        "s3://a",
        "s3://garden/../other",
        "s3://garden/a b",
        "s3://garden/a?x=1",
        "s3://AKIAX:secret@garden/a",
    ],
)
def test_what_is_no_address_is_refused_without_repeating_it(text: str) -> None:
    with pytest.raises(StoreFormatError, match="s3://BUCKET/PREFIX") as refused:
        Store.open(text)
    assert "secret" not in str(refused.value)


def test_other_servers_are_named_as_unknown() -> None:
    with pytest.raises(StoreFormatError, match="gs:// are not known"):
        Store.open("gs://garden/x")


@pytest.mark.parametrize(
    "url",
    ["http://127.0.0.1:9000", "http://localhost:9000", "http://[::1]:9", "https://s3.example"],
)
def test_loopback_and_https_are_fine(url: str) -> None:
    assert endpoint_of({"AWS_ENDPOINT_URL": url}) == url


def test_plain_http_to_another_machine_must_be_asked_for() -> None:
    given = {"AWS_ENDPOINT_URL": "http://10.0.0.7:9000"}
    with pytest.raises(StoreFormatError, match="AWS_ALLOW_HTTP=true"):
        endpoint_of(given)
    assert endpoint_of(given | {"AWS_ALLOW_HTTP": "true"}) == "http://10.0.0.7:9000"


def test_a_server_with_credentials_in_its_address_is_refused() -> None:
    with pytest.raises(StoreFormatError, match="without credentials") as refused:
        endpoint_of({"AWS_ENDPOINT_URL": "https://key:secret@s3.example"})
    assert "secret" not in str(refused.value)


def test_amazon_is_the_default() -> None:
    assert endpoint_of({}) is None
    assert endpoint_of({"AWS_ENDPOINT_URL": ""}) is None
