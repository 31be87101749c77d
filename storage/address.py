"""Tell from an address what carries a store."""

from __future__ import annotations

import os
from pathlib import Path

from storage.errors import StoreFormatError
from storage.folder import FolderMedium
from storage.leases import LEASE_S
from storage.medium import Medium


def is_remote(address: str | os.PathLike[str]) -> bool:
    """Tell whether an address names a bucket, which other machines see as this one does."""
    return "://" in str(address)


def find_medium(
    address: str | os.PathLike[str], *, durable: bool = True, lease_s: float = LEASE_S
) -> Medium:
    """Return what is at ``address``: a bucket for ``s3://BUCKET/PREFIX``, else a folder.

    Raises:
        StoreFormatError: an address of a kind that is not known.
    """
    text = str(address)
    if not is_remote(text):
        return FolderMedium(Path(text).expanduser().absolute(), durable=durable, lease_s=lease_s)
    from storage.bucket_address import SCHEME, BucketAddress

    if not text.startswith(SCHEME):
        raise StoreFormatError(
            f"stores at {text.partition('://')[0]}:// are not known: give a folder or"
            " s3://BUCKET/PREFIX"
        )
    try:
        from storage.bucket import BucketMedium

        return BucketMedium(BucketAddress.parse(text), lease_s=lease_s)
    except ModuleNotFoundError as error:
        raise StoreFormatError(
            f"a store in a bucket needs the package {error.name}: pip install"
            " 'garden-scenes[bucket]'"
        ) from error
