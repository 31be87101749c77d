"""Take the small pictures of a scene from its own report."""

from __future__ import annotations

import base64
import io
import re
from pathlib import Path

import numpy as np
from PIL import Image

from flows.report.pictures import data_uri

LONG_SIDE = 240
_LOOKED_AT = 1 << 20
"""The photos and renders stand at the top of a report."""

_PICTURE = re.compile(r'src="data:image/jpeg;base64,([A-Za-z0-9+/=]+)" alt="([^"]*)"')


def thumbnails(package: Path) -> list[tuple[str, str]]:
    """Return a scene's first photo and its settled render as (data URI, what it shows).

    Fewer, or none, if the report has none.
    """
    try:
        with (package / "report.html").open(encoding="utf-8") as file:
            found = _PICTURE.findall(file.read(_LOOKED_AT))
    except (OSError, UnicodeDecodeError):
        return []
    photo = next(((data, alt) for data, alt in found if alt.startswith("photo ")), None)
    render = next(((data, alt) for data, alt in found if " after " in alt), None)
    return [(_smaller(data), alt) for data, alt in filter(None, (photo, render))]


def _smaller(data: str) -> str:
    with Image.open(io.BytesIO(base64.b64decode(data))) as image:
        return data_uri(np.asarray(image.convert("RGB")), LONG_SIDE)
