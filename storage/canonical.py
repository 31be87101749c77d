"""Encode values as bytes in exactly one way, so that a hash of them means something.

Every kind of value has a tag, so that 1, 1.0, True and "1", a tuple and a list, never
encode alike. Lengths precede contents, so that nothing can run over into its neighbour.
Rejected, with the place named: sets (no order), paths (a place is not a content), NaN
unless asked for (a key that holds one would never equal itself), and any other object.
"""

from __future__ import annotations

import dataclasses
import math
import struct
import sys
from pathlib import PurePath
from typing import Any, Literal

from storage.errors import Unstorable

NanPolicy = Literal["reject", "allow"]

UNKEYED = "unkeyed"
"""A dataclass field with ``metadata={UNKEYED: True}`` does not count."""


def canonical(value: object, *, domain: str, nan: NanPolicy = "reject") -> bytes:
    """Return the canonical bytes of ``value`` under the record type ``domain``.

    Args:
        value: None, bool, int, float, str, bytes, tuple, list, dict with str keys, numpy
            array or scalar, or a dataclass of these.
        domain: what is being encoded, e.g. ``garden.action/1``; two domains never collide.
        nan: whether NaN is an error or one more value (all NaN scalars are then alike;
            arrays always count by their bits).

    Raises:
        Unstorable: a value that has no canonical form.
    """
    parts: list[bytes] = []
    _text(domain, parts)
    _encode(value, parts, nan, "value")
    return b"".join(parts)


def dtype_name(array: Any) -> str:
    """Return the little-endian name of an array's element type, e.g. ``<f4`` or ``|b1``."""
    if array.dtype.kind not in "biufc":
        raise Unstorable(f"arrays of {array.dtype} cannot be stored: use numbers or booleans")
    return str(array.dtype.newbyteorder("<").str)


def little_endian(array: Any) -> Any:
    """Return ``array`` in C order and little-endian; no copy if it is so already."""
    import numpy as np

    dtype = array.dtype.newbyteorder("<")
    return np.ascontiguousarray(array, dtype=dtype).reshape(array.shape)


def plain_scalar(value: object) -> object:
    """Return a numpy scalar as the Python number it stands for, anything else unchanged."""
    numpy = sys.modules.get("numpy")
    if numpy is not None and isinstance(value, numpy.generic):
        return value.item()
    return value


def is_array(value: object) -> bool:
    """Tell whether ``value`` is a numpy array (without importing numpy)."""
    numpy = sys.modules.get("numpy")
    return numpy is not None and isinstance(value, numpy.ndarray)


def _text(text: str, parts: list[bytes]) -> None:
    data = text.encode()
    parts.append(b"s%d:" % len(data))
    parts.append(data)


def _float(value: float, parts: list[bytes], nan: NanPolicy, where: str) -> None:
    if math.isnan(value):
        if nan == "reject":
            raise Unstorable(f"{where} is NaN, which never equals itself: use None instead")
        value = math.nan
    parts.append(b"d" + struct.pack(">d", value))


def _encode(value: object, parts: list[bytes], nan: NanPolicy, where: str) -> None:
    value = plain_scalar(value)
    if value is None:
        parts.append(b"n")
    elif value is True:
        parts.append(b"t")
    elif value is False:
        parts.append(b"f")
    elif isinstance(value, int):
        parts.append(b"i%d;" % value)
    elif isinstance(value, float):
        _float(value, parts, nan, where)
    elif isinstance(value, str):
        _text(value, parts)
    elif isinstance(value, bytes):
        parts.append(b"b%d:" % len(value))
        parts.append(value)
    elif isinstance(value, tuple | list):
        parts.append(b"(" if isinstance(value, tuple) else b"[")
        for index, item in enumerate(value):
            _encode(item, parts, nan, f"{where}[{index}]")
        parts.append(b"e")
    elif isinstance(value, dict):
        _mapping(value, parts, nan, where)
    elif is_array(value):
        _array(value, parts)
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        parts.append(b"D")
        _text(type(value).__name__, parts)
        fields = {
            field.name: getattr(value, field.name)
            for field in dataclasses.fields(value)
            if not field.metadata.get(UNKEYED)
        }
        _mapping(fields, parts, nan, where)
    else:
        raise Unstorable(_why_not(value, where))


def _mapping(mapping: dict[Any, Any], parts: list[bytes], nan: NanPolicy, where: str) -> None:
    for key in mapping:
        if not isinstance(key, str):
            raise Unstorable(f"{where} has the key {key!r}: only str keys have a canonical order")
    parts.append(b"{")
    for key in sorted(mapping):
        _text(key, parts)
        _encode(mapping[key], parts, nan, f"{where}.{key}")
    parts.append(b"e")


def _array(array: Any, parts: list[bytes]) -> None:
    parts.append(b"a")
    _text(dtype_name(array), parts)
    _encode(tuple(array.shape), parts, "reject", "shape")
    data = little_endian(array).tobytes()
    parts.append(b"%d:" % len(data))
    parts.append(data)


def _why_not(value: object, where: str) -> str:
    if isinstance(value, set | frozenset):
        return f"{where} is a set, whose order is not defined: use a sorted tuple"
    if isinstance(value, PurePath):
        return f"{where} is a path, which says nothing of its content: use a SourceFile"
    return f"{where} is a {type(value).__name__}, which has no canonical form"
