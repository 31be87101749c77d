"""Hold results against collection, by name.

A pin names keys, objects or contents, or whole scenes. One with an owner is held for a
process, such as a run in progress, and is void when that process is dead or its time is over.
"""

from __future__ import annotations

import dataclasses
import json
import re
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from storage.digest import hexadecimal
from storage.errors import StoreError
from storage.medium import Medium
from storage.owner import Owner

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
_PLACE = "pins/"


@dataclass(frozen=True)
class Pin:
    """What is held under one name, why, and since when (Unix seconds)."""

    name: str
    digests: tuple[str, ...] = ()
    scenes: tuple[str, ...] = ()
    reason: str = ""
    created: float = 0.0
    owner: Owner | None = None
    expires_at: float | None = None

    def is_void(self) -> bool:
        """Tell whether it holds nothing any more."""
        if self.expires_at is not None and time.time() >= self.expires_at:
            return True
        return self.owner is not None and self.owner.is_dead()

    def to_bytes(self) -> bytes:
        """Return the pin as JSON."""
        return json.dumps({"format": 1, **dataclasses.asdict(self)}, sort_keys=True).encode()

    @classmethod
    def from_bytes(cls, name: str, data: bytes) -> Pin:
        """Read the pin called ``name``; ValueError if it is none."""
        try:
            document = json.loads(data)
            if document.pop("format") != 1 or document["name"] != name:
                raise ValueError("not the pin of this name, or of an unknown format")
            owner = document.pop("owner")
            return cls(
                digests=tuple(map(str, document.pop("digests"))),
                scenes=tuple(map(str, document.pop("scenes"))),
                owner=None if owner is None else Owner(**owner),
                **document,
            )
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"no pin: {error}") from error


def pin_name(name: str) -> str:
    """Return the name of a pin's document; StoreError for a name that is no plain word."""
    if not _NAME.fullmatch(name):
        raise StoreError(
            f"{name!r} cannot name a pin: use up to 100 letters, digits, '.', '_' and '-',"
            " beginning with a letter or digit"
        )
    return f"{_PLACE}{name}.json"


def create_pin(medium: Medium, pin: Pin) -> None:
    """Keep a pin; StoreError if the name is taken by another one or a digest is none."""
    for digest in pin.digests:
        try:
            hexadecimal(digest)
        except ValueError as error:
            raise StoreError(f"a pin holds whole digests: {error}") from None
    if not medium.create(pin_name(pin.name), pin.to_bytes()):
        raise StoreError(f"there is a pin {pin.name} already: remove it first, or choose a name")


def delete_pin(medium: Medium, name: str) -> bool:
    """Remove a pin; False if there is none."""
    present = medium.read(pin_name(name)) is not None
    medium.delete(pin_name(name))
    return present


def all_pins(medium: Medium) -> Iterator[Pin]:
    """Give every pin that holds something, by name.

    Raises:
        StoreError: one cannot be read, so that what it holds is not known.
    """
    for document in pin_documents(medium):
        pin = read_pin(medium, document)
        if pin is not None and not pin.is_void():
            yield pin


def pin_documents(medium: Medium) -> Iterable[str]:
    """Return the names of the documents of all pins."""
    return medium.names(_PLACE)


def read_pin(medium: Medium, document: str) -> Pin | None:
    """Return the pin in a document, void or not; None if it is gone; StoreError as above."""
    data = medium.read(document)
    if data is None:
        return None
    try:
        return Pin.from_bytes(document.removeprefix(_PLACE).removesuffix(".json"), data)
    except ValueError as error:
        raise StoreError(
            f"the pin {document} cannot be read ({error}), so what it holds is not known: pin"
            " that again and run `garden store repair`"
        ) from error
